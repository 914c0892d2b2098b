/* The task at the control rate: shared-model/src/ecu/control.rs with end-to-end protection, frames, controller and gate. */

#include "channels.h"
#include "feedback.h"
#include "gate.h"
#include "reference.h"
#include <float.h>
#include <math.h>
#include <string.h>

#define CONTROL_RATE_HZ 1000.0f
#define SENSOR_DATA_ID 0x5A01
#define ACTUATOR_DATA_ID 0x5A02
#define MAX_DELTA_COUNTER 3
#define ROUNDING 1e-6f
/* The state machine of the sensor frames: window and thresholds. */
#define WINDOW 0xFFFFFFu
#define MIN_OK_INIT 11
#define MAX_ERROR_INIT 7
#define MIN_OK_VALID 11
#define MAX_ERROR_VALID 7
#define MIN_OK_INVALID 20
#define MAX_ERROR_INVALID 2
/* Challenges: start of the generator, greatest age. */
#define SEED 0x5A015A02u
#define MAX_AGE_TICKS 15
#define MIN_AGE_TICKS 3
/* Bit of the mode byte. */
#define BRIDGE_ON 0x80
/* Faults that switch the bridge off, and those that do so if they are new in the safe state. */
#define BRIDGE_FAULTS (1u << FAULT_READBACK | 1u << FAULT_CHANNELS_DIFFER)
#define SERVO_FAULTS (BRIDGE_FAULTS | 1u << FAULT_DITHER_AMPLITUDE | 1u << FAULT_DITHER_FREQUENCY)
/* Faults after which the safe state keeps the dither up. */
#define KEEP_DITHER                                                                                        \
    (1u << FAULT_SENSOR_NOT_A_NUMBER | 1u << FAULT_SENSOR_RANGE | 1u << FAULT_SENSOR_RATE |               \
     1u << FAULT_SENSOR_STUCK | 1u << FAULT_STEERING_INCONSISTENT | 1u << FAULT_LATERAL_ACCELERATION |    \
     1u << FAULT_FRAME_AGE | 1u << FAULT_FRAMES_INVALID | 1u << FAULT_COMMAND_NOT_A_NUMBER |              \
     1u << FAULT_MOTOR_VOLTAGE | 1u << FAULT_MOTOR_SLEW | 1u << FAULT_FEEDBACK_VOLTAGE |                  \
     1u << FAULT_FEEDBACK_SLEW | 1u << FAULT_DITHER_WEAK | 1u << FAULT_DITHER_COMMAND)

enum mode { MODE_STARTING, MODE_ACTIVE, MODE_SAFE };

enum reception { RECEIVED, RECEIVED_SOME_LOST, NOTHING_NEW, DAMAGED, REPEATED, WRONG_SEQUENCE };

enum warning { FRAME_MISSING, FRAME_DAMAGED, FRAME_REPEATED, FRAME_SEQUENCE, FRAMES_LOST, FRAME_STALE, OVERSPEED };

enum communication { NO_DATA, INIT, VALID, INVALID };

struct command {
    float motor_v;
    float feedback_v;
    float dither_amplitude_v;
};

struct controller {
    float schedule_first_rpm;
    float schedule_step_rpm;
    float schedule_amplitudes_v[SCHEDULE_POINTS];
    float off_below_rpm;
    float on_from_rpm;
    float amplitude_v;
    float amplitude_step_v;
    float motor_current_a;
    float most_current_a;
    float current_step_a;
    float winding_resistance_ohm;
    uint32_t ticks_to_dither;
    uint32_t dither_on;
    uint32_t has_feedback;
};

struct limits {
    float motor_voltage_v;
    float motor_slew_v_per_s;
    float feedback_voltage_v;
    float feedback_slew_v_per_s;
    float square_amplitude_v;
    float sine_amplitude_v;
    float dither_above_rpm;
    float square_least_amplitude_v;
    float sine_least_amplitude_v;
    float square_safe_amplitude_v;
    float sine_safe_amplitude_v;
    float weak_dither_s;
    float dither_frequency_min_rad_per_s;
    float dither_frequency_max_rad_per_s;
    float ramp_out_s;
    float safe_wheel_speed_rpm;
    float wheel_speed_rpm;
    float wheel_speed_sensor_rpm;
    float wheel_acceleration_rpm_per_s;
    float yaw_rate_rad_per_s;
    float yaw_acceleration_rad_per_s2;
    float steering_angle_rad;
    float steering_angle_change_rad_per_s;
    float steering_rate_rad_per_s;
    float steering_acceleration_rad_per_s2;
    float current_request_a;
    float lateral_acceleration_m_per_s2;
    float steering_contradiction_rad;
    float steering_memory_s;
    float stuck_steering_rad;
    float stuck_wheel_speed_rpm;
    float frame_age_s;
    float tick_tolerance;
};

/* The limits that a running gate uses. */
struct sensor_limits {
    float wheel_speed_sensor_rpm;
    float wheel_acceleration_rpm_per_s;
    float yaw_rate_rad_per_s;
    float yaw_acceleration_rad_per_s2;
    float steering_angle_rad;
    float steering_angle_change_rad_per_s;
    float steering_rate_rad_per_s;
    float steering_acceleration_rad_per_s2;
    float current_request_a;
    float lateral_acceleration_m_per_s2;
    float steering_contradiction_rad;
    float steering_memory_s;
    float stuck_steering_rad;
    float stuck_wheel_speed_rpm;
    float dither_above_rpm;
};

struct plausibility {
    float control_period_s;
    float speed_per_rpm;
    struct measurement last;
    uint32_t has_last;
    float ticks;
    float contradiction_rad;
    float unanswered_steering_rad;
};

struct supervisor {
    struct sensor_limits limits;
    float wheel_speed_rpm;
    float safe_wheel_speed_rpm;
    struct plausibility plausibility;
    float most_motor_v;
    float most_motor_change_v;
    float most_feedback_v;
    float most_feedback_change_v;
    float most_dither_amplitude_v;
    float slew_v;
    float safe_amplitude_v;
    float ramp_v;
    uint32_t window_least_counts;
    uint32_t window_most_counts;
    uint32_t frame_age_ticks;
    uint32_t age_ticks;
    float least_dither_v;
    uint32_t max_weak_ticks;
    uint32_t ticks_to_dither;
    uint32_t weak_ticks;
    enum mode mode;
    uint32_t faults;
    uint32_t found;
    uint32_t bridge_on;
    struct reference_setpoint setpoint;
    /* Shares of the last command that passed. */
    float motor_v;
    float feedback_v;
};

struct challenger {
    uint64_t nibbles;
    uint32_t generator;
    uint8_t number;
    uint8_t sent;
};

struct state_machine {
    uint32_t ok;
    uint32_t error;
    enum communication state;
};

struct channel {
    struct challenger challenger;
    struct state_machine state_machine;
    struct measurement measurement;
    uint32_t has_measurement;
    struct controller controller;
    struct supervisor supervisor;
    uint8_t received_counter;
    uint8_t valid_counter;
    uint8_t sent_counter;
    struct feedback feedback;
    struct line line;
};

struct task {
    struct channel channels[2];
    bool frames_differed;
};

/* Table of the polynomial 0x1021, filled at set-up. */
static uint16_t crc_table[256];

static inline uint16_t crc_byte(uint16_t crc, uint8_t byte)
{
    return (uint16_t)(crc << 8) ^ crc_table[(crc >> 8) ^ byte];
}

/* Of the frame after the checksum's own bytes, then of the data ID. */
static inline uint16_t checksum(const uint8_t *frame, uint16_t data_id)
{
    uint16_t crc = 0xFFFF;

    for (int i = 2; i < FRAME_LEN; i++)
        crc = crc_byte(crc, frame[i]);
    crc = crc_byte(crc, data_id & 0xFF);
    return crc_byte(crc, data_id >> 8);
}

static inline enum reception receive(struct channel *channel, const struct reference_control_input *input)
{
    const uint8_t *frame = input->frame;

    if (!input->has_frame)
        return NOTHING_NEW;
    if ((uint16_t)(frame[0] | frame[1] << 8) != checksum(frame, SENSOR_DATA_ID))
        return DAMAGED;
    const uint8_t delta = frame[2] - channel->received_counter;
    channel->received_counter = frame[2];
    if (delta == 0)
        return REPEATED;
    if (delta == 1)
        return RECEIVED;
    return delta <= MAX_DELTA_COUNTER ? RECEIVED_SOME_LOST : WRONG_SEQUENCE;
}

static inline uint8_t next_challenge(struct challenger *challenger)
{
    uint32_t generator = challenger->generator;

    generator ^= generator << 13;
    generator ^= generator >> 17;
    generator ^= generator << 5;
    challenger->generator = generator;
    challenger->nibbles = challenger->nibbles << 4 | generator >> 28;
    challenger->number = (challenger->number + 1) & 0xF;
    if (challenger->sent < MAX_AGE_TICKS)
        challenger->sent++;
    return (uint8_t)(generator >> 28 << 4 | challenger->number);
}

/* Control ticks since the challenge that was returned; 0 if it is none of the last. */
static inline uint32_t age_ticks(const struct challenger *challenger, uint8_t echo)
{
    const uint32_t age = (uint32_t)(challenger->number + 1 - echo) & 0xF;
    const uint32_t behind = (age - 1) & 0xF;
    const uint32_t nibble = (uint32_t)(challenger->nibbles >> 4 * behind) & 0xF;

    return age >= 1 && age <= challenger->sent && nibble == (uint32_t)(echo >> 4) ? age : 0;
}

/* As Rust's, in line: the compiler's own would be a call into its library. */
static inline int count_ones(uint32_t bits)
{
    bits -= bits >> 1 & 0x55555555;
    bits = (bits & 0x33333333) + (bits >> 2 & 0x33333333);
    bits = (bits + (bits >> 4)) & 0x0F0F0F0F;
    return (int)(bits * 0x01010101 >> 24);
}

static inline bool holds(const struct state_machine *machine, int min_ok, int max_error)
{
    return count_ones(machine->error) <= max_error && count_ones(machine->ok) >= min_ok;
}

static inline enum communication check_state(struct state_machine *machine, enum reception reception, bool is_stale)
{
    const bool is_error = is_stale || reception == DAMAGED;
    const bool is_ok = !is_stale && (reception == RECEIVED || reception == RECEIVED_SOME_LOST);

    if (machine->state == NO_DATA) {
        if (!is_error && reception != NOTHING_NEW)
            machine->state = INIT;
        return machine->state;
    }
    machine->ok = (machine->ok << 1 | is_ok) & WINDOW;
    machine->error = (machine->error << 1 | is_error) & WINDOW;
    if (machine->state == INIT) {
        if (count_ones(machine->error) > MAX_ERROR_INIT)
            machine->state = INVALID;
        else if (count_ones(machine->ok) >= MIN_OK_INIT)
            machine->state = VALID;
    } else if (machine->state == VALID) {
        machine->state = holds(machine, MIN_OK_VALID, MAX_ERROR_VALID) ? VALID : INVALID;
    } else {
        machine->state = holds(machine, MIN_OK_INVALID, MAX_ERROR_INVALID) ? VALID : INVALID;
    }
    return machine->state;
}

static inline uint16_t warnings(enum reception reception)
{
    switch (reception) {
    case RECEIVED_SOME_LOST:
        return 1 << FRAMES_LOST;
    case NOTHING_NEW:
        return 1 << FRAME_MISSING;
    case DAMAGED:
        return 1 << FRAME_DAMAGED;
    case REPEATED:
        return 1 << FRAME_REPEATED;
    case WRONG_SEQUENCE:
        return 1 << FRAME_SEQUENCE;
    default:
        return 0;
    }
}

/* The larger of the amplitudes at both neighbouring speeds. */
static inline float scheduled_v(const struct controller *controller, float speed_rpm)
{
    const float place = (speed_rpm - controller->schedule_first_rpm) / controller->schedule_step_rpm;

    if (!(place >= 0.0f && isfinite(speed_rpm)))
        return 0.0f;
    const float last = (float)(SCHEDULE_POINTS - 1);
    if (place >= last)
        return controller->schedule_amplitudes_v[SCHEDULE_POINTS - 1];
    const uint32_t below = (uint32_t)place;
    const float lower = controller->schedule_amplitudes_v[below];
    const float upper = controller->schedule_amplitudes_v[below + 1];
    return upper > lower ? upper : lower;
}

static inline float towards(float value, float target, float step)
{
    return within(target, value - step, value + step);
}

static inline void switch_dither(struct controller *controller, float speed_rpm)
{
    if (controller->ticks_to_dither > 0)
        controller->ticks_to_dither--;
    else if (speed_rpm < controller->off_below_rpm)
        controller->dither_on = false;
    else if (speed_rpm >= controller->on_from_rpm)
        controller->dither_on = true;
}

static inline struct command controller_run(struct channel *channel, const struct measurement *now, bool is_new)
{
    struct controller *controller = &channel->controller;

    switch_dither(controller, now->wheel_speed_rpm);
    const float wanted_v = controller->dither_on ? scheduled_v(controller, now->wheel_speed_rpm) : 0.0f;
    controller->amplitude_v = towards(controller->amplitude_v, wanted_v, controller->amplitude_step_v);
    const float request = within(now->current_request_a, -controller->most_current_a, controller->most_current_a);
    controller->motor_current_a = towards(controller->motor_current_a, request, controller->current_step_a);
    const float motor_v = controller->motor_current_a * controller->winding_resistance_ohm;
    float feedback_v = 0.0f;
    if (controller->has_feedback)
        feedback_v = feedback_run(&channel->feedback, &channel->line, now, is_new, motor_v);
    return (struct command){ motor_v, feedback_v, controller->amplitude_v };
}

static inline bool is_finite(const struct measurement *now)
{
    return isfinite(now->wheel_speed_rpm) && isfinite(now->yaw_rate_rad_per_s) && isfinite(now->steering_angle_rad) &&
           isfinite(now->steering_rate_rad_per_s) && isfinite(now->current_request_a);
}

/* Magnitude at most bound; false for NaN. */
static inline bool is_within(float value, float bound)
{
    return fabsf(value) <= bound;
}

/* Finite, and zero or of a size that a sensor can have. */
static inline bool is_a_number(float value)
{
    return isfinite(value) && (fabsf(value) >= FLT_MIN || value == 0.0f);
}

static inline uint32_t compare(struct plausibility *plausibility, const struct sensor_limits *limits,
                               const struct measurement *now)
{
    const struct measurement *last = &plausibility->last;
    const float time_s = plausibility->ticks * plausibility->control_period_s;
    const bool all_slow =
        is_within(now->wheel_speed_rpm - last->wheel_speed_rpm, limits->wheel_acceleration_rpm_per_s * time_s) &&
        is_within(now->yaw_rate_rad_per_s - last->yaw_rate_rad_per_s, limits->yaw_acceleration_rad_per_s2 * time_s) &&
        is_within(now->steering_angle_rad - last->steering_angle_rad,
                  limits->steering_angle_change_rad_per_s * time_s) &&
        is_within(now->steering_rate_rad_per_s - last->steering_rate_rad_per_s,
                  limits->steering_acceleration_rad_per_s2 * time_s);
    const float moved_rad = now->steering_angle_rad - last->steering_angle_rad;
    const float mean_rate = 0.5f * (now->steering_rate_rad_per_s + last->steering_rate_rad_per_s);
    const float memory_s = limits->steering_memory_s;
    const float kept = memory_s / (memory_s + time_s);
    const bool is_answered = now->yaw_rate_rad_per_s != last->yaw_rate_rad_per_s;
    const bool can_answer = now->wheel_speed_rpm > limits->stuck_wheel_speed_rpm;

    plausibility->contradiction_rad = plausibility->contradiction_rad * kept + moved_rad - mean_rate * time_s;
    if (is_answered || !can_answer)
        plausibility->unanswered_steering_rad = 0.0f;
    else
        plausibility->unanswered_steering_rad += moved_rad;

    return fault_if(!all_slow, FAULT_SENSOR_RATE) |
           fault_if(!is_within(plausibility->contradiction_rad, limits->steering_contradiction_rad),
                    FAULT_STEERING_INCONSISTENT) |
           fault_if(!is_within(plausibility->unanswered_steering_rad, limits->stuck_steering_rad), FAULT_SENSOR_STUCK);
}

static inline uint32_t check_measurement(struct plausibility *plausibility, const struct sensor_limits *limits,
                                         const struct measurement *now)
{
    plausibility->ticks += 1.0f;
    if (!now)
        return 0;
    if (!(is_a_number(now->wheel_speed_rpm) && is_a_number(now->yaw_rate_rad_per_s) &&
          is_a_number(now->steering_angle_rad) && is_a_number(now->steering_rate_rad_per_s) &&
          is_a_number(now->current_request_a)))
        return 1u << FAULT_SENSOR_NOT_A_NUMBER;

    const bool in_range = now->wheel_speed_rpm >= 0.0f && now->wheel_speed_rpm <= limits->wheel_speed_sensor_rpm &&
                          is_within(now->yaw_rate_rad_per_s, limits->yaw_rate_rad_per_s) &&
                          is_within(now->steering_angle_rad, limits->steering_angle_rad) &&
                          is_within(now->steering_rate_rad_per_s, limits->steering_rate_rad_per_s) &&
                          is_within(now->current_request_a, limits->current_request_a);
    const float acceleration = now->wheel_speed_rpm * plausibility->speed_per_rpm * now->yaw_rate_rad_per_s;
    uint32_t faults = fault_if(!in_range, FAULT_SENSOR_RANGE) |
                      fault_if(!is_within(acceleration, limits->lateral_acceleration_m_per_s2),
                               FAULT_LATERAL_ACCELERATION);
    if (plausibility->has_last)
        faults |= compare(plausibility, limits, now);
    plausibility->last = *now;
    plausibility->has_last = true;
    plausibility->ticks = 0.0f;
    return faults;
}

static inline uint32_t command_faults(const struct supervisor *supervisor, const struct command *command)
{
    if (!(isfinite(command->motor_v) && isfinite(command->feedback_v) && isfinite(command->dither_amplitude_v)))
        return 1u << FAULT_COMMAND_NOT_A_NUMBER;
    const float change_v = command->motor_v - supervisor->motor_v;
    const float feedback_change_v = command->feedback_v - supervisor->feedback_v;
    const float sum_v = command->motor_v + command->feedback_v;
    const bool is_amplitude =
        command->dither_amplitude_v >= 0.0f && command->dither_amplitude_v <= supervisor->most_dither_amplitude_v;
    return fault_if(fabsf(command->motor_v) > supervisor->most_motor_v || fabsf(sum_v) > supervisor->most_motor_v,
                    FAULT_MOTOR_VOLTAGE) |
           fault_if(fabsf(change_v) > supervisor->most_motor_change_v, FAULT_MOTOR_SLEW) |
           fault_if(fabsf(command->feedback_v) > supervisor->most_feedback_v, FAULT_FEEDBACK_VOLTAGE) |
           fault_if(fabsf(feedback_change_v) > supervisor->most_feedback_change_v, FAULT_FEEDBACK_SLEW) |
           fault_if(!is_amplitude, FAULT_DITHER_COMMAND);
}

/* A control tick of an active ECU: the dither has been too weak for too long. */
static inline bool is_dither_missed(struct supervisor *supervisor, float amplitude_v)
{
    if (supervisor->ticks_to_dither > 0) {
        supervisor->ticks_to_dither--;
        return false;
    }
    const bool is_needed = supervisor->plausibility.has_last &&
                           supervisor->plausibility.last.wheel_speed_rpm > supervisor->limits.dither_above_rpm;
    if (!(is_needed && amplitude_v < supervisor->least_dither_v))
        supervisor->weak_ticks = 0;
    else if (supervisor->weak_ticks != UINT32_MAX)
        supervisor->weak_ticks++;
    return supervisor->weak_ticks > supervisor->max_weak_ticks;
}

static inline uint32_t judge(struct supervisor *supervisor, const struct measurement *now, uint32_t frame_ticks,
                             const struct command *command)
{
    uint32_t faults = check_measurement(&supervisor->plausibility, &supervisor->limits, now) |
                      command_faults(supervisor, command);

    if (now)
        supervisor->age_ticks = frame_ticks;
    else if (supervisor->age_ticks != UINT32_MAX)
        supervisor->age_ticks++;
    if (supervisor->mode == MODE_STARTING)
        return faults;
    faults |= fault_if(supervisor->age_ticks > supervisor->frame_age_ticks, FAULT_FRAME_AGE);
    faults |= fault_if(is_dither_missed(supervisor, command->dither_amplitude_v), FAULT_DITHER_WEAK);
    return faults;
}

/* `value` moved to `target` by at most `step`. */
static inline float stepped(float value, float target, float step)
{
    return value > target + step ? value - step : value < target - step ? value + step : target;
}

static inline void safe_setpoint(struct supervisor *supervisor)
{
    struct reference_setpoint *setpoint = &supervisor->setpoint;
    const bool is_trusted = !((supervisor->faults | supervisor->found) & ~(uint32_t)KEEP_DITHER);
    const float amplitude_v = is_trusted ? supervisor->safe_amplitude_v : 0.0f;

    setpoint->motor_v = stepped(setpoint->motor_v, 0.0f, supervisor->slew_v);
    setpoint->dither_amplitude_v = stepped(setpoint->dither_amplitude_v, amplitude_v, supervisor->ramp_v);
}

static inline void supervisor_run(struct supervisor *supervisor, const struct measurement *now, uint32_t frame_ticks,
                                  const struct command *command, uint32_t elapsed_counts,
                                  uint32_t found_outside)
{
    const bool in_time =
        elapsed_counts >= supervisor->window_least_counts && elapsed_counts <= supervisor->window_most_counts;
    const uint32_t added = found_outside & ~supervisor->found;

    if (found_outside & BRIDGE_FAULTS || (supervisor->mode == MODE_SAFE && added & SERVO_FAULTS))
        supervisor->bridge_on = false;
    supervisor->found |= found_outside;
    if (supervisor->mode == MODE_SAFE)
        supervisor->found |= fault_if(!in_time, FAULT_TICK_WINDOW);
    else {
        supervisor->faults |= found_outside | fault_if(supervisor->mode == MODE_ACTIVE && !in_time, FAULT_TICK_WINDOW) |
                              judge(supervisor, now, frame_ticks, command);
        if (supervisor->faults) {
            supervisor->mode = MODE_SAFE;
            if (!(supervisor->setpoint.dither_amplitude_v > 0.0f || supervisor->faults & 1u << FAULT_DITHER_WEAK))
                supervisor->safe_amplitude_v = 0.0f;
        } else if (now)
            supervisor->mode = MODE_ACTIVE;
    }
    if (supervisor->mode == MODE_STARTING)
        supervisor->setpoint = (struct reference_setpoint){ 0.0f, 0.0f };
    else if (supervisor->mode == MODE_ACTIVE) {
        supervisor->motor_v = command->motor_v;
        supervisor->feedback_v = command->feedback_v;
        supervisor->setpoint =
            (struct reference_setpoint){ command->motor_v + command->feedback_v, command->dither_amplitude_v };
    } else
        safe_setpoint(supervisor);
}

static inline struct reference_actuation channel_run(struct channel *channel, const struct reference_control_input *input,
                                                uint32_t found_outside)
{
    const enum reception reception = receive(channel, input);
    const bool is_whole = reception == RECEIVED || reception == RECEIVED_SOME_LOST;
    struct supervisor *supervisor = &channel->supervisor;
    const uint32_t ticks = is_whole ? age_ticks(&channel->challenger, input->frame[3]) : 0;
    const bool is_fresh = ticks != 0 && ticks <= supervisor->frame_age_ticks;
    const bool is_stale = is_whole && !is_fresh;
    const enum communication state = check_state(&channel->state_machine, reception, is_stale);
    const bool is_new = is_fresh && state == VALID;
    bool is_overspeed = false;
    bool is_finite_now = false;
    struct command command = { 0.0f, 0.0f, 0.0f };

    struct measurement now;

    if (is_new) {
        memcpy(&now, input->frame + 4, sizeof now);
        is_finite_now = is_finite(&now);
        if (is_finite_now) {
            channel->measurement = now;
            channel->has_measurement = true;
        }
        channel->valid_counter = channel->received_counter;
        is_overspeed = now.wheel_speed_rpm > supervisor->wheel_speed_rpm;
    }
    if (channel->has_measurement)
        command = controller_run(channel, &channel->measurement, is_finite_now);
    found_outside |= fault_if(state == INVALID && supervisor->mode == MODE_ACTIVE, FAULT_FRAMES_INVALID);
    supervisor_run(supervisor, is_new ? &now : NULL, ticks, &command, input->elapsed_counts,
                   found_outside);
    return (struct reference_actuation){
        .mode = supervisor->mode,
        .faults = supervisor->faults,
        .motor_voltage_v = supervisor->setpoint.motor_v,
        .dither_amplitude_v = supervisor->setpoint.dither_amplitude_v,
        .wheel_speed_limit_rpm = supervisor->mode == MODE_ACTIVE ? supervisor->wheel_speed_rpm :
                                                                   supervisor->safe_wheel_speed_rpm,
        .warnings = (uint16_t)(warnings(reception) | is_stale << FRAME_STALE | is_overspeed << OVERSPEED),
        .sensor_counter = channel->valid_counter,
        .bridge_on = supervisor->bridge_on && input->bridge_on,
        .challenge = next_challenge(&channel->challenger),
    };
}

/* The lower of two numbers, or the one that is finite. */
static inline float lower(float a, float b)
{
    return b < a || !isfinite(a) ? b : a;
}

static inline struct reference_actuation report(struct channel *channel, const struct reference_actuation *own,
                                         const struct reference_actuation *other, uint8_t *frame)
{
    struct reference_actuation actuation = *own;

    actuation.wheel_speed_limit_rpm = lower(own->wheel_speed_limit_rpm, other->wheel_speed_limit_rpm);
    actuation.bridge_on = own->bridge_on && other->bridge_on;
    frame[2] = channel->sent_counter++;
    frame[3] = (uint8_t)(actuation.mode | (actuation.bridge_on ? BRIDGE_ON : 0));
    memcpy(frame + 4, &actuation.faults, 4);
    memcpy(frame + 8, &actuation.motor_voltage_v, 4);
    memcpy(frame + 12, &actuation.dither_amplitude_v, 4);
    memcpy(frame + 16, &actuation.wheel_speed_limit_rpm, 4);
    memcpy(frame + 20, &actuation.warnings, 2);
    frame[22] = actuation.sensor_counter;
    frame[23] = actuation.challenge;
    const uint16_t crc = checksum(frame, ACTUATOR_DATA_ID);
    memcpy(frame, &crc, 2);
    return actuation;
}

void reference_control_tick(void *memory, const void *given, void *result)
{
    struct task *task = memory;
    const struct reference_control_input *input = given;
    struct reference_control_output *output = result;
    struct channel *a = &task->channels[0], *b = &task->channels[1];
    _Alignas(4) uint8_t frame[FRAME_LEN], other_frame[FRAME_LEN];
    const bool differ = task->frames_differed || !channels_agree(a, b, offsetof(struct channel, line));
    const uint32_t found_outside = input->found_by_pwm | fault_if(differ, FAULT_CHANNELS_DIFFER);
    const struct reference_actuation actuation_a = channel_run(a, input, found_outside);
    const struct reference_actuation actuation_b = channel_run(b, input, found_outside);

    output->actuation = report(a, &actuation_a, &actuation_b, frame);
    report(b, &actuation_b, &actuation_a, other_frame);
    task->frames_differed = !channels_agree(frame, other_frame, sizeof frame);
    output->setpoints[0] = a->supervisor.setpoint;
    output->setpoints[1] = b->supervisor.setpoint;
    output->bridge_on[0] = a->supervisor.bridge_on;
    output->bridge_on[1] = b->supervisor.bridge_on;
    memcpy(output->frame, frame, sizeof frame);
}

/* Set-up. */

static const struct limits RECONSTRUCTION = {
    .motor_voltage_v = 4.5f,
    .motor_slew_v_per_s = 4.0f,
    .feedback_voltage_v = 1.5f,
    .feedback_slew_v_per_s = 25.0f,
    .square_amplitude_v = 0.2f,
    .sine_amplitude_v = 1.3f,
    .dither_above_rpm = 1575.0f,
    .square_least_amplitude_v = 0.1f,
    .sine_least_amplitude_v = 0.9f,
    .square_safe_amplitude_v = 0.125f,
    .sine_safe_amplitude_v = 1.1f,
    .weak_dither_s = 0.7f,
    .dither_frequency_min_rad_per_s = 1500.0f,
    .dither_frequency_max_rad_per_s = 5000.0f,
    .ramp_out_s = 0.1f,
    .safe_wheel_speed_rpm = 1100.0f,
    .wheel_speed_rpm = 2500.0f,
    .wheel_speed_sensor_rpm = 4000.0f,
    .wheel_acceleration_rpm_per_s = 20000.0f,
    .yaw_rate_rad_per_s = 4.0f,
    .yaw_acceleration_rad_per_s2 = 200.0f,
    .steering_angle_rad = 1.1f,
    .steering_angle_change_rad_per_s = 20.0f,
    .steering_rate_rad_per_s = 4.0f,
    .steering_acceleration_rad_per_s2 = 200.0f,
    .current_request_a = 20.0f,
    .lateral_acceleration_m_per_s2 = 250.0f,
    .steering_contradiction_rad = 0.05f,
    .steering_memory_s = 0.2f,
    .stuck_steering_rad = 0.2f,
    .stuck_wheel_speed_rpm = 100.0f,
    .frame_age_s = 0.01f,
    .tick_tolerance = 0.2f,
};

static void crc_init(void)
{
    for (unsigned byte = 0; byte < 256; byte++) {
        uint16_t crc = (uint16_t)(byte << 8);
        for (int bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc << 1) ^ (crc & 0x8000 ? 0x1021 : 0);
        crc_table[byte] = crc;
    }
}

static void controller_init(struct controller *controller, const struct reference_choice *choice)
{
    float peak_v = 0.0f;

    controller->schedule_first_rpm = choice->schedule_first_rpm;
    controller->schedule_step_rpm = choice->schedule_step_rpm;
    for (int i = 0; i < SCHEDULE_POINTS; i++) {
        const float amplitude_v = choice->schedule_amplitudes_v[i];
        controller->schedule_amplitudes_v[i] = amplitude_v;
        if (amplitude_v > peak_v)
            peak_v = amplitude_v;
    }
    controller->off_below_rpm = 1530.0f;
    controller->on_from_rpm = controller->off_below_rpm + 20.0f;
    controller->most_current_a = 14.0f;
    controller->current_step_a = 10.0f * (1.0f / CONTROL_RATE_HZ);
    controller->winding_resistance_ohm = 0.3f;
    controller->has_feedback = choice->has_feedback;
    controller->ticks_to_dither = (uint32_t)(choice->start_time_s * CONTROL_RATE_HZ + 0.5f);
    controller->amplitude_step_v = peak_v / (0.5f * CONTROL_RATE_HZ);
}

static void supervisor_init(struct supervisor *supervisor, const struct reference_choice *choice)
{
    const struct limits *limits = &RECONSTRUCTION;
    const float period_s = 1.0f / CONTROL_RATE_HZ;
    const float counts = (float)choice->clock_hz * period_s;
    const float tolerance = RECONSTRUCTION.tick_tolerance * counts;
    const float amplitude_limit_v = choice->suppressing_waveform == WAVEFORM_SQUARE ? RECONSTRUCTION.square_amplitude_v :
                                    choice->suppressing_waveform == WAVEFORM_SINE   ? RECONSTRUCTION.sine_amplitude_v :
                                                                          0.0f;

    supervisor->limits = (struct sensor_limits){
        .wheel_speed_sensor_rpm = limits->wheel_speed_sensor_rpm,
        .wheel_acceleration_rpm_per_s = limits->wheel_acceleration_rpm_per_s,
        .yaw_rate_rad_per_s = limits->yaw_rate_rad_per_s,
        .yaw_acceleration_rad_per_s2 = limits->yaw_acceleration_rad_per_s2,
        .steering_angle_rad = limits->steering_angle_rad,
        .steering_angle_change_rad_per_s = limits->steering_angle_change_rad_per_s,
        .steering_rate_rad_per_s = limits->steering_rate_rad_per_s,
        .steering_acceleration_rad_per_s2 = limits->steering_acceleration_rad_per_s2,
        .current_request_a = limits->current_request_a,
        .lateral_acceleration_m_per_s2 = limits->lateral_acceleration_m_per_s2,
        .steering_contradiction_rad = limits->steering_contradiction_rad,
        .steering_memory_s = limits->steering_memory_s,
        .stuck_steering_rad = limits->stuck_steering_rad,
        .stuck_wheel_speed_rpm = limits->stuck_wheel_speed_rpm,
        .dither_above_rpm = limits->dither_above_rpm,
    };
    supervisor->wheel_speed_rpm = limits->wheel_speed_rpm;
    supervisor->safe_wheel_speed_rpm = limits->safe_wheel_speed_rpm;
    supervisor->plausibility.control_period_s = period_s;
    supervisor->plausibility.speed_per_rpm = (float)(6.28318530717958647693 / 60.0) * 0.3f * 1.0f;
    supervisor->slew_v = limits->motor_slew_v_per_s * period_s;
    supervisor->most_motor_v = limits->motor_voltage_v * (1.0f + ROUNDING);
    supervisor->most_motor_change_v = supervisor->slew_v + ROUNDING * limits->motor_voltage_v;
    const float feedback_limit_v = choice->has_feedback ? limits->feedback_voltage_v : 0.0f;
    supervisor->most_feedback_v = feedback_limit_v * (1.0f + ROUNDING);
    supervisor->most_feedback_change_v = limits->feedback_slew_v_per_s * period_s + ROUNDING * feedback_limit_v;
    supervisor->most_dither_amplitude_v = amplitude_limit_v * (1.0f + ROUNDING);
    supervisor->safe_amplitude_v = choice->suppressing_waveform == WAVEFORM_SQUARE ? limits->square_safe_amplitude_v :
                                   choice->suppressing_waveform == WAVEFORM_SINE   ? limits->sine_safe_amplitude_v :
                                                                         0.0f;
    supervisor->ramp_v = amplitude_limit_v * period_s / limits->ramp_out_s;
    supervisor->window_least_counts = (uint32_t)(counts - tolerance);
    supervisor->window_most_counts = (uint32_t)(counts + tolerance);
    const uint32_t ticks = (uint32_t)(limits->frame_age_s * CONTROL_RATE_HZ + 0.5f);
    supervisor->frame_age_ticks = ticks < MIN_AGE_TICKS ? MIN_AGE_TICKS : ticks > MAX_AGE_TICKS ? MAX_AGE_TICKS : ticks;
    supervisor->least_dither_v = choice->suppressing_waveform == WAVEFORM_SQUARE ? limits->square_least_amplitude_v :
                                 choice->suppressing_waveform == WAVEFORM_SINE   ? limits->sine_least_amplitude_v :
                                                                       0.0f;
    supervisor->max_weak_ticks = (uint32_t)(limits->weak_dither_s * CONTROL_RATE_HZ + 0.5f);
    supervisor->ticks_to_dither = (uint32_t)(choice->start_time_s * CONTROL_RATE_HZ + 0.5f);
    supervisor->bridge_on = true;
}

size_t reference_control_size(void)
{
    return sizeof(struct task);
}

void reference_control_init(void *memory, const struct reference_choice *choice)
{
    struct task *task = memory;

    crc_init();
    memset(task, 0, sizeof *task);
    for (int i = 0; i < 2; i++) {
        struct channel *channel = &task->channels[i];
        channel->challenger.generator = SEED;
        channel->received_counter = UINT8_MAX;
        channel->valid_counter = UINT8_MAX;
        controller_init(&channel->controller, choice);
        if (choice->has_feedback)
            feedback_init(&channel->feedback, &channel->line, &choice->orbits, CONTROL_RATE_HZ, channel->controller.ticks_to_dither);
        supervisor_init(&channel->supervisor, choice);
    }
}

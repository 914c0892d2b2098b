/*
 * The vehicle model's step and the ECU program's two tasks in C, to hold the instructions of the Rust program against.
 *
 * Same equations in the same order, single precision, no contraction: the same bits. What passes between the two languages
 * is here; src/twin.rs of the Rust side has the same declarations. Parameters are those of the preset `reconstruction` but for
 * what `struct twin_choice` says.
 */
#ifndef TWIN_H
#define TWIN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum waveform { WAVEFORM_NONE, WAVEFORM_SQUARE, WAVEFORM_SINE };
enum slip_form { SLIP_SMALL_ANGLE, SLIP_EXACT };
enum tire_kind { TIRE_CUBIC, TIRE_MAGIC_FORMULA };
enum friction_law { FRICTION_NONE, FRICTION_COULOMB_RATE, FRICTION_PRINTED_ANGLE };
enum friction_mode { FRICTION_STICKING, FRICTION_NEGATIVE, FRICTION_NEUTRAL, FRICTION_POSITIVE };
enum injection_kind { INJECTION_OFF, INJECTION_SQUARE_MEAN, INJECTION_SINE_MEAN, INJECTION_SHIFT };

#define FRAME_LEN 24
#define SCHEDULE_POINTS 41

/* What a scenario may choose. */
struct twin_choice {
    uint32_t waveform;
    uint32_t slip_form;
    uint32_t tire;
    uint32_t friction_law;
    uint32_t friction_dithered;
    float wheel_speed_rpm;
    float start_time_s;
    /* The dither's schedule: a table that both languages read. */
    float schedule_first_rpm;
    float schedule_step_rpm;
    const float *schedule_amplitudes_v;
    uint32_t clock_hz;
};

struct twin_state {
    /* Sideslip angle, yaw rate, steering angle, steering rate. */
    float x[4];
    uint32_t friction;
};

/* What the dither does to a nonlinearity's argument: an amplitude or an offset, rad. */
struct twin_injection {
    uint32_t kind;
    float rad;
};

struct twin_setpoint {
    float motor_v;
    float dither_amplitude_v;
};

struct twin_pwm_input {
    bool has_setpoints;
    struct twin_setpoint setpoints[2];
    /* Bits in which the pin shows another duty code than was put out. */
    uint16_t pin_error;
};

struct twin_pwm_output {
    uint16_t duty_code;
    bool control_due;
    /* Where a control tick is due. */
    uint32_t faults;
};

struct twin_control_input {
    bool has_frame;
    uint8_t frame[FRAME_LEN];
    uint32_t elapsed_counts;
    uint32_t found_by_pwm;
};

struct twin_actuation {
    uint32_t mode;
    uint32_t faults;
    float motor_voltage_v;
    float dither_amplitude_v;
    float wheel_speed_limit_rpm;
    uint16_t warnings;
    uint8_t sensor_counter;
};

struct twin_control_output {
    struct twin_setpoint setpoints[2];
    uint8_t frame[FRAME_LEN];
    struct twin_actuation actuation;
};

/* Bytes of a task's memory. */
size_t twin_model_size(void);
size_t twin_pwm_size(void);
size_t twin_control_size(void);

void twin_model_init(void *memory, const struct twin_choice *choice);
void twin_pwm_init(void *memory, const struct twin_choice *choice);
void twin_control_init(void *memory, const struct twin_choice *choice);

void twin_model_set_state(void *memory, const struct twin_state *state);
void twin_model_state(const void *memory, struct twin_state *state);

/* What is measured: task, input, output. The model's step has no output but its state. */
void twin_model_step(void *memory, const void *injection, void *unused);
void twin_pwm_period(void *memory, const void *input, void *output);
void twin_control_tick(void *memory, const void *input, void *output);

/* Both languages use these of one library. */
float twin_sinf(float x);
float twin_cosf(float x);
float twin_atanf(float x);
float twin_asinf(float x);

#endif

/*
 * C reference: the vehicle model's step and the ECU program's two tasks in C. The instructions of the Rust program are
 * compared with those of this one.
 *
 * Same equations in the same order, single precision, no contraction: the same bits. This file declares the data that the two
 * languages exchange; src/interface.rs has the same declarations in Rust. Parameters are those of the preset
 * `reconstruction`, except the choices in `struct reference_choice`.
 */
#ifndef REFERENCE_H
#define REFERENCE_H

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
#define ORBIT_POINTS 23

/* Periods of the orbits and gains of the delayed feedback: a table that both languages read. */
struct reference_orbits {
    float motor_current_a;
    float first_rpm;
    float step_rpm;
    const float *periods_s;
    const float *gains;
};

/* The choices of a scenario. */
struct reference_choice {
    uint32_t waveform;
    /* What the ECU suppresses the chaos with: the waveform or none, and the delayed feedback or not. */
    uint32_t suppressing_waveform;
    uint32_t has_feedback;
    struct reference_orbits orbits;
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

struct reference_state {
    /* Sideslip angle, yaw rate, steering angle, steering rate. */
    float x[4];
    uint32_t friction;
};

/* Effect of the dither on a nonlinearity's argument: an amplitude or an offset, rad. */
struct reference_injection {
    uint32_t kind;
    float rad;
};

struct reference_setpoint {
    float motor_v;
    float dither_amplitude_v;
};

struct reference_pwm_input {
    bool has_setpoints;
    struct reference_setpoint setpoints[2];
    bool bridge_on[2];
    /* Bits in which the pin shows another duty code than was put out. */
    uint16_t pin_error;
};

struct reference_pwm_output {
    uint16_t duty_code;
    bool control_due;
    bool bridge_on;
    /* Where a control tick is due. */
    uint32_t faults;
};

struct reference_control_input {
    bool has_frame;
    uint8_t frame[FRAME_LEN];
    uint32_t elapsed_counts;
    uint32_t found_by_pwm;
    bool bridge_on;
};

struct reference_actuation {
    uint32_t mode;
    uint32_t faults;
    float motor_voltage_v;
    float dither_amplitude_v;
    float wheel_speed_limit_rpm;
    uint16_t warnings;
    uint8_t sensor_counter;
    bool bridge_on;
    uint8_t challenge;
};

struct reference_control_output {
    struct reference_setpoint setpoints[2];
    bool bridge_on[2];
    uint8_t frame[FRAME_LEN];
    struct reference_actuation actuation;
};

/* Bytes of a task's memory. */
size_t reference_model_size(void);
size_t reference_pwm_size(void);
size_t reference_control_size(void);

void reference_model_init(void *memory, const struct reference_choice *choice);
void reference_pwm_init(void *memory, const struct reference_choice *choice);
void reference_control_init(void *memory, const struct reference_choice *choice);

void reference_model_set_state(void *memory, const struct reference_state *state);
void reference_model_state(const void *memory, struct reference_state *state);

/* The measured calls: task, input, output. The model's step has no output except its state. */
void reference_model_step(void *memory, const void *injection, void *unused);
void reference_pwm_period(void *memory, const void *input, void *output);
void reference_control_tick(void *memory, const void *input, void *output);

/* Both languages use these of one library. */
float reference_sinf(float x);
float reference_cosf(float x);
float reference_atanf(float x);
float reference_asinf(float x);

#endif

/* Delayed feedback: shared-model/src/controller/feedback.rs and shared-model/src/delayed_feedback. */
#ifndef FEEDBACK_H
#define FEEDBACK_H

#include "reference.h"
#include <math.h>

#define LINE_LEN 114
#define LINE_RATE_HZ 50
#define MOST_ADAPTED 0.1f
#define ADAPTS_BELOW 0.25f
#define ON_WITHIN_A 0.3f
#define OFF_BEYOND_A 0.5f

/* The last values of a signal. The channels do not compare it: a difference is one of the torque once it is read. */
struct line {
    float values[LINE_LEN];
    uint32_t newest;
    uint32_t count;
    uint32_t spacing_ticks;
    uint32_t age_ticks;
};

struct measurement {
    float wheel_speed_rpm;
    float yaw_rate_rad_per_s;
    float steering_angle_rad;
    float steering_rate_rad_per_s;
    float current_request_a;
};

struct feedback {
    const struct reference_orbits *orbits;
    float memory;
    float limit_nm;
    float adaptation;
    float adapted_ticks;
    float rate_hz;
    float hysteresis_rpm;
    uint32_t ticks_to_start;
    uint32_t is_on;
    float volts_per_nm;
    float most_v;
    float step_v;
    float voltage_v;
};

static inline float within(float value, float least, float most)
{
    return value > most ? most : value < least ? least : value;
}

static inline bool line_at(const struct line *line, uint32_t back, float *value)
{
    if (back >= line->count)
        return false;
    *value = line->values[back <= line->newest ? line->newest - back : line->newest + LINE_LEN - back];
    return true;
}

static inline void line_push(struct line *line, float value)
{
    line->age_ticks++;
    if (line->count > 0 && line->age_ticks < line->spacing_ticks)
        return;
    line->age_ticks = 0;
    line->newest = line->newest + 1 < LINE_LEN ? line->newest + 1 : 0;
    line->values[line->newest] = value;
    if (line->count < LINE_LEN)
        line->count++;
}

/* Value and rate of change that many ticks before the last push. */
static inline bool line_before(const struct line *line, float ticks, float *value, float *rate)
{
    const float spacing = (float)line->spacing_ticks;
    const float place = (ticks - (float)line->age_ticks) / spacing;

    if (!(place >= 0.0f && place < LINE_LEN))
        return false;
    const uint32_t whole = (uint32_t)place;
    const float x = place - (float)whole;
    float a, b, c, d;
    if (!line_at(line, whole, &b))
        return false;
    if (whole == 0 || !line_at(line, whole - 1, &a) || !line_at(line, whole + 1, &c) ||
        !line_at(line, whole + 2, &d)) {
        *value = b;
        *rate = 0.0f;
        return x == 0.0f;
    }
    const float third = 1.0f / 3.0f, sixth = 1.0f / 6.0f;
    const float first = c - third * a - 0.5f * b - sixth * d;
    const float second = 0.5f * (a + c) - b;
    const float cube = 0.5f * (b - c) + sixth * (d - a);
    *value = ((cube * x + second) * x + first) * x + b;
    *rate = -((3.0f * cube * x + (second + second)) * x + first) / spacing;
    return true;
}

static inline float feedback_torque_nm(struct feedback *feedback, struct line *line, float signal, float gain, float delay_ticks)
{
    float delayed, rate;
    const bool has_past = line_before(line, delay_ticks + feedback->adapted_ticks - 1.0f, &delayed, &rate);

    if (!has_past) {
        line_push(line, signal);
        return 0.0f;
    }
    line_push(line, (1.0f - feedback->memory) * signal + feedback->memory * delayed);
    const float difference = delayed - signal;
    const float torque_nm = gain * difference;
    const float adapted_ticks = feedback->adapted_ticks + feedback->adaptation * difference * rate;
    if (fabsf(adapted_ticks) < MOST_ADAPTED * delay_ticks && fabsf(torque_nm) < ADAPTS_BELOW * feedback->limit_nm)
        feedback->adapted_ticks = adapted_ticks;
    return within(torque_nm, -feedback->limit_nm, feedback->limit_nm);
}

static inline float between(const float *values, uint32_t whole, float share)
{
    return share == 0.0f ? values[whole] : values[whole] + share * (values[whole + 1] - values[whole]);
}

/* Gain and period at a wheel speed. */
static inline bool tuning_at(const struct reference_orbits *orbits, float speed_rpm, float *gain, float *period_s)
{
    const float place = (speed_rpm - orbits->first_rpm) / orbits->step_rpm;

    if (!(place >= 0.0f && place <= (float)(ORBIT_POINTS - 1)))
        return false;
    const uint32_t whole = (uint32_t)place;
    *gain = between(orbits->gains, whole, place - (float)whole);
    *period_s = between(orbits->periods_s, whole, place - (float)whole);
    return true;
}

static inline void switch_feedback(struct feedback *feedback, float speed_rpm, float request_a)
{
    const float first_rpm = feedback->orbits->first_rpm;
    const float last_rpm = first_rpm + feedback->orbits->step_rpm * (float)(ORBIT_POINTS - 1);
    const float margin_rpm = feedback->hysteresis_rpm;
    const float away_a = fabsf(request_a - feedback->orbits->motor_current_a);

    if (feedback->ticks_to_start > 0) {
        feedback->ticks_to_start--;
    } else if (speed_rpm < first_rpm || speed_rpm > last_rpm || away_a > OFF_BEYOND_A) {
        feedback->is_on = false;
    } else if (!feedback->is_on && speed_rpm >= first_rpm + margin_rpm && speed_rpm <= last_rpm - margin_rpm &&
               away_a <= ON_WITHIN_A) {
        feedback->is_on = true;
        feedback->adapted_ticks = 0.0f;
    }
}

/* A tick: the feedback's share of the voltage. */
static float __attribute__((noinline)) feedback_run(struct feedback *feedback, struct line *line,
                                                    const struct measurement *now, bool is_new, float motor_v)
{
    const float speed_rpm = now->wheel_speed_rpm, yaw_rate = now->yaw_rate_rad_per_s;
    float gain, period_s, wanted_v = 0.0f;

    switch_feedback(feedback, speed_rpm, now->current_request_a);
    if (feedback->is_on && tuning_at(feedback->orbits, speed_rpm, &gain, &period_s) && is_new) {
        wanted_v = feedback_torque_nm(feedback, line, yaw_rate, gain, period_s * feedback->rate_hz) *
                   feedback->volts_per_nm;
    } else {
        line_push(line, yaw_rate);
        if (feedback->is_on)
            wanted_v = feedback->voltage_v;
    }
    wanted_v = within(wanted_v, -feedback->most_v - motor_v, feedback->most_v - motor_v);
    feedback->voltage_v = within(wanted_v, feedback->voltage_v - feedback->step_v, feedback->voltage_v + feedback->step_v);
    return feedback->voltage_v;
}

static inline void feedback_init(struct feedback *feedback, struct line *line, const struct reference_orbits *orbits,
                                 float rate_hz, uint32_t ticks_to_start)
{
    *feedback = (struct feedback){
        .orbits = orbits,
        .limit_nm = 6.0f,
        .adaptation = 1e-3f * rate_hz,
        .rate_hz = rate_hz,
        .hysteresis_rpm = 20.0f,
        .ticks_to_start = ticks_to_start,
        .most_v = 14.0f * 0.3f,
        .volts_per_nm = 0.3f / (30.0f * 0.078f * 0.7f),
    };
    line->spacing_ticks = ((uint32_t)rate_hz + LINE_RATE_HZ - 1) / LINE_RATE_HZ;
    feedback->step_v = 100.0f * feedback->volts_per_nm / rate_hz;
}

#endif

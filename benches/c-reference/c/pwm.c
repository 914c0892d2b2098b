/* The task at the PWM rate: shared-model/src/ecu/pwm.rs with oscillator, limiter and duty. */

#include "channels.h"
#include "gate.h"
#include "reference.h"
#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846
#define PWM_RATE_HZ 10000.0f
#define PERIODS_PER_TICK 10
#define SINE_ERROR 1.2e-3f
/* Periods in a row in which the pin may show another duty. */
#define READBACK_TOLERANCE 1

struct oscillator {
    enum waveform waveform;
    uint32_t phase;
    uint32_t increment;
};

struct limiter {
    uint32_t least_samples;
    uint32_t most_samples;
    uint32_t samples;
    uint32_t mismatches;
    uint32_t faults;
    float sample_error;
    uint16_t expected_code;
    /* There is dither; the rest of a half period is valid only then. */
    bool has_half_period;
    bool is_positive;
    bool is_whole;
};

struct servo {
    float counts_per_volt;
    float midpoint;
    uint16_t period;
};

struct channel {
    struct oscillator oscillator;
    struct limiter limiter;
    struct servo servo;
    struct reference_setpoint setpoint;
    uint32_t periods_per_tick;
    uint32_t periods_to_tick;
    uint32_t bridge_on;
};

struct task {
    struct channel channels[2];
    uint16_t neutral_code;
    uint32_t faults;
};

struct period {
    uint16_t duty_code;
    bool control_due;
    bool bridge_on;
};

/* Sine as the crate micromath approximates it. */
static inline float oscillator_sin(float angle_rad)
{
    float x = angle_rad - (float)PI / 2.0f;

    x *= (float)(1.0 / PI) / 2.0f;
    const float shifted = x + 0.25f;
    float floored = (float)(int32_t)shifted;
    if (shifted < floored)
        floored -= 1.0f;
    x -= 0.25f + floored;
    x *= 16.0f * (fabsf(x) - 0.5f);
    x += 0.225f * x * (fabsf(x) - 1.0f);
    return x;
}

static inline float angle_rad(uint32_t phase)
{
    const int32_t turned = (int32_t)phase;
    const uint32_t magnitude = turned < 0 ? 0u - phase : phase;
    const float angle = (float)magnitude * (float)(PI / 2147483648.0);

    return turned < 0 ? -angle : angle;
}

static inline float oscillator_sample(struct oscillator *oscillator)
{
    const uint32_t phase = oscillator->phase;

    oscillator->phase = phase + oscillator->increment;
    switch (oscillator->waveform) {
    case WAVEFORM_SQUARE:
        return phase < 0x80000000u ? 1.0f : -1.0f;
    case WAVEFORM_SINE:
        return oscillator_sin(angle_rad(phase));
    default:
        return 0.0f;
    }
}

static inline void watch_half_period(struct limiter *limiter, float dither_v, float amplitude_v)
{
    /* Closer to zero the sign of a sample may be that of its error. */
    const float sure_v = amplitude_v * limiter->sample_error;

    if (!limiter->has_half_period) {
        limiter->has_half_period = true;
        limiter->is_positive = dither_v > 0.0f;
        limiter->samples = 0;
        limiter->is_whole = false;
    }
    if (limiter->is_positive ? dither_v < -sure_v : dither_v > sure_v) {
        limiter->faults |=
            fault_if(limiter->is_whole && limiter->samples < limiter->least_samples, FAULT_DITHER_FREQUENCY);
        limiter->is_positive = !limiter->is_positive;
        limiter->samples = 1;
        limiter->is_whole = true;
    } else {
        if (limiter->samples != UINT32_MAX)
            limiter->samples++;
        limiter->faults |= fault_if(limiter->samples > limiter->most_samples, FAULT_DITHER_FREQUENCY);
    }
}

/* Servo voltage: the motor's share and the dither's sample, the latter only if it is within its amplitude. */
static inline float limiter_run(struct limiter *limiter, const struct reference_setpoint *setpoint, float dither_v)
{
    const float amplitude_v = setpoint->dither_amplitude_v;
    const bool is_within = fabsf(dither_v) <= amplitude_v * (1.0f + limiter->sample_error);

    limiter->faults |= fault_if(!is_within, FAULT_DITHER_AMPLITUDE);
    if (amplitude_v == 0.0f)
        limiter->has_half_period = false;
    else
        watch_half_period(limiter, dither_v, amplitude_v);
    return setpoint->motor_v + (is_within ? dither_v : 0.0f);
}

static inline void limiter_observe(struct limiter *limiter, uint16_t captured_code)
{
    if (captured_code == limiter->expected_code)
        limiter->mismatches = 0;
    else if (limiter->mismatches != UINT32_MAX)
        limiter->mismatches++;
    limiter->faults |= fault_if(limiter->mismatches > READBACK_TOLERANCE, FAULT_READBACK);
}

static inline uint16_t duty_code(const struct servo *servo, float volts)
{
    const float counts = servo->midpoint + volts * servo->counts_per_volt;

    if (counts >= (float)servo->period)
        return servo->period;
    if (counts >= 0.0f) {
        const uint32_t rounded = (uint32_t)(counts + 0.5f);
        return rounded < servo->period ? (uint16_t)rounded : servo->period;
    }
    if (counts < 0.0f)
        return 0;
    return servo->period / 2;
}

static inline struct period channel_begin(struct channel *channel)
{
    const float sample = oscillator_sample(&channel->oscillator);
    const float dither_v = channel->setpoint.dither_amplitude_v * sample;
    const float volts = limiter_run(&channel->limiter, &channel->setpoint, dither_v);
    struct period period = { .duty_code = duty_code(&channel->servo, volts) };

    if (channel->periods_to_tick > 0)
        channel->periods_to_tick--;
    if (channel->periods_to_tick == 0) {
        period.control_due = true;
        channel->periods_to_tick = channel->periods_per_tick;
    }
    if (channel->limiter.faults & 1u << FAULT_READBACK)
        channel->bridge_on = false;
    period.bridge_on = channel->bridge_on;
    return period;
}

static inline uint16_t least(uint16_t a, uint16_t b)
{
    return a < b ? a : b;
}

static inline uint16_t greatest(uint16_t a, uint16_t b)
{
    return a < b ? b : a;
}

/* Where the channels differ, memory was changed. */
static inline void channels_differ(struct task *task)
{
    task->faults |= 1u << FAULT_CHANNELS_DIFFER;
    task->channels[0].bridge_on = false;
    task->channels[1].bridge_on = false;
}

static inline struct period task_begin(struct task *task)
{
    struct channel *a = &task->channels[0], *b = &task->channels[1];
    const struct period period_a = channel_begin(a);
    const struct period period_b = channel_begin(b);
    const bool differ = period_a.duty_code != period_b.duty_code || period_a.control_due != period_b.control_due ||
                        period_a.bridge_on != period_b.bridge_on;
    const uint16_t lower = least(period_a.duty_code, period_b.duty_code);
    const uint16_t upper = greatest(period_a.duty_code, period_b.duty_code);
    /* Of the two the duty nearer to neutral, and neutral itself if they lie on both sides of it. */
    const uint16_t code = least(greatest(task->neutral_code, lower), upper);

    if (differ)
        channels_differ(task);
    a->limiter.expected_code = code;
    b->limiter.expected_code = code;
    return (struct period){ code, period_a.control_due || period_b.control_due, !differ && period_a.bridge_on };
}

static inline uint32_t task_faults(struct task *task)
{
    const struct channel *a = &task->channels[0], *b = &task->channels[1];

    if (!channels_agree(a, b, sizeof *a))
        channels_differ(task);
    task->faults |= a->limiter.faults | b->limiter.faults;
    return task->faults;
}

void reference_pwm_period(void *memory, const void *given, void *result)
{
    struct task *task = memory;
    const struct reference_pwm_input *input = given;
    struct reference_pwm_output *output = result;
    const struct period period = task_begin(task);

    if (period.control_due && input->has_setpoints) {
        for (int i = 0; i < 2; i++) {
            task->channels[i].setpoint = input->setpoints[i];
            task->channels[i].bridge_on &= input->bridge_on[i];
        }
    }
    for (int i = 0; i < 2; i++)
        limiter_observe(&task->channels[i].limiter, period.duty_code ^ input->pin_error);
    output->duty_code = period.duty_code;
    output->control_due = period.control_due;
    output->bridge_on = period.bridge_on;
    output->faults = period.control_due ? task_faults(task) : 0;
}

size_t reference_pwm_size(void)
{
    return sizeof(struct task);
}

void reference_pwm_init(void *memory, const struct reference_choice *choice)
{
    struct task *task = memory;
    const float samples_times_rate = (float)PI * PWM_RATE_HZ;
    const double frequency = choice->waveform == WAVEFORM_SQUARE ? 2000.0 :
                             choice->waveform == WAVEFORM_SINE   ? 4000.0 :
                                                                   0.0;
    const uint16_t timer_period = 2500;

    memset(task, 0, sizeof *task);
    task->neutral_code = timer_period / 2;
    for (int i = 0; i < 2; i++) {
        struct channel *channel = &task->channels[i];
        channel->oscillator.waveform = choice->waveform;
        channel->oscillator.increment = (uint32_t)(frequency / PWM_RATE_HZ / (2.0 * PI) * 4294967296.0 + 0.5);
        channel->limiter.sample_error = SINE_ERROR;
        channel->limiter.least_samples = (uint32_t)(samples_times_rate / 5000.0f * (1.0f - SINE_ERROR));
        channel->limiter.most_samples = (uint32_t)(samples_times_rate / 1500.0f * (1.0f + SINE_ERROR)) + 1;
        channel->limiter.expected_code = task->neutral_code;
        channel->servo.period = timer_period;
        channel->servo.midpoint = 0.5f * (float)timer_period;
        channel->servo.counts_per_volt = channel->servo.midpoint / 12.0f;
        channel->periods_per_tick = PERIODS_PER_TICK;
        channel->periods_to_tick = PERIODS_PER_TICK;
        channel->bridge_on = true;
    }
}

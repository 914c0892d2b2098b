/* The vehicle model's step: shared-model/src/integrate.rs, vehicle/model.rs, tire.rs and friction.rs. */

#include "reference.h"

#define NODES 32

enum { SIDESLIP, YAW_RATE, STEERING_ANGLE, STEERING_RATE };

struct vector {
    float x[4];
};

struct magic_formula {
    float stiffness_per_rad;
    float shape;
    float peak_n;
    float curvature;
};

struct cubic_tire {
    float linear_n_per_rad;
    float cubic_n_per_rad3;
};

struct tire {
    enum tire_kind kind;
    struct cubic_tire cubic;
    struct magic_formula magic;
    float nodes[NODES];
};

struct model {
    enum slip_form slip_form;
    struct tire front;
    struct tire rear;
    float front_lever_s;
    float rear_lever_s;
    float lateral_gain;
    float front_yaw_gain;
    float rear_yaw_gain;
    float motor_torque_nm;
    float trail_m;
    float damping_nm_s_per_rad;
    float inverse_steering_inertia;
    enum friction_law friction_law;
    bool friction_dithered;
    float friction_limit_nm;
    float dither_frequency_rad_per_s;
};

struct task {
    struct model model;
    float step_s;
    struct vector x;
    enum friction_mode friction;
};

struct injection {
    enum injection_kind kind;
    float rad;
};

enum sign_kind { SIGN_ZERO, SIGN_STEPPED, SIGN_SMOOTH };

/* The friction's sign function: steps at lower and upper, or a mean over a sine of amplitude upper. */
struct sign {
    enum sign_kind kind;
    float lower;
    float upper;
};

/* A change of friction mode within a step. */
struct change {
    float fraction;
    bool has_threshold;
    float threshold;
    enum friction_mode mode_after;
};

static inline float cubic_force(const struct cubic_tire *tire, float alpha)
{
    return alpha * (tire->linear_n_per_rad - tire->cubic_n_per_rad3 * alpha * alpha);
}

static inline float softened_force(const struct cubic_tire *tire, float mean_square_rad2, float alpha)
{
    const struct cubic_tire softened = {
        .linear_n_per_rad = tire->linear_n_per_rad - 3.0f * tire->cubic_n_per_rad3 * mean_square_rad2,
        .cubic_n_per_rad3 = tire->cubic_n_per_rad3,
    };
    return cubic_force(&softened, alpha);
}

static float magic_force(const struct magic_formula *tire, float alpha)
{
    const float b_alpha = tire->stiffness_per_rad * alpha;
    const float argument = b_alpha * (1.0f - tire->curvature) + tire->curvature * reference_atanf(b_alpha);
    return tire->peak_n * reference_sinf(tire->shape * reference_atanf(argument));
}

static float dithered_magic_force(const struct tire *tire, float alpha, struct injection injection)
{
    const struct magic_formula *magic = &tire->magic;
    float sum = 0.0f;

    switch (injection.kind) {
    case INJECTION_SHIFT:
        return magic_force(magic, alpha + injection.rad);
    case INJECTION_SQUARE_MEAN:
        return 0.5f * (magic_force(magic, alpha + injection.rad) + magic_force(magic, alpha - injection.rad));
    case INJECTION_SINE_MEAN:
        for (int k = 0; k < NODES; k++)
            sum += magic_force(magic, alpha + injection.rad * tire->nodes[k]);
        return sum * (1.0f / NODES);
    default:
        return magic_force(magic, alpha);
    }
}

static inline float tire_force(const struct tire *tire, float alpha, struct injection injection)
{
    if (tire->kind == TIRE_MAGIC_FORMULA)
        return dithered_magic_force(tire, alpha, injection);
    switch (injection.kind) {
    case INJECTION_SHIFT:
        return cubic_force(&tire->cubic, alpha + injection.rad);
    case INJECTION_SQUARE_MEAN:
        return softened_force(&tire->cubic, injection.rad * injection.rad, alpha);
    case INJECTION_SINE_MEAN:
        return softened_force(&tire->cubic, 0.5f * injection.rad * injection.rad, alpha);
    default:
        return cubic_force(&tire->cubic, alpha);
    }
}

static inline void cornering_forces(const struct model *model, const struct vector *state, struct injection injection,
                                    float *front, float *rear)
{
    const float beta = state->x[SIDESLIP];
    const float gamma = state->x[YAW_RATE];
    const float delta = state->x[STEERING_ANGLE];
    float front_slip, rear_slip;

    if (model->slip_form == SLIP_SMALL_ANGLE) {
        front_slip = model->front_lever_s * gamma;
        rear_slip = model->rear_lever_s * gamma;
    } else {
        const float along = gamma * reference_cosf(beta);
        front_slip = reference_atanf(model->front_lever_s * along);
        rear_slip = reference_atanf(model->rear_lever_s * along);
    }
    *front = tire_force(&model->front, beta + front_slip - delta, injection);
    *rear = tire_force(&model->rear, beta - rear_slip, injection);
}

static inline float driving_torque_nm(const struct model *model, const struct vector *state, struct injection injection)
{
    float front, rear;

    cornering_forces(model, state, injection, &front, &rear);
    return model->motor_torque_nm - model->trail_m * front;
}

static inline int friction_argument(const struct model *model)
{
    return model->friction_law == FRICTION_PRINTED_ANGLE ? STEERING_ANGLE : STEERING_RATE;
}

static inline struct sign friction_sign(const struct model *model, struct injection injection)
{
    if (model->friction_law == FRICTION_NONE)
        return (struct sign){ .kind = SIGN_ZERO };
    if (!model->friction_dithered)
        return (struct sign){ .kind = SIGN_STEPPED };
    if (model->friction_law == FRICTION_COULOMB_RATE)
        injection.rad = model->dither_frequency_rad_per_s * injection.rad;
    switch (injection.kind) {
    case INJECTION_SQUARE_MEAN:
        return (struct sign){ SIGN_STEPPED, -injection.rad, injection.rad };
    case INJECTION_SHIFT:
        return (struct sign){ SIGN_STEPPED, -injection.rad, -injection.rad };
    case INJECTION_SINE_MEAN:
        if (injection.rad > 0.0f)
            return (struct sign){ .kind = SIGN_SMOOTH, .upper = injection.rad };
        /* fall through */
    default:
        return (struct sign){ .kind = SIGN_STEPPED };
    }
}

static inline enum friction_mode sign_mode(const struct sign *sign, float argument)
{
    if (sign->kind == SIGN_STEPPED) {
        if (argument > sign->upper)
            return FRICTION_POSITIVE;
        if (argument < sign->lower)
            return FRICTION_NEGATIVE;
    }
    return FRICTION_NEUTRAL;
}

static float smooth_sign(float amplitude, float argument)
{
    const float ratio = argument / amplitude;

    if (ratio >= 1.0f)
        return 1.0f;
    if (ratio <= -1.0f)
        return -1.0f;
    return reference_asinf(ratio) * 0.63661977236758134308f;
}

static inline bool can_stick(const struct model *model, struct injection injection)
{
    const struct sign sign = friction_sign(model, injection);

    return model->friction_law == FRICTION_COULOMB_RATE && sign.kind == SIGN_STEPPED && sign.lower == 0.0f &&
           sign.upper == 0.0f;
}

static inline enum friction_mode mode_at_rest(const struct model *model, const struct vector *state,
                                              struct injection injection)
{
    const float torque = driving_torque_nm(model, state, injection);

    if (torque > model->friction_limit_nm)
        return FRICTION_POSITIVE;
    if (torque < -model->friction_limit_nm)
        return FRICTION_NEGATIVE;
    return FRICTION_STICKING;
}

static inline enum friction_mode mode_at(const struct model *model, const struct vector *state,
                                         struct injection injection)
{
    const float argument = state->x[friction_argument(model)];

    if (argument == 0.0f && can_stick(model, injection))
        return mode_at_rest(model, state, injection);
    const struct sign sign = friction_sign(model, injection);
    return sign_mode(&sign, argument);
}

static inline float friction_torque_nm(const struct model *model, const struct vector *state,
                                       struct injection injection, enum friction_mode mode)
{
    switch (mode) {
    case FRICTION_POSITIVE:
        return model->friction_limit_nm;
    case FRICTION_NEGATIVE:
        return -model->friction_limit_nm;
    case FRICTION_NEUTRAL: {
        const struct sign sign = friction_sign(model, injection);
        if (sign.kind == SIGN_SMOOTH)
            return model->friction_limit_nm * smooth_sign(sign.upper, state->x[friction_argument(model)]);
        return 0.0f;
    }
    default:
        return 0.0f;
    }
}

static inline struct vector derivative(const struct model *model, const struct vector *state,
                                       struct injection injection, enum friction_mode mode)
{
    const float gamma = state->x[YAW_RATE];
    const float rate = state->x[STEERING_RATE];
    float front, rear;
    float acceleration = 0.0f;

    cornering_forces(model, state, injection, &front, &rear);
    float yaw = model->front_yaw_gain * front - model->rear_yaw_gain * rear;
    if (mode != FRICTION_STICKING) {
        const float torque = model->motor_torque_nm - model->trail_m * front - model->damping_nm_s_per_rad * rate -
                             friction_torque_nm(model, state, injection, mode);
        acceleration = torque * model->inverse_steering_inertia;
    }
    if (model->slip_form == SLIP_EXACT)
        yaw *= reference_cosf(state->x[SIDESLIP]);
    return (struct vector){ { (front + rear) * model->lateral_gain - gamma, yaw, rate, acceleration } };
}

static inline struct vector moved(const struct vector *from, const struct vector *slope, float step_s)
{
    struct vector to;

    for (int i = 0; i < 4; i++)
        to.x[i] = from->x[i] + slope->x[i] * step_s;
    return to;
}

static inline struct vector runge_kutta_4(const struct model *model, const struct vector *from, float step_s,
                                          struct injection injection, enum friction_mode mode)
{
    const float half = 0.5f * step_s;
    const float sixth = (1.0f / 6.0f) * step_s;
    const struct vector k1 = derivative(model, from, injection, mode);
    const struct vector x2 = moved(from, &k1, half);
    const struct vector k2 = derivative(model, &x2, injection, mode);
    const struct vector x3 = moved(from, &k2, half);
    const struct vector k3 = derivative(model, &x3, injection, mode);
    const struct vector x4 = moved(from, &k3, step_s);
    const struct vector k4 = derivative(model, &x4, injection, mode);
    struct vector next;

    for (int i = 0; i < 4; i++)
        next.x[i] = from->x[i] + (k1.x[i] + k2.x[i] * 2.0f + k3.x[i] * 2.0f + k4.x[i]) * sixth;
    if (mode == FRICTION_STICKING)
        next.x[STEERING_RATE] = 0.0f;
    return next;
}

/* The torque on a sticking steering reaches its limit between start and end. */
static inline bool release(const struct model *model, const struct vector *start, const struct vector *end,
                           struct injection injection, struct change *change)
{
    const enum friction_mode mode_after = mode_at_rest(model, end, injection);
    float limit;

    if (mode_after == FRICTION_POSITIVE)
        limit = model->friction_limit_nm;
    else if (mode_after == FRICTION_NEGATIVE)
        limit = -model->friction_limit_nm;
    else
        return false;
    const float before = driving_torque_nm(model, start, injection);
    const float after = driving_torque_nm(model, end, injection);
    change->fraction = (limit - before) / (after - before);
    change->has_threshold = false;
    change->mode_after = mode_after;
    return true;
}

/* The friction law's argument passes one of the law's steps between start and end. */
static inline bool crossing(const struct model *model, const struct vector *start, const struct vector *end,
                            struct injection injection, enum friction_mode mode, struct change *change)
{
    const struct sign sign = friction_sign(model, injection);
    const float before = start->x[friction_argument(model)];
    const float after = end->x[friction_argument(model)];
    const bool apart = sign.lower < sign.upper;

    if (sign.kind != SIGN_STEPPED)
        return false;
    if (mode == FRICTION_POSITIVE && after < sign.upper) {
        change->threshold = sign.upper;
        change->mode_after = apart ? FRICTION_NEUTRAL : FRICTION_NEGATIVE;
    } else if (mode == FRICTION_NEGATIVE && after > sign.lower) {
        change->threshold = sign.lower;
        change->mode_after = apart ? FRICTION_NEUTRAL : FRICTION_POSITIVE;
    } else if (mode == FRICTION_NEUTRAL && apart && after > sign.upper) {
        change->threshold = sign.upper;
        change->mode_after = FRICTION_POSITIVE;
    } else if (mode == FRICTION_NEUTRAL && apart && after < sign.lower) {
        change->threshold = sign.lower;
        change->mode_after = FRICTION_NEGATIVE;
    } else {
        return false;
    }
    change->fraction = (change->threshold - before) / (after - before);
    change->has_threshold = true;
    return true;
}

static void step(const struct model *model, struct vector *state, enum friction_mode *friction, float step_s,
                 struct injection injection)
{
    const enum friction_mode mode = mode_at(model, state, injection);
    const struct vector trial = runge_kutta_4(model, state, step_s, injection, mode);
    struct change change;
    bool has_change;

    if (mode == FRICTION_STICKING)
        has_change = release(model, state, &trial, injection, &change);
    else
        has_change = crossing(model, state, &trial, injection, mode, &change);
    if (!has_change) {
        *state = trial;
        *friction = mode;
        return;
    }

    struct vector at = runge_kutta_4(model, state, step_s * change.fraction, injection, mode);
    enum friction_mode mode_after = change.mode_after;
    if (change.has_threshold) {
        at.x[friction_argument(model)] = change.threshold;
        if (can_stick(model, injection))
            mode_after = mode_at_rest(model, &at, injection);
    }
    *state = runge_kutta_4(model, &at, step_s * (1.0f - change.fraction), injection, mode_after);
    *friction = mode_after;
}

/* Set-up. */

static struct cubic_tire cubic(const struct magic_formula *tire)
{
    const float b = tire->stiffness_per_rad, c = tire->shape, d = tire->peak_n;
    const float b_cubed = b * b * b;

    return (struct cubic_tire){
        .linear_n_per_rad = b * c * d,
        .cubic_n_per_rad3 = d * c * b_cubed * (1.0f / 3.0f) * (tire->curvature + 1.0f) +
                            d * c * c * c * b_cubed * (1.0f / 6.0f),
    };
}

static void tire_init(struct tire *tire, enum tire_kind kind, struct magic_formula magic)
{
    tire->kind = kind;
    tire->magic = magic;
    tire->cubic = cubic(&magic);
    for (int k = 0; k < NODES; k++)
        tire->nodes[k] = reference_cosf((float)((2 * k + 1) * 3.14159265358979323846 / (2 * NODES)));
}

void reference_model_init(void *memory, const struct reference_choice *choice)
{
    struct task *task = memory;
    struct model *model = &task->model;
    const float speed = (float)(6.28318530717958647693 / 60.0) * 0.3f * choice->wheel_speed_rpm;

    *task = (struct task){ .step_s = 1.0f / 1000.0f };
    model->slip_form = choice->slip_form;
    tire_init(&model->front, choice->tire, (struct magic_formula){ 11.275f, 1.56f, 2574.7f, -1.999f });
    tire_init(&model->rear, choice->tire, (struct magic_formula){ 18.631f, 1.56f, 1749.7f, -1.7908f });
    model->front_lever_s = 1.2f / speed;
    model->rear_lever_s = 1.3f / speed;
    model->lateral_gain = 1.0f / (1500.0f * speed);
    model->front_yaw_gain = 1.2f / 2000.0f;
    model->rear_yaw_gain = 1.3f / 2000.0f;
    model->motor_torque_nm = 30.0f * 0.078f * 10.0f * 0.7f;
    model->trail_m = 0.012f + 0.010f;
    model->damping_nm_s_per_rad = 200.0f;
    model->inverse_steering_inertia = 1.0f / 10.0f;
    model->friction_law = choice->friction_law;
    model->friction_dithered = choice->friction_dithered;
    model->friction_limit_nm = choice->friction_law == FRICTION_NONE ? 0.0f : 9.8f * 0.012f * 0.28f * 200.0f;
    model->dither_frequency_rad_per_s = choice->waveform == WAVEFORM_SQUARE ? 2000.0f :
                                        choice->waveform == WAVEFORM_SINE   ? 4000.0f :
                                                                              0.0f;
}

size_t reference_model_size(void)
{
    return sizeof(struct task);
}

void reference_model_set_state(void *memory, const struct reference_state *state)
{
    struct task *task = memory;

    for (int i = 0; i < 4; i++)
        task->x.x[i] = state->x[i];
    task->friction = state->friction;
}

void reference_model_state(const void *memory, struct reference_state *state)
{
    const struct task *task = memory;

    for (int i = 0; i < 4; i++)
        state->x[i] = task->x.x[i];
    state->friction = task->friction;
}

void reference_model_step(void *memory, const void *injection, void *unused)
{
    struct task *task = memory;
    const struct reference_injection *given = injection;

    (void)unused;
    step(&task->model, &task->x, &task->friction, task->step_s,
         (struct injection){ .kind = given->kind, .rad = given->rad });
}

"""Makes reference.json: every lane's state at 10 s to 20 digits, by two programs that share nothing but the coefficients.

The one stored is a Taylor series of order 30 in 40 digits, written out below for this model, with friction's events as roots
of the series. The other is heyoka in 80-bit arithmetic at a tolerance of 1e-18. They have to agree, and so have two
tolerances of the first.
"""

import json
import math

import gmpy2
from gmpy2 import mpfr

from model import ERROR_TIME_S, HERE, START, TANGENT_NORM, TANGENT_START, exported

gmpy2.get_context().precision = 133  # 40 digits
ORDER = 30
AGREEMENT = 1e-14
"""Largest difference allowed. 80 bits round by 1e-19 and chaos amplifies that by up to 1e5 in 10 s: measured from 4e-16 to
5e-15 at tolerances from 1e-15 to 1e-19, without order. The errors to be measured are a million times that."""


def convolve(a, b, k):
    """Coefficient k of the product of two series."""
    return sum((a[i] * b[k - i] for i in range(k + 1)), mpfr(0))


def series(c, x, tangent, friction_nm, free):
    """Taylor coefficients of the state, the tangent vector (None without) and the driving torque."""
    state = [[value] for value in x]
    shift = [[value] for value in tangent] if tangent else None
    front, front_sq, front_n, rear, rear_sq, rear_n = ([] for _ in range(6))
    d_front, d_rear, torque_nm = [], [], []
    for k in range(ORDER):
        beta, gamma, delta, omega = (s[k] for s in state)
        front.append(beta + c.front_lever_s * gamma - delta)
        rear.append(beta - c.rear_lever_s * gamma)
        front_sq.append(convolve(front, front, k))
        rear_sq.append(convolve(rear, rear, k))
        front_n.append(c.front_linear_n_per_rad * front[k] - c.front_cubic_n_per_rad3 * convolve(front_sq, front, k))
        rear_n.append(c.rear_linear_n_per_rad * rear[k] - c.rear_cubic_n_per_rad3 * convolve(rear_sq, rear, k))
        torque_nm.append((c.motor_torque_nm if k == 0 else 0) - c.trail_m * front_n[k])
        acceleration = torque_nm[k] - c.damping_nm_s_per_rad * omega - (friction_nm if k == 0 else 0)
        rates = (
            (front_n[k] + rear_n[k]) * c.lateral_gain - gamma,
            c.front_yaw_gain * front_n[k] - c.rear_yaw_gain * rear_n[k],
            omega,
            free * acceleration * c.inverse_inertia_per_kg_m2,
        )
        for s, rate in zip(state, rates):
            s.append(rate / (k + 1))
        if not shift:
            continue
        beta, gamma, delta, omega = (s[k] for s in shift)
        d_front.append(beta + c.front_lever_s * gamma - delta)
        d_rear.append(beta - c.rear_lever_s * gamma)
        front_d = c.front_linear_n_per_rad * d_front[k] - 3 * c.front_cubic_n_per_rad3 * convolve(front_sq, d_front, k)
        rear_d = c.rear_linear_n_per_rad * d_rear[k] - 3 * c.rear_cubic_n_per_rad3 * convolve(rear_sq, d_rear, k)
        rates = (
            (front_d + rear_d) * c.lateral_gain - gamma,
            c.front_yaw_gain * front_d - c.rear_yaw_gain * rear_d,
            omega,
            (-c.trail_m * front_d - c.damping_nm_s_per_rad * omega) * c.inverse_inertia_per_kg_m2,
        )
        for s, rate in zip(shift, rates):
            s.append(rate / (k + 1))
    return state, shift, torque_nm


def value(coefficients, t_s):
    """The series' value."""
    total = mpfr(0)
    for coefficient in reversed(coefficients):
        total = total * t_s + coefficient
    return total


def step_s(all_series, tolerance):
    """Step in which the last coefficients add less than the tolerance."""
    last = max(abs(s[-1]) for s in all_series)
    last_but_one = max(abs(s[-2]) for s in all_series)
    return min((tolerance / last) ** (mpfr(1) / ORDER), (tolerance / last_but_one) ** (mpfr(1) / (ORDER - 1)))


def first_root_s(coefficients, until_s):
    """First root of a series in (0, until_s], or None: a change of sign between 200 points, then bisection."""
    fast = [float(coefficient) for coefficient in reversed(coefficients)]

    def sign(t_s):
        total = 0.0
        for coefficient in fast:
            total = total * t_s + coefficient
        return total > 0

    points_s = [float(until_s) * i / 200 for i in range(201)]
    signs = [sign(t_s) for t_s in points_s]
    for i in range(200):
        if signs[i] != signs[i + 1]:
            low_s, high_s = mpfr(points_s[i]), mpfr(points_s[i + 1])
            at_low = value(coefficients, low_s) > 0
            for _ in range(140):
                middle_s = (low_s + high_s) / 2
                if (value(coefficients, middle_s) > 0) == at_low:
                    low_s = middle_s
                else:
                    high_s = middle_s
            return high_s
    return None


def smooth(c, with_tangent, tolerance):
    """State at 10 s without friction, and the exponent over that time (1/s)."""
    t_s, x = mpfr(0), [mpfr(v) for v in START]
    tangent = [mpfr(v) for v in TANGENT_START] if with_tangent else None
    while t_s < ERROR_TIME_S:
        state, shift, _ = series(c, x, tangent, 0, 1)
        h_s = min(step_s(state + (shift or []), tolerance), ERROR_TIME_S - t_s)
        x = [value(s, h_s) for s in state]
        tangent = [value(s, h_s) for s in shift] if shift else None
        t_s += h_s
    growth = gmpy2.sqrt(sum(v * v for v in tangent)) if tangent else mpfr(TANGENT_NORM)
    return x, gmpy2.log(growth / TANGENT_NORM) / ERROR_TIME_S


def with_friction(c, tolerance):
    """State at 10 s with Coulomb friction, and the number of changes of mode."""
    limit = mpfr(c.friction_limit_nm)
    t_s, x, changes = mpfr(0), [mpfr(v) for v in START], 0

    def sign_at_rest():
        torque = series(c, x, None, 0, 0)[2][0]
        return 1 if torque > limit else -1 if torque < -limit else 0

    sign = sign_at_rest()
    # Order of the steering rate's root at the start of the step, to be divided out: 1 at a reversal, 2 at a release.
    roots = 1
    while t_s < ERROR_TIME_S:
        state, _, torque = series(c, x, None, sign * limit, abs(sign))
        h_s = min(step_s(state, tolerance), ERROR_TIME_S - t_s)
        if sign:
            event_s = first_root_s(state[3][roots:], h_s)
        else:
            sides = [first_root_s([torque[0] + side, *torque[1:]], h_s) for side in (limit, -limit)]
            event_s = min((s for s in sides if s), default=None)
        roots = 0
        if event_s:
            h_s = event_s
        x = [value(s, h_s) for s in state]
        t_s += h_s
        if not event_s:
            continue
        changes += 1
        x[3] = mpfr(0)
        if sign:
            sign = sign_at_rest()
            roots = 1
        else:
            # Released: towards the side on which the torque leaves its limits.
            sign = 1 if value(torque, h_s) > 0 else -1
            roots = 2
    return x, changes


def largest_difference(a, b):
    """Largest difference of two sets of states."""
    return float(max(abs(mpfr(str(p)) - mpfr(str(q))) for x, y in zip(a, b) for p, q in zip(x, y)))


def main():
    """Makes the reference, compares it, stores it."""
    from peer_heyoka import Heyoka

    lanes, _ = exported()
    jobs = {}
    for job in "SLF":
        def solve(tolerance, job=job):
            if job == "F":
                return list(zip(*(with_friction(c, tolerance) for c in lanes)))
            return list(zip(*(smooth(c, job == "L", tolerance) for c in lanes)))

        states, more = solve(mpfr("1e-30"))
        coarse, _ = solve(mpfr("1e-24"))
        other = Heyoka(1, "long double").prepare(job, 1e-18)(ERROR_TIME_S)
        differences = {
            "two tolerances": largest_difference(states, coarse),
            "heyoka in 80 bits": largest_difference(states, other["states"]),
        }
        jobs[job] = {"states": [[f"{v:.25e}" for v in x] for x in states]}
        if job == "L":
            jobs[job]["exponents_per_s"] = [f"{v:.20e}" for v in more]
            differences["heyoka's exponent, 1/s"] = max(abs(a - b) for a, b in zip(more, other["exponents_per_s"]))
        if job == "F":
            jobs[job]["mode_changes"] = list(more)
            assert list(more) == list(other["mode_changes"]), (more, other["mode_changes"])
        print(job, {name: f"{float(d):.1e}" for name, d in differences.items()}, flush=True)
        assert all(d < AGREEMENT for d in differences.values()), differences
    text = {"time_s": ERROR_TIME_S, "jobs": jobs}
    (HERE / "reference.json").write_text(json.dumps(text, indent=1) + "\n")


if __name__ == "__main__":
    main()

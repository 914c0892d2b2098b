"""The project's model as Python reads it: its coefficients, its right-hand side and the jobs.

One text of the right-hand side serves numbers (numba) and symbols (heyoka, jitcode). The coefficients are the shared
model's, exported by the Rust program in `rust/`; `check` compares the text with the shared model.
"""

import json
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
BUILD = HERE.parents[1] / "target" / "peers"

DURATION_S = 400.0
"""Length of every job."""
ERROR_TIME_S = 10.0
"""When the error is measured: later, chaos has amplified any error to the size of the attractor."""
ERROR_LIMIT = 7e-8
"""Largest error allowed there: the worst lane's largest component, in rad and rad/s."""
EXPORT = json.loads((BUILD / "model.json").read_text())
"""What the Rust program exported."""
START = tuple(EXPORT["start"])
TANGENT_START = tuple(EXPORT["tangent_start"])
TANGENT_NORM = EXPORT["tangent_norm"]
RENORMALISATION_S = EXPORT["renormalisation_s"]


class Coefficients(NamedTuple):
    """Constants of the right-hand side at one speed."""

    wheel_speed_rpm: float
    front_lever_s: float
    rear_lever_s: float
    lateral_gain: float
    front_yaw_gain: float
    rear_yaw_gain: float
    front_linear_n_per_rad: float
    front_cubic_n_per_rad3: float
    rear_linear_n_per_rad: float
    rear_cubic_n_per_rad3: float
    motor_torque_nm: float
    trail_m: float
    damping_nm_s_per_rad: float
    inverse_inertia_per_kg_m2: float
    friction_limit_nm: float


SPEED_DEPENDENT = ("front_lever_s", "rear_lever_s", "lateral_gain")
"""The coefficients that differ between lanes."""


def rates(x, c, friction_nm, free):
    """Time derivative of the state; `free` is 1 as long as the steering moves and 0 in stick."""
    beta, gamma, delta, omega = x
    front_rad = beta + c.front_lever_s * gamma - delta
    rear_rad = beta - c.rear_lever_s * gamma
    front_n = front_rad * (c.front_linear_n_per_rad - c.front_cubic_n_per_rad3 * (front_rad * front_rad))
    rear_n = rear_rad * (c.rear_linear_n_per_rad - c.rear_cubic_n_per_rad3 * (rear_rad * rear_rad))
    torque_nm = c.motor_torque_nm - c.trail_m * front_n - c.damping_nm_s_per_rad * omega - friction_nm
    return (
        (front_n + rear_n) * c.lateral_gain - gamma,
        c.front_yaw_gain * front_n - c.rear_yaw_gain * rear_n,
        omega,
        free * (torque_nm * c.inverse_inertia_per_kg_m2),
    )


def tangent_rates(x, tangent, c):
    """Time derivative of a tangent vector, the steering moving."""
    beta, gamma, delta, _ = x
    d_beta, d_gamma, d_delta, d_omega = tangent
    front_rad = beta + c.front_lever_s * gamma - delta
    rear_rad = beta - c.rear_lever_s * gamma
    front_n_per_rad = c.front_linear_n_per_rad - 3.0 * c.front_cubic_n_per_rad3 * (front_rad * front_rad)
    rear_n_per_rad = c.rear_linear_n_per_rad - 3.0 * c.rear_cubic_n_per_rad3 * (rear_rad * rear_rad)
    d_front_n = front_n_per_rad * (d_beta + c.front_lever_s * d_gamma - d_delta)
    d_rear_n = rear_n_per_rad * (d_beta - c.rear_lever_s * d_gamma)
    return (
        (d_front_n + d_rear_n) * c.lateral_gain - d_gamma,
        c.front_yaw_gain * d_front_n - c.rear_yaw_gain * d_rear_n,
        d_omega,
        (-c.trail_m * d_front_n - c.damping_nm_s_per_rad * d_omega) * c.inverse_inertia_per_kg_m2,
    )


def driving_torque_nm(x, c):
    """Torque on the steering at rest from motor and tyres."""
    front_rad = x[0] + c.front_lever_s * x[1] - x[2]
    return c.motor_torque_nm - c.trail_m * (
        front_rad * (c.front_linear_n_per_rad - c.front_cubic_n_per_rad3 * (front_rad * front_rad))
    )


def exported():
    """The coefficients of each lane, and the shared model's values of the right-hand side at random states."""
    return [Coefficients(**lane) for lane in EXPORT["lanes"]], EXPORT["samples"]

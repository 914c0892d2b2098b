"""numba (PyPI): the classical Runge-Kutta method of fourth order at a fixed step, compiled just in time."""

import time

import numba
import numpy as np

from model import RENORMALISATION_S, START, TANGENT_NORM, TANGENT_START, exported, rates, tangent_rates

rates = numba.njit(rates, fastmath=True, inline="always")
tangent_rates = numba.njit(tangent_rates, fastmath=True, inline="always")


@numba.njit(fastmath=True, inline="always")
def along(x, k, step_s):
    """The state some way along a slope."""
    return (x[0] + k[0] * step_s, x[1] + k[1] * step_s, x[2] + k[2] * step_s, x[3] + k[3] * step_s)


@numba.njit(fastmath=True, inline="always")
def mean(k1, k2, k3, k4):
    """The slope of a step."""
    third = 1.0 / 3.0
    sixth = 0.5 * third
    return (
        (k1[0] + k4[0]) * sixth + (k2[0] + k3[0]) * third,
        (k1[1] + k4[1]) * sixth + (k2[1] + k3[1]) * third,
        (k1[2] + k4[2]) * sixth + (k2[2] + k3[2]) * third,
        (k1[3] + k4[3]) * sixth + (k2[3] + k3[3]) * third,
    )


@numba.njit(fastmath=True)
def run_state(c, x, steps, step_s):
    """The state after so many steps."""
    for _ in range(steps):
        k1 = rates(x, c, 0.0, 1.0)
        k2 = rates(along(x, k1, 0.5 * step_s), c, 0.0, 1.0)
        k3 = rates(along(x, k2, 0.5 * step_s), c, 0.0, 1.0)
        k4 = rates(along(x, k3, step_s), c, 0.0, 1.0)
        x = along(x, mean(k1, k2, k3, k4), step_s)
    return x


@numba.njit(fastmath=True)
def run_tangent(c, x, tangent, steps, step_s, stretches):
    """The state after so many stretches of so many steps, and the logarithm of the tangent vector's growth."""
    logarithm = 0.0
    for _ in range(stretches):
        for _ in range(steps):
            k1, d1 = rates(x, c, 0.0, 1.0), tangent_rates(x, tangent, c)
            y = along(x, k1, 0.5 * step_s)
            k2, d2 = rates(y, c, 0.0, 1.0), tangent_rates(y, along(tangent, d1, 0.5 * step_s), c)
            y = along(x, k2, 0.5 * step_s)
            k3, d3 = rates(y, c, 0.0, 1.0), tangent_rates(y, along(tangent, d2, 0.5 * step_s), c)
            y = along(x, k3, step_s)
            k4, d4 = rates(y, c, 0.0, 1.0), tangent_rates(y, along(tangent, d3, step_s), c)
            x = along(x, mean(k1, k2, k3, k4), step_s)
            tangent = along(tangent, mean(d1, d2, d3, d4), step_s)
        growth = np.sqrt(tangent[0] ** 2 + tangent[1] ** 2 + tangent[2] ** 2 + tangent[3] ** 2) / TANGENT_NORM
        logarithm += np.log(growth)
        tangent = (tangent[0] / growth, tangent[1] / growth, tangent[2] / growth, tangent[3] / growth)
    return x, logarithm


class Numba:
    """numba at a fixed step."""

    name = "numba RK4"
    version = numba.__version__
    setting_name = "step (s)"
    settings = [1 / rate_hz for rate_hz in (100, 125, 160, 200, 250, 320, 400, 500, 640, 800, 1000, 1250, 1600, 2000, 2500, 3200, 4000)]
    cannot = {"F": "no integrator of its own, hence no events: whatever located them would be ours"}

    def __init__(self):
        self.lanes, self.samples = exported()

    def check(self):
        """The right-hand sides at the shared model's samples."""
        for s in self.samples:
            x, tangent, c = tuple(s["x"]), tuple(s["tangent"]), self.lanes[s["lane"]]
            yield rates_at(x, c, s["friction_nm"], s["free"]), tangent_rates_at(x, tangent, c)

    def prepare(self, job, step_s):
        """Compiles; the result runs the job up to a time."""

        def run(until_s):
            start_s = time.process_time()
            if job == "S":
                states = [run_state(c, START, round(until_s / step_s), step_s) for c in self.lanes]
                return {"cpu_s": time.process_time() - start_s, "states": states}
            stretches, steps = round(until_s / RENORMALISATION_S), round(RENORMALISATION_S / step_s)
            results = [run_tangent(c, START, TANGENT_START, steps, step_s, stretches) for c in self.lanes]
            return {
                "cpu_s": time.process_time() - start_s,
                "states": [x for x, _ in results],
                "exponents_per_s": [logarithm / until_s for _, logarithm in results],
            }

        run(RENORMALISATION_S)
        return run


@numba.njit(fastmath=True)
def rates_at(x, c, friction_nm, free):
    """The state's right-hand side, to be called from Python."""
    return rates(x, c, friction_nm, free)


@numba.njit(fastmath=True)
def tangent_rates_at(x, tangent, c):
    """The tangent vector's right-hand side, to be called from Python."""
    return tangent_rates(x, tangent, c)

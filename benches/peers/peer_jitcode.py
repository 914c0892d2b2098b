"""JiTCODE (PyPI): SciPy's dop853 on a right-hand side that it writes and compiles in C."""

import time
from importlib.metadata import version

import numpy as np
import symengine
from jitcode import jitcode, y

from model import (
    RENORMALISATION_S,
    SPEED_DEPENDENT,
    START,
    TANGENT_NORM,
    TANGENT_START,
    exported,
    rates,
    tangent_rates,
)


class Jitcode:
    """JiTCODE's dop853."""

    name = "jitcode dop853"
    version = version("jitcode")
    setting_name = "tolerance"
    settings = [10.0 ** (-k / 4) for k in range(24, 53)]
    cannot = {"F": "no event location"}

    def __init__(self):
        self.lanes, self.samples = exported()
        self.compiled = {}

    def compile(self, job):
        """The compiled system of a job; what differs between lanes is a control parameter."""
        if job not in self.compiled:
            pars = symengine.symbols(SPEED_DEPENDENT)
            x, tangent = [y(i) for i in range(4)], [y(i) for i in range(4, 8)]
            c = self.lanes[0]._replace(**dict(zip(SPEED_DEPENDENT, pars)))
            system = list(rates(x, c, 0.0, 1.0))
            if job == "L":
                system += tangent_rates(x, tangent, c)
            ode = jitcode(system, control_pars=pars, verbose=False)
            # Simplifying needs sympy and changes nothing: the compiler does it.
            ode.generate_f_C(simplify=False)
            ode.compile_C()
            self.compiled[job] = ode
        return self.compiled[job]

    def set_lane(self, ode, c):
        """Sets the parameters of a lane."""
        ode.set_parameters([getattr(c, name) for name in SPEED_DEPENDENT])

    def check(self):
        """The right-hand sides at the shared model's samples without friction."""
        ode = self.compile("L")
        ode.set_integrator("dop853")
        for s in self.samples:
            if s["free"] != 1.0 or s["friction_nm"] != 0.0:
                yield None
                continue
            self.set_lane(ode, self.lanes[s["lane"]])
            ode.set_initial_value(np.array(START + TANGENT_START), 0.0)
            ode.integrate(1e-9)  # Hands the parameters to the compiled code.
            values = ode.f(0.0, np.array(s["x"] + s["tangent"]))
            yield values[:4], values[4:]

    def prepare(self, job, tolerance):
        """Compiles; the result runs the job up to a time."""
        ode = self.compile(job)
        ode.set_integrator("dop853", rtol=tolerance, atol=tolerance, nsteps=10**9)

        def run(until_s):
            states, exponents_per_s = [], []
            start_s = time.process_time()
            for c in self.lanes:
                self.set_lane(ode, c)
                if job == "S":
                    ode.set_initial_value(np.array(START), 0.0)
                    states.append(ode.integrate(until_s))
                    continue
                logarithm, state = 0.0, np.array(START + TANGENT_START)
                for i in range(round(until_s / RENORMALISATION_S)):
                    ode.set_initial_value(state, i * RENORMALISATION_S)
                    state = ode.integrate((i + 1) * RENORMALISATION_S)
                    growth = np.linalg.norm(state[4:]) / TANGENT_NORM
                    state[4:] /= growth
                    logarithm += np.log(growth)
                states.append(state[:4])
                exponents_per_s.append(logarithm / until_s)
            result = {"cpu_s": time.process_time() - start_s, "states": states}
            if job == "L":
                result["exponents_per_s"] = exponents_per_s
            return result

        return run

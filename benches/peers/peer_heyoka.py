"""heyoka (PyPI): Taylor series by automatic differentiation, compiled just in time; scalar, or a batch of lanes per SIMD
register. Friction's changes of mode are terminal events.
"""

import time

import heyoka as hy
import numpy as np

from model import (
    RENORMALISATION_S,
    SPEED_DEPENDENT,
    START,
    TANGENT_NORM,
    TANGENT_START,
    driving_torque_nm,
    exported,
    rates,
    tangent_rates,
)

COOLDOWN_S = 1e-7
"""Time after an event in which no other is looked for. heyoka's own choice comes from the event function's slope, which is
zero at a release (the steering starts with no acceleration), so that it would miss the stop that follows."""
FRICTION_PAR, FREE_PAR = len(SPEED_DEPENDENT), len(SPEED_DEPENDENT) + 1


class Heyoka:
    """heyoka with `batch` lanes side by side."""

    version = hy.__version__
    setting_name = "tolerance"
    settings = [10.0 ** (-k / 2) for k in range(10, 29)]
    cannot = {}

    def __init__(self, batch, precision="double"):
        self.batch = batch
        self.real = {"double": float, "long double": np.longdouble}[precision]
        self.name = f"heyoka batch {batch}" if batch > 1 else "heyoka scalar"
        self.lanes, self.samples = exported()

    def expressions(self, job):
        """State variables, tangent variables and right-hand sides; what differs between lanes is a runtime parameter."""
        x = hy.make_vars("beta", "gamma", "delta", "omega")
        c = self.lanes[0]._replace(**{name: hy.par[i] for i, name in enumerate(SPEED_DEPENDENT)})
        friction_nm, free = (hy.par[FRICTION_PAR], hy.par[FREE_PAR]) if job == "F" else (0.0, 1.0)
        equations = list(zip(x, rates(x, c, friction_nm, free)))
        if job == "L":
            tangent = hy.make_vars("d_beta", "d_gamma", "d_delta", "d_omega")
            equations += list(zip(tangent, tangent_rates(x, tangent, c)))
        return equations, x, c

    def check(self):
        """The compiled right-hand sides at the shared model's samples."""
        (state, _, _), (both, _, _) = self.expressions("F"), self.expressions("L")
        rates_at, tangent_rates_at = (
            hy.cfunc([rhs for _, rhs in equations], [var for var, _ in equations]) for equations in (state, both)
        )
        for s in self.samples:
            pars = [getattr(self.lanes[s["lane"]], name) for name in SPEED_DEPENDENT]
            friction = [s["friction_nm"], s["free"]]
            yield (
                rates_at(np.array(s["x"]), pars=np.array(pars + friction)),
                tangent_rates_at(np.array(s["x"] + s["tangent"]), pars=np.array(pars))[4:],
            )

    def prepare(self, job, tolerance):
        """Compiles; the result runs the job up to a time."""
        equations, x, c = self.expressions(job)
        batch = (self.batch,) if self.batch > 1 else ()
        options = {"tol": self.real(tolerance), "fp_type": self.real, "fast_math": True, "compact_mode": False}
        if batch:
            options["force_avx512"] = True
        if job == "F":
            torque_nm, free = driving_torque_nm(x, c), hy.par[FREE_PAR]
            # One event function: the steering rate in slip, the torque's distance to its limits in stick.
            in_stick = torque_nm * torque_nm - c.friction_limit_nm * c.friction_limit_nm
            event = hy.t_event_batch if batch else hy.t_event
            options["t_events"] = [
                event(
                    free * x[3] + (1.0 - free) * in_stick,
                    callback=self.callback(),
                    cooldown=self.real(COOLDOWN_S),
                    fp_type=self.real,
                )
            ]
        make = hy.taylor_adaptive_batch if batch else hy.taylor_adaptive
        pars = np.zeros((len(SPEED_DEPENDENT) + 2 * (job == "F"), *batch), self.real)
        integrator = make(equations, np.zeros((len(equations), *batch), self.real), pars=pars, **options)
        return lambda until_s: self.run(integrator, job, until_s)

    def callback(self):
        """What an event calls. A function, not a method: heyoka would work on a copy of its object."""

        def change_mode(integrator, _sign, lane=None):
            part = slice(None) if lane is None else (slice(None), lane)
            self.change(integrator.state[part], integrator.pars[part])
            self.mode_changes[lane or 0] += 1
            return True

        return change_mode

    def change(self, x, pars):
        """The mode behind a stop, which the torque decides, or behind a release, to the torque's side."""
        c = self.lanes[0]
        torque_nm = driving_torque_nm(x, c._replace(front_lever_s=pars[0]))
        if pars[FREE_PAR] and abs(torque_nm) <= c.friction_limit_nm:
            pars[FREE_PAR] = 0.0
        else:
            pars[FREE_PAR] = 1.0
            pars[FRICTION_PAR] = c.friction_limit_nm if torque_nm > 0 else -c.friction_limit_nm
        x[3] = 0.0

    def start(self, integrator, job, group):
        """Sets the integrator to the start of a group of lanes."""
        shape = integrator.state.shape[1:]
        x = START + (TANGENT_START if job == "L" else ())
        integrator.state[:] = np.reshape(np.repeat(x, self.batch), (-1, *shape))
        for i, name in enumerate(SPEED_DEPENDENT):
            integrator.pars[i] = np.reshape([getattr(c, name) for c in group], shape)
        if shape:
            integrator.set_time(0.0)
        else:
            integrator.time = self.real(0.0)
        self.mode_changes = [0] * self.batch
        if job == "F":
            integrator.reset_cooldowns()
            integrator.pars[FREE_PAR] = 1.0
            for lane in range(self.batch):
                part = (slice(None), lane) if shape else slice(None)
                self.change(integrator.state[part], integrator.pars[part])
                # A start in slip is itself an event, as the steering rate is zero; it is no change of mode.
                self.mode_changes[lane] = -int(integrator.pars[part][FREE_PAR])

    def run(self, integrator, job, until_s):
        """All lanes, group by group."""
        states, exponents_per_s, mode_changes = [], [], []
        start_s = time.process_time()
        for first in range(0, len(self.lanes), self.batch):
            # The last batch is filled up with the last lane.
            group = [self.lanes[min(i, len(self.lanes) - 1)] for i in range(first, first + self.batch)]
            self.start(integrator, job, group)
            logarithms = np.zeros(self.batch)
            if job == "L":
                tangent = integrator.state[4:].reshape(4, -1)
                for i in range(1, round(until_s / RENORMALISATION_S) + 1):
                    integrator.propagate_until(self.real(i * RENORMALISATION_S))
                    growth = np.sqrt((tangent * tangent).sum(axis=0)) / TANGENT_NORM
                    tangent /= growth
                    logarithms += np.log(growth)
            else:
                integrator.propagate_until(self.real(until_s))
            states += list(integrator.state[:4].reshape(4, -1).T.copy())
            exponents_per_s += list(logarithms / until_s)
            mode_changes += self.mode_changes
        cpu_s = time.process_time() - start_s
        used = len(self.lanes)
        result = {"cpu_s": cpu_s, "states": states[:used]}
        if job == "L":
            result["exponents_per_s"] = exponents_per_s[:used]
        if job == "F":
            result["mode_changes"] = mode_changes[:used]
        return result

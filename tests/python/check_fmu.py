"""Simulates the units of `sim-host fmu` with fmpy, which shares no code with this project.

    check_fmu.py CHECK ECU VEHICLE [JOB]

CHECK is the name of a function below. A check that fails ends with an exception.
"""

import ctypes
import json
import math
import sys
from array import array
from ctypes import byref, c_void_p
from functools import cache
from itertools import chain

from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2StepFinishedTYPE,
)
from fmpy.validation import validate_fmu

PERIOD_S = 1e-4
PERIODS_PER_TICK = 10
OK, DISCARD, ERROR = 0, 2, 3
CO_SIMULATION = 1


@cache
def extracted(path):
    """The folder of a unit. All its instances are in one library, which the process loads once."""
    return extract(path)


class Unit:
    """An instance of a unit, with its variables by name."""

    def __init__(self, path, name="one", **experiment):
        self.messages = []
        self.description = read_model_description(path)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.outputs = [v for v in self.description.modelVariables if v.causality == "output"]
        self.fmu = FMU2Slave(
            guid=self.description.guid,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            unzipDirectory=extracted(path),
            instanceName=name,
        )
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(self.log)
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(0)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(0)
        self.callbacks.stepFinished = fmi2StepFinishedTYPE(0)
        self.experiment = experiment
        self.readers = self.grouped(self.outputs)
        try:
            self.fmu.instantiate(callbacks=self.callbacks)
        except Exception as failure:
            raise AssertionError(self.messages) from failure
        self.time = experiment.get("startTime", 0.0)

    def log(self, environment, name, status, category, message):
        self.messages.append((name.decode(), status, category.decode(), message.decode()))

    def grouped(self, variables):
        """The variables of each type: places, value references, room for their values, getter."""
        groups = []
        for kinds, c_type, getter in [
            (("Real",), ctypes.c_double, self.fmu.fmi2GetReal),
            (("Integer", "Enumeration"), ctypes.c_int, self.fmu.fmi2GetInteger),
            (("Boolean",), ctypes.c_int, self.fmu.fmi2GetBoolean),
        ]:
            found = [(i, v.valueReference) for i, v in enumerate(variables) if v.type in kinds]
            if found:
                places, references = zip(*found)
                count = len(found)
                groups.append((places, (ctypes.c_uint * count)(*references), (c_type * count)(), getter))
        return groups

    def read(self):
        """All outputs, as numbers, in their order."""
        values = [0.0] * len(self.outputs)
        for places, references, room, getter in self.readers:
            getter(self.fmu.component, references, len(places), room)
            for place, value in zip(places, room):
                values[place] = float(value)
        return values

    def get(self, name):
        return self.read()[[output.name for output in self.outputs].index(name)]

    def set(self, values):
        for name, value in values.items():
            variable = self.variables[name]
            setter = {
                "Real": self.fmu.setReal,
                "Boolean": self.fmu.setBoolean,
            }.get(variable.type, self.fmu.setInteger)
            setter([variable.valueReference], [value])

    def begin(self, parameters={}):
        self.set(parameters)
        self.fmu.setupExperiment(**self.experiment)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def step(self, size=PERIOD_S):
        self.fmu.doStep(self.time, size)
        self.time += size

    def run(self, steps, size=PERIOD_S):
        """The outputs before the first and after every step."""
        rows = [self.read()]
        for _ in range(steps):
            self.step(size)
            rows.append(self.read())
        return rows

    def refused(self, act, *parts):
        """Expects fmi2Error, and the parts in its message."""
        self.messages.clear()
        try:
            act()
        except FMICallException as refusal:
            assert refusal.status == ERROR, refusal
        else:
            raise AssertionError(f"not refused: {parts}")
        [(name, status, category, message)] = self.messages
        assert (name, status, category) == (self.fmu.instanceName, ERROR, "logStatusError")
        for part in parts:
            assert part in message, f"{message!r} lacks {part!r}"


def same(a, b):
    """Bit for bit."""
    return array("d", chain(*a)).tobytes() == array("d", chain(*b)).tobytes()


def valid(ecu, vehicle):
    for path in (ecu, vehicle):
        assert validate_fmu(path) == [], validate_fmu(path)
        description = read_model_description(path)
        parameters = [v for v in description.modelVariables if v.causality == "parameter"]
        assert len(parameters) > 80
        for variable in description.modelVariables:
            assert variable.description.endswith("."), variable.name
            if variable.causality == "parameter" and variable.type == "Real":
                assert float(variable.min) <= float(variable.start) <= float(variable.max), variable.name
        mass = next(v for v in parameters if v.name == "vehicle.mass_kg")
        assert (mass.unit, mass.min, mass.max, mass.start) == ("kg", "1.0", "100000.0", "1500.0")
        rpm = next(unit for unit in description.unitDefinitions if unit.name == "rpm")
        assert math.isclose(rpm.baseUnit.factor, math.pi / 30)


def alone(ecu, vehicle):
    for path, moves in ((ecu, "duty_code"), (vehicle, "state.yaw_rate_rad_per_s")):
        result = simulate_fmu(path, stop_time=4.0, output_interval=1e-3, step_size=1e-3)
        assert len(result) == 4001
        assert len(set(result[moves])) > 10, f"{moves} does not change"
        for name in result.dtype.names:
            assert all(math.isfinite(value) for value in result[name]), name


def coupled(ecu, vehicle, job):
    """The loop of both, as pil closes it: a row per PWM period, the ECU's outputs at its start and
    the vehicle's at its end."""
    with open(job) as file:
        job = json.load(file)
    driver = array("d")
    with open(job["driver"], "rb") as file:
        driver.frombytes(file.read())
    replayed = Unit(ecu, name="replayed").begin()
    ecu, vehicle = Unit(ecu).begin(), Unit(vehicle).begin(job["parameters"])
    names = [output.name for output in ecu.outputs]
    duty, bridge, limit = (names.index(n) for n in ("duty_code", "bridge_on", "wheel_speed_limit_rpm"))
    signals = [ecu.variables[output.name].valueReference for output in vehicle.outputs[:5]]
    reals = [
        vehicle.variables[name].valueReference
        for name in ("wheel_speed_limit_rpm", "driver_wheel_speed_rpm", "driver_current_request_a")
    ]
    duty_in, bridge_in = (vehicle.variables[name].valueReference for name in ("duty_code", "bridge_on"))
    rows = array("d")
    # The ECU's inputs and outputs at each control tick.
    ticks = []
    measured = vehicle.read()[:5]
    for period in range(len(driver) // 2):
        out = ecu.read()
        vehicle.fmu.setInteger([duty_in], [int(out[duty])])
        vehicle.fmu.setBoolean([bridge_in], [int(out[bridge])])
        vehicle.fmu.setReal(reals, [out[limit], *driver[2 * period : 2 * period + 2]])
        ecu.fmu.setReal(signals, measured)
        if period % PERIODS_PER_TICK == 0:
            ticks.append((measured, out))
        vehicle.step()
        ecu.step()
        seen = vehicle.read()
        measured = seen[:5]
        rows.extend(out)
        rows.extend(seen)
    with open(job["trace"], "wb") as file:
        rows.tofile(file)
    # The ECU alone, a step for each tick.
    for inputs, outputs in ticks:
        assert same([replayed.read()], [outputs]), f"at {replayed.time} s"
        replayed.fmu.setReal(signals, inputs)
        replayed.step(PERIODS_PER_TICK * PERIOD_S)


QUICK = {"dither.waveform": 2, "dither.start_time_s": 0.0, "controller.dither_ramp_s": 0.05}


def step_sizes(ecu, vehicle):
    """Every step size gives the same at the same times, and holds the outputs within a period."""
    for path, parameters in ((ecu, QUICK), (vehicle, {"manoeuvre.sensors.noise.yaw_rate_rad_per_s": 0.01})):
        # 1.26 s: the lead-in of the vehicle takes 1.02 s.
        periods = 12_600
        reference = Unit(path).begin(parameters).run(periods)
        assert len({tuple(row) for row in reference}) > 100, "nothing happens"
        for size, every in ((2e-4, 2), (3e-4, 3), (1e-3, 10), (1.4e-3, 14), (0.09, 900), (1.26, periods)):
            rows = Unit(path).begin(parameters).run(periods // every, size)
            assert same(rows, reference[::every]), size
        for size in (0.5e-4, 0.7e-4, 0.3e-4):
            steps = round(periods * PERIOD_S / size)
            rows = Unit(path).begin(parameters).run(steps, size)
            # The period within which each time lies.
            expected = [reference[int(step * size / PERIOD_S + 1e-3)] for step in range(steps + 1)]
            assert same(rows, expected), size
    # An experiment that begins later, and ends early.
    late = Unit(ecu, startTime=100.0, stopTime=100.02).begin(QUICK)
    assert same(late.run(150), Unit(ecu).begin(QUICK).run(150))
    late.step(0.005)
    late.refused(lambda: late.step(0.001), "beyond the stop time, 100.02 s")


def states(ecu, vehicle):
    for path in (ecu, vehicle):
        unit = Unit(path).begin(QUICK)
        unit.run(10_500)
        state, time = unit.fmu.getFMUstate(), unit.time
        first = unit.run(500)
        assert len({tuple(row) for row in first}) > 1, "nothing happens"
        for _ in range(2):
            unit.fmu.setFMUstate(state)
            unit.time = time
            assert same(unit.run(500), first)
        # Stored anew in the same place.
        unit.fmu.fmi2GetFMUstate(unit.fmu.component, byref(state))
        time = unit.time
        second = unit.run(20)
        # Out of a failure, too.
        unit.refused(lambda: unit.fmu.doStep(unit.time, -1.0), "step size -1 s")
        unit.fmu.setFMUstate(state)
        unit.time = time
        assert same(unit.run(20), second) and not same(second, first[:21])
        other = Unit(path, name="other").begin(QUICK)
        other.refused(lambda: other.fmu.setFMUstate(state), "no state of this instance")
        freed = c_void_p(state.value)
        unit.fmu.freeFMUstate(state)
        assert state.value is None
        unit.fmu.freeFMUstate(state)
        unit.refused(lambda: unit.fmu.setFMUstate(freed), "one that was freed")
        unit.fmu.reset()
        unit.refused(lambda: unit.fmu.freeFMUstate(freed), "one that was freed")


def reset(ecu, vehicle):
    for path in (ecu, vehicle):
        unit = Unit(path).begin(QUICK)
        first = unit.run(11_000)
        for spoil in (lambda: None, unit.fmu.terminate, lambda: unit.refused(lambda: unit.step(0.0), "step size 0 s")):
            spoil()
            unit.fmu.reset()
            unit.time = 0.0
            assert same(unit.begin(QUICK).run(11_000), first)
        # A reset takes the parameters back, too.
        unit.fmu.reset()
        unit.time = 0.0
        assert same(unit.begin().run(11_000), Unit(path).begin().run(11_000))
        unit.fmu.terminate()
        unit.fmu.freeInstance()


def instances(ecu, vehicle):
    """Instances of both units in turn give what each gives alone."""
    changes = {ecu: {"yaw_rate_rad_per_s": 9.0}, vehicle: {"duty_code": 1300}}
    alone = {path: [Unit(path).begin(QUICK), Unit(path).begin(QUICK)] for path in changes}
    turns = {path: [Unit(path, "a").begin(QUICK), Unit(path, "b").begin(QUICK)] for path in changes}
    for path, change in changes.items():
        alone[path][1].set(change)
        turns[path][1].set(change)
    rows = {unit: [unit.read()] for pair in turns.values() for unit in pair}
    for _ in range(10_500):
        for unit, seen in rows.items():
            unit.step()
            seen.append(unit.read())
    for path in changes:
        expected = [unit.run(10_500) for unit in alone[path]]
        assert not same(*expected), "the change has no effect"
        for unit, expected in zip(turns[path], expected):
            assert same(rows[unit], expected)


def bad_parameters(ecu, vehicle):
    for path in (ecu, vehicle):
        for name, value, parts in (
            ("vehicle.mass_kg", -1.0, ("vehicle.mass_kg = -1", "from 1 to 100000")),
            ("vehicle.mass_kg", math.nan, ("vehicle.mass_kg = NaN", "from 1 to 100000")),
            ("gate.motor_voltage_v", 9.5, ("gate.motor_voltage_v = 9.5", "from 0 to 9")),
            ("dither.waveform", 4, ("dither.waveform", "1 (none), 2 (square), 3 (sine)")),
        ):
            unit = Unit(path)
            unit.refused(lambda: unit.set({name: value}), *parts)
            unit.refused(unit.begin, "fmi2SetupExperiment", "fmi2Reset")
            unit.fmu.reset()
            unit.begin().step()
        # Each in its range, but not together.
        for name, value, parts in (
            ("run.control_rate_hz", 3000.0, ("run.control_rate_hz = 3000", "multiple")),
            ("servo.bus_voltage_v", 0.1, ("servo.bus_voltage_v = 0.1", "dither.amplitude_v")),
        ):
            unit = Unit(path)
            unit.refused(lambda: unit.begin({name: value}), "fmi2ExitInitializationMode", *parts)
        # It is fixed, and an output is read only.
        unit = Unit(path).begin()
        unit.refused(lambda: unit.set({"vehicle.mass_kg": 1.0}), "vehicle.mass_kg", "not allowed in the simulation")
        unit = Unit(path).begin()
        output = unit.outputs[0].name
        unit.refused(lambda: unit.set({output: 0}), output, "an output cannot be set")
    # Only the ECU's own check finds this one.
    unit = Unit(ecu)
    wrong = {"controller.motor_current_a": 900.0}
    unit.refused(lambda: unit.begin(wrong), "controller.motor_current_a = 900", "from 0 to 15")


def bad_inputs(ecu, vehicle):
    # The ECU's own plausibility check reacts.
    for value, fault in ((math.nan, 0), (math.inf, 0), (9.0, 1)):
        unit = Unit(ecu).begin()
        unit.run(300)
        assert (unit.get("mode"), unit.get("faults")) == (1.0, 0.0), unit.read()
        unit.set({"yaw_rate_rad_per_s": value})
        unit.run(300)
        assert unit.get("mode") == 2.0
        assert int(unit.get("faults")) & 1 << fault, unit.get("faults")
        assert unit.messages == []
    for name, value, parts in (
        ("duty_code", 2501, ("duty_code = 2501", "from 0 to 2500")),
        ("duty_code", -1, ("duty_code = -1",)),
        ("driver_wheel_speed_rpm", math.nan, ("driver_wheel_speed_rpm = NaN", "from 1 to 100000")),
        ("driver_current_request_a", -1001.0, ("driver_current_request_a = -1001", "from -1000 to 1000")),
        ("wheel_speed_limit_rpm", math.inf, ("wheel_speed_limit_rpm = inf",)),
    ):
        unit = Unit(vehicle).begin()
        unit.refused(lambda: unit.set({name: value}), *parts)


def bad_calls(ecu, vehicle):
    for path in (ecu, vehicle):

        def refused(prepare, act, *parts):
            unit = Unit(path)
            prepare(unit)
            unit.refused(lambda: act(unit), *parts)
            # After a failure nothing but a reset is allowed.
            unit.refused(unit.step, "fmi2DoStep", "after a call that returned fmi2Error", "fmi2Reset")

        begin = Unit.begin
        for size, text in ((0.0, "0"), (-1e-3, "-0.001"), (math.nan, "NaN"), (math.inf, "inf"), (1e9, "1000000000")):
            refused(begin, lambda unit: unit.step(size), f"step size {text} s", "above 0 and at most 100 s")
        refused(begin, lambda unit: unit.fmu.doStep(0.5, 1e-4), "step from 0.5 s", "present time, 0 s")
        refused(begin, lambda unit: unit.fmu.doStep(math.nan, 1e-4), "step from NaN s")
        refused(lambda unit: None, Unit.step, "not allowed before the initialisation")
        refused(lambda unit: unit.fmu.enterInitializationMode(), Unit.step, "not allowed in the initialisation")
        refused(begin, Unit.begin, "fmi2SetupExperiment", "not allowed in the simulation")
        refused(begin, lambda unit: unit.fmu.exitInitializationMode(), "not allowed in the simulation")
        refused(lambda unit: None, lambda unit: unit.fmu.terminate(), "not allowed before the initialisation")
        for start, stop, text in ((math.nan, None, "start time NaN s"), (1.0, 1.0, "stop time 1 s"), (0.0, math.nan, "stop time NaN s")):
            refused(lambda unit: None, lambda unit: unit.fmu.setupExperiment(startTime=start, stopTime=stop), text)

        ended = Unit(path).begin()
        ended.fmu.terminate()
        assert ended.read() and ended.messages == [], "outputs are readable at the end"
        ended.refused(ended.step, "not allowed after fmi2Terminate", "fmi2Reset")
        ended.fmu.reset()
        ended.begin().fmu.terminate()
        ended.refused(ended.fmu.terminate, "not allowed after fmi2Terminate")

        count = len(Unit(path).variables)
        for reference in (count, 2**32 - 1):
            text = f"value reference {reference}", f"from 0 to {count - 1}"
            refused(begin, lambda unit: unit.fmu.getReal([reference]), "fmi2GetReal", *text)
            refused(begin, lambda unit: unit.fmu.setReal([reference], [1.0]), "fmi2SetReal", *text)
        flag = Unit(path).variables["friction.dithered"].valueReference
        refused(begin, lambda unit: unit.fmu.getReal([flag]), "is of the type Boolean")
        refused(lambda unit: None, lambda unit: unit.fmu.setReal([flag], [1.0]), "is of the type Boolean, not Real")
        refused(begin, lambda unit: unit.fmu.getString([0]), "no such variables")
        for missing in (
            lambda unit: unit.fmu.cancelStep(),
            lambda unit: unit.fmu.getDirectionalDerivative([0], [1], [1.0]),
            lambda unit: unit.fmu.setRealInputDerivatives([0], [1], [1.0]),
            lambda unit: unit.fmu.serializeFMUstate(unit.fmu.getFMUstate()),
        ):
            refused(begin, missing, "not supported")


def bad_pointers(ecu, vehicle):
    for path in (ecu, vehicle):
        unit = Unit(path).begin()
        dll, handle = unit.fmu.dll, c_void_p(unit.fmu.component)
        number, one = (ctypes.c_double * 1)(), (ctypes.c_uint * 1)(0)
        size = ctypes.c_size_t(1)
        # Without an instance there is no place for a message.
        for function, arguments in (
            (dll.fmi2Terminate, ()),
            (dll.fmi2Reset, ()),
            (dll.fmi2EnterInitializationMode, ()),
            (dll.fmi2ExitInitializationMode, ()),
            (dll.fmi2GetReal, (one, size, number)),
            (dll.fmi2SetReal, (one, size, number)),
            (dll.fmi2GetFMUstate, (byref(c_void_p()),)),
            (dll.fmi2SetFMUstate, (None,)),
            (dll.fmi2FreeFMUstate, (None,)),
        ):
            assert function(None, *arguments) == ERROR, function
        assert dll.fmi2DoStep(None, ctypes.c_double(0.0), ctypes.c_double(1e-4), 1) == ERROR
        dll.fmi2FreeInstance(None)
        # Nothing is asked for.
        assert dll.fmi2GetReal(handle, None, ctypes.c_size_t(0), None) == OK
        assert dll.fmi2FreeFMUstate(handle, None) == OK
        assert dll.fmi2GetStatus(handle, 0, None) == DISCARD
        last = ctypes.c_double()
        unit.step()
        assert dll.fmi2GetRealStatus(handle, 2, byref(last)) == OK and last.value == PERIOD_S
        for act, part in (
            (lambda: dll.fmi2GetReal(handle, None, size, number), "the pointer vr is null"),
            (lambda: dll.fmi2GetReal(handle, one, size, None), "the pointer value is null"),
            (lambda: dll.fmi2SetReal(handle, None, size, number), "the pointer vr is null"),
            (lambda: dll.fmi2SetReal(handle, one, size, None), "the pointer value is null"),
            (lambda: dll.fmi2GetFMUstate(handle, None), "the pointer FMUstate is null"),
            (lambda: dll.fmi2SetFMUstate(handle, None), "no state of this instance"),
            (lambda: dll.fmi2SetFMUstate(handle, c_void_p(12345)), "no state of this instance"),
            (lambda: dll.fmi2GetRealStatus(handle, 2, None), "the pointer value is null"),
            (lambda: dll.fmi2SetDebugLogging(handle, 1, size, None), "the pointer categories is null"),
        ):
            unit.messages.clear()
            assert act() == ERROR, part
            assert part in unit.messages[-1][3], unit.messages
        dll.fmi2FreeInstance(handle)


def bad_instances(ecu, vehicle):
    for path in (ecu, vehicle):
        good = Unit(path)
        guid, folder = good.description.guid.encode(), good.fmu.unzipDirectory
        resources = f"file://{folder}/resources".encode()
        make = good.fmu.dll.fmi2Instantiate
        make.restype = c_void_p

        def refused(part, name=b"x", kind=CO_SIMULATION, guid=guid, resources=resources):
            good.messages.clear()
            assert make(name, kind, guid, resources, byref(good.callbacks), 0, 0) is None, part
            assert part in good.messages[-1][3], good.messages
            # Without callbacks there is no message, and no crash.
            assert make(name, kind, guid, resources, None, 0, 0) is None, part

        refused("GUID", guid=b"{00000000-0000-0000-0000-000000000000}")
        refused("GUID", guid=b"100 %s %n")
        assert "100 %%s %%n" in good.messages[-1][3], "the message is a format of printf"
        refused("fmuGUID is null", guid=None)
        refused("name of the instance", name=None)
        refused("name of the instance", name=b" ")
        refused("fmi2CoSimulation", kind=0)
        refused("fmuResourceLocation is null", resources=None)
        refused("must be a URI", resources=b"/tmp")
        refused("cannot read /none/configuration.toml", resources=b"file:///none")
        # A URI with a slash at its end, and no callbacks.
        handle = make(b"x", CO_SIMULATION, guid, resources + b"/", None, 0, 0)
        assert handle is not None
        assert good.fmu.dll.fmi2DoStep(c_void_p(handle), ctypes.c_double(0), ctypes.c_double(1e-4), 1) == ERROR
        good.fmu.dll.fmi2FreeInstance(c_void_p(handle))
        # Another configuration than that of the description.
        with open(f"{folder}/resources/configuration.toml", "r+") as file:
            text = file.read().replace("mass_kg = 1500.0", "mass_kg = 1600.0")
            file.seek(0)
            file.write(text)
        refused("GUID")
        with open(f"{folder}/resources/configuration.toml", "w") as file:
            file.write("[vehicle")
        refused("configuration.toml")


if __name__ == "__main__":
    check, *arguments = sys.argv[1:]
    globals()[check](*arguments)

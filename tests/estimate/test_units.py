"""An estimate does not depend on units: the same logs in other units of time, length, mass and voltage give the same physics.

Every quantity is converted by the unit that its channel or parameter states, so that nothing here knows a robot.
"""

import re

import numpy as np
import pytest

from jaxid import (
    Axis,
    Channels,
    Custom,
    DifferentialDrive,
    Integrator,
    Log,
    LogSet,
    Omni,
    Parameter,
    Pioneer,
    instrumental_variables,
    integral_least_squares,
    output_error,
    simulate,
)

STEPS = Integrator(2)
UNITS = ("s", "m", "kg", "V", "rad")
DERIVED = {"N": "kg m s^-2", "A": "kg m^2 s^-3 V^-1", "ohm": "V^2 s^3 kg^-1 m^-2", "H": "V^2 s^4 kg^-1 m^-2"}
FACTORS = {
    "small and fast": dict(s=0.1, m=1e-3, kg=1e3, V=30.0),
    "large and slow": dict(s=4.0, m=1e3, kg=1e-3, V=1e-3),
    "light": dict(s=1.0, m=1.0, kg=1e-3, V=1.0),
    "thousand": dict(s=1e3, m=1e-3, kg=1e3, V=1e3),
    "binary": dict(s=2.0**-6, m=2.0**10, kg=2.0**-9, V=2.0**7),
}
"""Powers of two are rounded alike, so that whatever a constant of the code had to say would show."""


def factor(unit, factors):
    """What a number in `unit` is multiplied with ("N m s", "V s/rad", "kg m^2", "m/s"); what `factors` does not name stays."""
    total = 1.0
    above, _, below = unit.partition("/")
    for part, sign in ((above, 1), (below, -1)):
        for symbol, power in re.findall(r"([A-Za-z]+)(?:\^(-?\d+))?", part):
            power = sign * int(power or 1)
            if symbol in DERIVED:
                total *= factor(DERIVED[symbol], factors) ** power
            elif symbol in UNITS:
                total *= factors.get(symbol, 1.0) ** power
    return total


def two_masses(length="m"):
    """Two masses on a spring and, in another unit of length, two flywheels on a shaft."""

    def dynamics(x, u, p, dry):
        spring = p["k"] * x["twist"] + p["c"] * (x["v1"] - x["v2"])
        return {
            "v1": (u["F"] - dry["guide"] - spring) / p["m1"],
            "v2": (spring - p["b"] * x["v2"]) / p["m2"],
            "twist": x["v1"] - x["v2"],
        }

    channels = Channels(inputs=("F",), outputs=("v1",), units={"F": "N", "v1": f"{length}/s"})
    table = {
        "m1": (1.0, f"N s^2/{length}"),
        "m2": (2.0, f"N s^2/{length}"),
        "k": (40.0, f"N/{length}"),
        "c": (0.8, f"N s/{length}"),
        "b": (1.5, f"N s/{length}"),
        "Fc": (0.3, "N"),
    }
    return Custom(
        dynamics=dynamics,
        state_names=("v1", "v2", "twist"),
        own_channels=channels,
        table={name: Parameter(value, unit, free=True, lower=0.0) for name, (value, unit) in table.items()},
        dry_friction={"guide": ("v1", "Fc")},
    )


ROBOTS = {
    "axis": Axis(),
    "omni": Omni(),
    "pioneer": Pioneer(),
    "differential": DifferentialDrive(),
    "two masses": two_masses(),
    "two flywheels": two_masses("rad"),
}
AMPLITUDE = {
    "axis": 2.0,
    "omni": 6.0,
    "pioneer": 8.0,
    "differential": 6.0,
    "two masses": 4.0,
    "two flywheels": 4.0,
}
OWN_UNITS = {"u": "N", "v": "m/s", "q": "m", "u_right": "N", "u_left": "N"}
"""An axis may slide or turn, and takes any input; here it slides and is pushed. So are the differential drive's sides."""


def recorded(name, motion=False):
    """A log of the robot with noise of 2 % of each channel, and the robot with its parameters some way off."""
    robot = ROBOTS[name]
    rng = np.random.default_rng(7)
    n, nu = 250, len(robot.channels.inputs)
    inputs = AMPLITUDE[name] * np.repeat(rng.uniform(-1, 1, (25, nu)), 10, axis=0)
    time = np.cumsum(np.full(n, 0.03)) - 0.03
    empty = np.zeros((n, len(robot.channels.measured)))
    log = Log.from_arrays("run", time, inputs, empty, robot.channels)
    begin = {robot.states[0]: np.array([0.2])} if motion else None
    clean = simulate(robot, LogSet([log]), start=begin, integrator=STEPS)[0][:, : len(robot.channels.outputs)]
    noisy = clean + 0.02 * clean.std(axis=0) * rng.normal(size=clean.shape)
    outputs = dict(zip(robot.channels.outputs, noisy.T, strict=True))
    off = {p: (1 + 0.3 * (-1) ** k) * robot.parameters[p].value for k, p in enumerate(robot.parameters.free_names)}
    return Log.from_arrays("run", time, inputs, outputs, robot.channels), robot.with_values(**off)


def converted(log, robot, factors):
    """The same recording and robot in other units."""
    units = {**robot.channels.units, **OWN_UNITS}
    measured = np.array([factor(units.get(c, ""), factors) for c in robot.channels.measured])
    driven = np.array([factor(units.get(c, ""), factors) for c in robot.channels.inputs])
    table = robot.parameters
    for name, p in table.items():
        own = factor("" if "unit of u" in p.unit else p.unit, factors)
        lower, upper = (
            p.lower * own if np.isfinite(p.lower) else p.lower,
            p.upper * own if np.isfinite(p.upper) else p.upper,
        )
        typical = None if p.typical is None else p.typical * own
        table = table.change(name, value=p.value * own, lower=lower, upper=upper, typical=typical)
    other = Log(log.name, log.time * factors.get("s", 1.0), log.inputs * driven, log.outputs * measured, log.channels)
    return other, robot.with_parameters(table)


def sizes(robot, factors):
    return {n: factor("" if "unit of u" in p.unit else p.unit, factors) for n, p in robot.parameters.items()}


LINEAR = {"integral least squares": integral_least_squares, "instrumental variables": instrumental_variables}


@pytest.mark.parametrize("estimator", list(LINEAR))
@pytest.mark.parametrize("name", ["axis", "omni", "pioneer", "differential"])
def test_other_units_give_the_same_linear_estimates(name, estimator):
    """Of the omni, currents that nobody measured once decided with their size whether its simulation had run away."""
    log, robot = recorded(name)
    fit = LINEAR[estimator](robot, LogSet([log]))
    assert fit.converged and "identified" in {fit[p].status for p in fit.free_names}
    for units in ("large and slow", "thousand", "binary"):
        other_log, other_robot = converted(log, robot, FACTORS[units])
        agree(fit, LINEAR[estimator](other_robot, LogSet([other_log])), robot, FACTORS[units], within=1e-6)


@pytest.fixture(scope="module", params=["axis", "omni", "pioneer", "two masses"])
def fitted(request):
    log, robot = recorded(request.param)
    return log, robot, output_error(robot, LogSet([log]), integrator=STEPS)


def agree(fit, other, robot, factors, within):
    own = sizes(robot, factors)
    for name in fit.free_names:
        a, b = fit[name], other[name]
        assert b.status == a.status, name
        assert abs(b.value / own[name] - a.value) <= within * a.std_error + 1e-12 * abs(a.value), name
        assert b.std_error / own[name] == pytest.approx(a.std_error, rel=max(1e-4, within)), name
    for channel, level in fit.noise.items():
        unit = {**robot.channels.units, **OWN_UNITS}[channel]
        assert other.noise[channel] == pytest.approx(level * factor(unit, factors), rel=1e-6 + within)
    assert other.converged == fit.converged and other.reason == fit.reason


@pytest.mark.parametrize("units", list(FACTORS))
def test_other_units_give_the_same_estimates(fitted, units):
    log, robot, fit = fitted
    assert fit.converged
    other_log, other_robot = converted(log, robot, FACTORS[units])
    other = output_error(other_robot, LogSet([other_log]), integrator=STEPS)
    # In standard errors. The Pioneer's four dry frictions bend the cost at every reversal; on which side of a bend an optimiser
    # ends is decided by rounding.
    bent = robot.name == "pioneer" and units != "binary"
    agree(fit, other, robot, FACTORS[units], within=1e-5 if bent else 1e-6)


def test_an_angle_may_be_in_any_unit():
    """Flywheels in degrees and in thousands of turns: a user's robot whose equations ask for no radians."""
    log, robot = recorded("two flywheels")
    fit = output_error(robot, LogSet([log]), integrator=STEPS)
    assert fit.converged
    for factors in (dict(rad=180 / np.pi), dict(rad=1e-3 / (2 * np.pi), s=1e-3)):
        other_log, other_robot = converted(log, robot, factors)
        other = output_error(other_robot, LogSet([other_log]), integrator=STEPS)
        agree(fit, other, robot, factors, within=1e-6)


@pytest.mark.parametrize("units", ["small and fast", "large and slow"])
def test_the_generic_axis_table_never_pulls(units):
    """M = 1, Fv = 1, Fc = 0.1 whatever the units: the start is elsewhere then, the optimum is not."""
    log, _ = recorded("axis")
    fit = output_error(Axis(), LogSet([log]), integrator=STEPS)
    other_log, _ = converted(log, Axis(), FACTORS[units])
    other = output_error(Axis(), LogSet([other_log]), integrator=STEPS)
    agree(fit, other, Axis(), FACTORS[units], within=0.01)


def test_a_small_brushed_motor_is_found_from_the_axis_table(axis_log):
    """Its inertia is 1 / 1250 of the table's, where a floor of 1 / 1000 used to be."""
    truth = dict(M=8e-4, Fv=8e-3, Fc=0.02, offset=0.0)
    inputs = 0.1 * np.repeat(np.random.default_rng(1).uniform(-2, 2, 20), 15)
    logs = LogSet([axis_log("motor", inputs, noise=0.1, dt=0.01, position=False, **truth)])
    fit = output_error(Axis(), logs, integrator=Integrator(1))
    assert fit.converged
    for name, value in truth.items():
        assert abs(fit[name].value - value) < 3.5 * fit[name].std_error, name
    assert fit["M"].std_error < 0.02 * truth["M"]


def test_initial_states_do_not_depend_on_units():
    """An unmeasured state of a log in motion had a prior of 0.5 in whatever unit."""
    log, robot = recorded("two masses", motion=True)
    fit = output_error(robot, LogSet([log]), initial_states="estimate", integrator=STEPS)
    for factors in (FACTORS["small and fast"], FACTORS["large and slow"]):
        other_log, other_robot = converted(log, robot, factors)
        other = output_error(other_robot, LogSet([other_log]), initial_states="estimate", integrator=STEPS)
        agree(fit, other, robot, factors, within=1e-5)
        for state, unit in (("v1", "m/s"), ("v2", "m/s"), ("twist", "m")):
            value = fit.initial_states["run"][state]
            found = other.initial_states["run"][state] / factor(unit, factors)
            assert found == pytest.approx(value, rel=1e-5, abs=1e-7)


def test_a_prior_in_the_same_units_pulls_alike():
    log, robot = recorded("axis")
    factors = FACTORS["small and fast"]
    own = factor("kg", factors)
    pulled = robot.with_parameters(robot.parameters.change("M", prior=(1.2, 1e-3)))
    fit = output_error(pulled, LogSet([log]), integrator=STEPS)
    other_log, other = converted(log, robot, factors)
    other = other.with_parameters(other.parameters.change("M", prior=(1.2 * own, 1e-3 * own)))
    found = output_error(other, LogSet([other_log]), integrator=STEPS)
    assert fit["M"].value > 1.01
    agree(fit, found, robot, factors, within=1e-5)

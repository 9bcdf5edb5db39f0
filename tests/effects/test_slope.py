"""A constant force along a line, against the closed form of a mass with viscous friction."""

import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Log, LogSet, Omni, Parameter, explain, output_error
from jaxid.effects import laws_of
from jaxid.simulation.simulate import simulate

CHANNELS = Channels(("u",), ("v",), units={"u": "N", "v": "m/s"})
MASS, VISCOUS, PULL, NOISE = 40.0, 30.0, 6.0, 0.004


def _hull() -> Custom:
    """A mass on a line whose model knows no constant force."""
    return Custom(
        dynamics=lambda s, u, p: {"v": (u["u"] - p["viscous"] * s["v"]) / p["mass"]},
        state_names=("v",),
        own_channels=CHANNELS,
        table={
            "mass": Parameter(30.0, "kg", free=True, lower=1.0),
            "viscous": Parameter(20.0, "N s/m", free=True, lower=0.0),
        },
        forces={"v": "mass"},
        title="hull",
    )


def _log(name: str, seed: int, pull: float, noise: float = NOISE) -> Log:
    rng, dt = np.random.default_rng(seed), 0.05
    u = np.repeat(rng.uniform(-25.0, 25.0, 25), 16)
    decay, v, found = np.exp(-VISCOUS / MASS * dt), 0.0, []
    for force in u:
        found.append(v)
        settled = (force + pull) / VISCOUS
        v = settled + (v - settled) * decay
    outputs = {"v": np.array(found) + noise * rng.normal(size=len(u))}
    return Log.from_arrays(name, dt * np.arange(len(u)), u[:, None], outputs, CHANNELS)


def test_what_goes_along_a_line_may_be_pulled_along_it():
    robot = _hull()
    (law,) = [law for law in laws_of(robot, "ground_slope")]
    pulled = (robot + law).with_values(mass=MASS, viscous=VISCOUS, **{"ground_slope.force": PULL})
    log = _log("run", 3, PULL, noise=0.0)
    (simulated,) = simulate(pulled, LogSet([log]))
    np.testing.assert_allclose(simulated[:, 0], log.output("v"), atol=1e-6)


@pytest.mark.slow
def test_it_is_named_where_the_robot_has_no_such_force_of_its_own():
    logs = LogSet([_log(f"run {k}", k, PULL) for k in range(3)])
    held_out = LogSet([_log("check", 9, PULL)])
    found = explain(output_error(_hull(), logs), logs, held_out)
    (effect,) = found.effects
    # Of a linear robot, a sensor's bias differs from it by a second after the start alone.
    assert {effect.id, *effect.equivalent_to} == {"ground_slope", "sensor_bias"}
    assert effect.law == "along_a_line"
    force = effect.parameters["force"]
    assert abs(force.value - PULL) < 4.0 * force.std_error < 1.0


def test_a_robot_with_such_a_force_or_that_turns_is_not_offered_it():
    assert not laws_of(Axis(), "ground_slope")  # its own offset is free
    assert [law.law for law in laws_of(Axis().change("offset", free=False), "ground_slope")] == ["along_a_line"]
    assert "along_a_line" not in [law.law for law in laws_of(Omni(), "ground_slope")]


def _cart(length: str, metre: float) -> Custom:
    """A cart that rolls and turns in the plane, in some unit of length."""
    return Custom(
        dynamics=lambda s, u, p: {"v": (u["u"] - p["viscous"] * s["v"]) / p["mass"], "w": -s["w"]},
        state_names=("v", "w"),
        own_channels=Channels(("u",), ("v",), units={"u": "N", "v": f"{length}/s"}),
        table={"mass": Parameter(MASS, "kg"), "viscous": Parameter(VISCOUS, "kg/s")},
        forces={"v": "mass", "w": 1.0},
        plane=("v", "", "w"),
        mass="mass",
        title="cart",
    )


def test_a_slope_is_the_same_angle_in_any_unit_of_length():
    """In closed form: it rolls down to v = m g slope / B, in the unit in which the robot is written."""
    time, slope = 0.05 * np.arange(200), 0.02
    for length, metre in (("m", 1.0), ("mm", 1000.0), ("ft", 1.0 / 0.3048)):
        robot = _cart(length, metre)
        assert robot.length_unit == length
        robot = robot + laws_of(robot, "ground_slope")[0]
        robot = robot.with_values(**{"ground_slope.slope_x": slope})
        nothing = {"v": np.zeros(len(time))}
        log = Log.from_arrays("roll", time, np.zeros((len(time), 1)), nothing, robot.channels)
        found = simulate(robot, LogSet([log]))[0][:, 0]
        truth = metre * MASS * 9.81 * slope / VISCOUS * (1.0 - np.exp(-VISCOUS / MASS * time))
        np.testing.assert_allclose(found, truth, rtol=1e-4, atol=1e-6 * metre)


def test_how_wheels_are_read_is_not_what_the_equations_are_in():
    """Wheels in mm/s of a body that is in metres, newtons and kilograms."""
    robot = Custom(
        dynamics=lambda s, u, p: {"v": (u["u"] - p["rub"] * s["v"]) / p["mass"], "w": -s["w"]},
        state_names=("v", "w"),
        output=lambda s, u, p: {"left": 1e3 * (s["v"] - 0.1 * s["w"]), "right": 1e3 * (s["v"] + 0.1 * s["w"])},
        own_channels=Channels(("u",), ("left", "right"), units={"u": "N", "left": "mm/s", "right": "mm/s"}),
        table={"mass": Parameter(MASS, "kg"), "rub": Parameter(VISCOUS, "kg/s")},
        forces={"v": "mass", "w": 1.0},
        plane=("v", "", "w"),
        mass="mass",
    )
    assert robot.length_unit == "m" and Omni().length_unit == "m"
    assert laws_of(robot, "ground_slope")[0].id == "ground_slope" and robot.metre == 1.0

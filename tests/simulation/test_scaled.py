"""Orders of magnitude of what a robot does."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Channels, Custom, DriveAxis, Log, LogSet, Omni, Parameter, simulate
from jaxid.effects import laws_of
from jaxid.simulation.scaled import scales_of


def logs(robot):
    time = 0.02 * np.arange(300)
    inputs = 3.0 * np.sin(time)[:, None] * np.array([1.0, -1.0, 1.0, 0.5])
    outputs = 0.3 * np.sin(time)[:, None] * np.ones(3)
    return LogSet([Log.from_arrays("run", time, inputs, outputs, robot.channels)])


@pytest.mark.filterwarnings("error")
def test_a_parameter_at_its_bound_that_something_is_divided_by_is_no_error():
    usual = scales_of(Omni(), logs(Omni()))
    bound = scales_of(Omni().with_values(J=0.0), logs(Omni()))
    assert bound.torque == usual.torque
    assert bound.force == usual.force
    assert np.isfinite(bound.friction) and bound.friction > 0.0


def two_parts():
    """A motor behind a spring, of which an encoder's counts are all that is measured."""

    def dynamics(s, u, p, friction):
        pull = p["k"] * s["stretch"] + p["c"] * (p["r"] * s["W"] - s["v"])
        return {
            "W": (u["i"] - p["r"] * pull - friction["motor"]) / p["J"],
            "stretch": p["r"] * s["W"] - s["v"],
            "v": (pull - p["B"] * s["v"]) / p["m"],
        }

    table = {"J": 2e-6, "k": 5000.0, "c": 15.0, "m": 5.0, "B": 8.0, "Cm": 1e-4, "r": 1e-3}
    return Custom(
        dynamics=dynamics,
        state_names=("W", "stretch", "v"),
        own_channels=Channels(inputs=("i",), outputs=("counts",), units={"counts": "counts/s"}),
        table={name: Parameter(value) for name, value in table.items()},
        output=lambda s, u, p: {"counts": 80.0 * s["W"]},
        axes={"motor": DriveAxis("W", "Cm", torque=lambda s, u, p: u["i"], lever="r")},
        forces={"v": "m", "W": "J"},
        velocities=("v", "W"),
    )


def test_velocities_that_nothing_measures_are_as_large_as_the_robot_makes_them():
    """Counts a second say nothing of metres a second: a drag of the load was 10^10 times what was thought usual."""
    robot, time = two_parts(), 0.01 * np.arange(600)
    forces = np.repeat(np.random.default_rng(1).uniform(-0.02, 0.02, (12, 1)), 50, axis=0)
    made = LogSet([Log.from_arrays("run", time, forces, np.zeros((600, 1)), robot)])
    (counts,) = simulate(robot, made)
    scales = scales_of(robot, LogSet([Log.from_arrays("run", time, forces, counts, robot)]))
    assert scales.output("W") == pytest.approx(scales.output("counts") / 80.0, rel=0.02)
    assert scales.output("v") == pytest.approx(1e-3 * scales.output("W"), rel=0.2)
    assert scales.speed == pytest.approx(scales.output("v"), rel=0.2)


def test_parts_that_move_against_each_other_have_no_whole_speed():
    assert [law.law for law in laws_of(two_parts(), "quadratic_drag")] == ["per_axis", "shape"]
    (pull,) = laws_of(two_parts(), "ground_slope")
    assert list(pull.parameters(two_parts())) == ["ground_slope.force_v", "ground_slope.force_W"]


def test_the_whole_translation_is_faster_than_its_parts():
    """A curve over it that ended where its parts do would leave the fastest rows without what grows there most."""
    robot, turn = Omni(), np.linspace(0.0, 2 * np.pi, 300)
    outputs = np.stack([0.3 * np.cos(turn), 0.3 * np.sin(turn), 0.2 * np.ones(300)], axis=1)
    outputs[:75] *= 1.5 * np.sqrt(0.5) / np.maximum(np.abs(np.cos(turn)), np.abs(np.sin(turn)))[:75, None]
    circles = LogSet([Log.from_arrays("run", 0.02 * np.arange(300), np.ones((300, 4)), outputs, robot.channels)])
    found = scales_of(robot, circles)
    assert found.whole == pytest.approx(np.quantile(np.hypot(outputs[:, 0], outputs[:, 1]), 0.998))
    assert found.whole > 1.3 * found.reach("V")
    law = next(law for law in laws_of(robot, "quadratic_drag") if law.law == "shape")
    assert law.parameters(replace(robot, scales=found))[law.key("reach")].value == found.whole

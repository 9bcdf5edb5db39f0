"""jaxid/explanation/table_constants.py: a wrong constant of the table beside the name of what looks the same."""

import numpy as np
import pytest

from jaxid import Channels, Custom, Log, LogSet, Parameter, explain, output_error

DT, NOISE = 0.02, 0.005


def dynamics(state, inputs, p):
    return {"v": (p["radius"] * inputs["spin"] - state["v"]) / p["T"]}


def drive(radius):
    """A drive that is told how fast its wheels are to spin, and follows with a lag; the radius is known from the table."""
    return Custom(
        dynamics=dynamics,
        state_names=("v",),
        own_channels=Channels(("spin",), ("v",), (), {"spin": "rad/s", "v": "m/s"}),
        table={"T": Parameter(0.3, "s", lower=0.0, free=True), "radius": Parameter(radius, "m")},
    )


def log(name, seed, robot, curve=0.0):
    """In closed form: the speed goes exponentially to 0.1 m times the spin, each held; `curve` bends the command."""
    rng = np.random.default_rng(seed)
    spin = np.repeat(rng.uniform(-10.0, 10.0, 20), 15)
    acting, v, seen = 0.1 * spin * (1.0 - curve * np.abs(spin) / 10.0), 0.0, []
    for final in acting:
        seen.append(v)
        v = final + (v - final) * np.exp(-DT / 0.3)
    outputs = np.array(seen) + NOISE * rng.normal(size=300)
    return Log.from_arrays(name, DT * np.arange(300), spin[:, None], outputs[:, None], robot.channels)


def explained(radius, curve=0.0):
    robot = drive(radius)
    fitted = LogSet([log("a", 0, robot, curve), log("b", 1, robot, curve)])
    return explain(output_error(robot, fitted), fitted, LogSet([log("held", 2, robot, curve)]))


@pytest.mark.parametrize("radius", [0.104, 0.07])
def test_a_wrong_radius_is_named_beside_the_sensors_scale_with_its_error(radius):
    found = explained(radius)
    assert [effect.id for effect in found.effects] == ["sensor_scale"]
    (said,) = [note for note in found.notes if "a wrong constant in the table" in note]
    share = float(said.partition("radius (")[2].partition(" %")[0])
    assert share == pytest.approx(100 * (0.1 / radius - 1.0), abs=0.5)


def test_what_no_constant_does_is_called_by_its_name_alone():
    found = explained(0.1, curve=0.3)
    assert found.effects and not any("wrong constant" in note for note in found.notes)

"""jaxid/estimate/identifiability.py against what the equations say must be indistinguishable, and against actual fits."""

import numpy as np
import pytest

from jaxid import (
    Axis,
    Channels,
    Custom,
    Log,
    LogSet,
    Parameter,
    ParameterError,
    Pioneer,
    identifiability,
    output_error,
)


@pytest.fixture(scope="module")
def driven(axis_log):
    inputs = np.repeat([3.0, -2.0, 4.0, 0.5, -4.0, 1.5], 80)
    return LogSet([axis_log(f"run {k}", np.roll(inputs, 80 * k), noise=0.01, seed=k, position=False) for k in range(3)])


AXIS = Axis().with_values(M=1.0, Fv=2.0, Fc=0.5)


def test_a_common_factor_of_all_forces_is_structurally_free(driven):
    """Mass, frictions, offset and gain divided by one number are the same motion."""
    found = identifiability(AXIS.change("gain", free=True).with_values(offset=0.3), driven)
    (direction,) = found.free_directions
    assert direction.kind == "structural" and direction.std_error == np.inf
    assert set(direction.change) == {"M", "Fv", "Fc", "offset", "gain"}
    # Changes are relative to the parameters, so all are alike.
    np.testing.assert_allclose(list(direction.change.values()), 5**-0.5, rtol=1e-3)
    assert found.rank == 4 and not found.identifiable and found.std_errors["M"] == np.inf
    assert "nothing changes" in repr(found) and direction.decisive in direction.change


def test_without_the_factor_the_expected_errors_are_those_of_a_fit(driven):
    found = identifiability(AXIS, driven, noise={"v": 0.01})
    assert found.identifiable and found.rank == 4 and found.condition < 100
    fit = output_error(AXIS, driven)
    for name in ("M", "Fv", "Fc", "offset"):
        assert found.std_errors[name] == pytest.approx(fit[name].std_error, rel=0.1)


def test_more_noise_than_signal_leaves_directions_practically_free(driven):
    found = identifiability(AXIS, driven, noise={"v": 50.0})
    assert {direction.kind for direction in found.free_directions} == {"practical"}
    assert "hardly" in found.free_directions[0].sentence and found.free_directions[0].std_error > 1.0


def test_masses_of_the_pioneer_enter_only_together(demo_logs):
    """M, m and m1 weigh on straight motion as their sum and on turning with their moments: two sums, three masses."""
    robot = Pioneer()
    for name in ("M", "m", "m1"):
        robot = robot.change(name, free=True)
    for name in ("Ir1", "Ip1", "Cs1", "Cv1"):
        robot = robot.change(name, free=False)
    found = identifiability(robot, demo_logs("pioneer"))
    assert not found.identifiable
    involved = set().union(*(direction.change for direction in found.free_directions))
    assert involved & {"M", "m", "m1"}
    # What the equations of straight motion and of turning on the spot need is determined all the same.
    assert found.combinations["1/a11"].std_error < 0.01 * found.combinations["1/a11"].value
    assert found.combinations["1/a22"].std_error < 0.01 * found.combinations["1/a22"].value


def test_nothing_free_is_an_error(driven):
    robot = AXIS
    for name in ("M", "Fv", "Fc", "offset"):
        robot = robot.change(name, free=False)
    with pytest.raises(ParameterError, match="no parameter is free"):
        identifiability(robot, driven)


def test_what_moves_a_little_along_a_free_direction_is_as_open_as_what_moves_most():
    """Of torque constant, winding and friction two sums show: K / R and Fv + K² / R, of which the friction is hardly any."""
    motor = Custom(
        dynamics=lambda s, u, p: {"v": p["K"] * (u["u"] - p["K"] * s["v"]) / p["R"] - p["Fv"] * s["v"]},
        state_names=("v",),
        own_channels=Channels(inputs=("u",), outputs=("v",)),
        table={
            name: Parameter(value, free=True, lower=0.0) for name, value in {"K": 2.0, "R": 1.2, "Fv": 0.05}.items()
        },
    )
    inputs = np.repeat(np.random.default_rng(2).uniform(-6.0, 6.0, (20, 1)), 20, axis=0)
    log = Log.from_arrays("a", 0.02 * np.arange(400), inputs, np.zeros((400, 1)), motor)
    found = identifiability(motor, LogSet([log]), noise={"v": 0.01})
    assert found.rank == 2 and set(found.free_directions[0].change) == {"K", "R", "Fv"}
    assert abs(found.free_directions[0].change["K"]) < 0.05
    assert all(error == np.inf for error in found.std_errors.values())

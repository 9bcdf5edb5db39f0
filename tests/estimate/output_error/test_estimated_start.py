"""Held-out logs that start in motion: logs of the independent simulator, whose first seconds are cut off."""

import numpy as np
import pytest

pytest.importorskip("numba")
from jaxid import Axis, Log, LogSet, Pioneer, compare, output_error, simulate
from jaxid.estimate.output_error.estimated_start import estimated_start
from jaxid.explanation.left.heldout import held_out_state
from reference import excitation  # noqa: E402
from reference.axis import AXIS  # noqa: E402
from reference.logs import simulate as reference  # noqa: E402
from reference.pioneer import PIONEER  # noqa: E402

CUT = 310
MODEL = Axis().with_values(M=20.0, Fv=30.0, Fc=8.0, gain=10.0).change("gain", free=False)


def cut(robot, model, kind, seed, noise, parameters):
    """A log without its first seconds, and the true state [n] where it begins."""
    inputs = excitation.experiment(model.name, kind, 1001, seed)
    run = reference(robot.with_parameters(**parameters), inputs, 0.02, {}, rtol=1e-7, atol=1e-9)
    speeds = run.speeds + noise * np.random.default_rng(seed).standard_normal(run.speeds.shape)
    log = Log.from_arrays(kind, run.t[CUT:] - run.t[CUT], inputs[CUT:], speeds[CUT:], model.channels)
    return log, run.speeds[CUT], run.states[CUT]


@pytest.fixture(scope="module")
def axis():
    constants = {"J": 20.0, "k": 10.0, "Cv": 30.0, "Cs": 8.0}
    runs = [cut(AXIS, Axis(), kind, 40 + i, 0.01, constants) for i, kind in enumerate(("multilevel", "prbs_reversing"))]
    assert all(abs(speed.item()) > 0.1 for _, speed, _ in runs)
    return LogSet([log for log, *_ in runs]), np.array([speed.item() for _, speed, _ in runs])


def test_the_speed_at_the_start_is_known_better_than_by_one_sample(axis):
    logs, true = axis
    start = estimated_start(MODEL, logs, {"v": 0.01})
    np.testing.assert_allclose(start["v"], true, atol=0.01)  # a third of the noise each
    assert np.all(start["q"] == 0.0)
    assert held_out_state(MODEL, logs).adequate


def test_logs_at_rest_are_left_alone(axis):
    logs, _ = axis
    at_rest = []
    for log in logs:
        outputs = np.where(np.arange(len(log))[:, None] < 2, 0.0, log.outputs[:, :1])
        at_rest.append(Log.from_arrays(log.name, log.time, log.inputs, outputs, log.channels))
    start = estimated_start(MODEL, LogSet(at_rest), {"v": 0.01})
    assert all(np.all(values == 0.0) for values in start.values())


def test_a_comparison_says_so_and_reaches_the_noise(axis):
    logs, _ = axis
    fit = output_error(MODEL, logs)
    found = compare(fit, held_out=logs)
    assert sum("starts in motion" in note for note in found.notes) == 2
    assert found.predicted["output_error"].normalised_rms == pytest.approx(1.0, abs=0.04)


def test_a_caster_that_nobody_measured_is_put_where_the_motion_is_explained():
    """Half a turn from where it trails; what its exact angle is, the motion hardly says."""
    noise = {"eta1": 0.01, "eta2": 0.02}
    log, speeds, state = cut(PIONEER, Pioneer(), "prbs_reversing", 43, np.array(list(noise.values())), {})
    logs = LogSet([log])

    def error(start):
        residual = simulate(Pioneer(), logs, start=start)[0] - log.outputs
        return float(np.sqrt(np.mean((residual / list(noise.values())) ** 2)))

    true = {"eta1": speeds[:1], "eta2": speeds[1:], "beta": state[3:4]}
    assert error(true | {"beta": np.zeros(1)}) > 1.3
    assert error(estimated_start(Pioneer(), logs, noise)) < error(true) + 0.005

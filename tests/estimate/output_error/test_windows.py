"""Output error in windows: what a free simulation cannot follow, against the truth of SciPy's motion."""

import numpy as np
import pytest
from scipy.linalg import expm

from jaxid import (
    AXIS,
    Axis,
    Channels,
    Custom,
    Fit,
    Log,
    LogSet,
    Parameter,
    ParameterTable,
    compare,
    noise_level,
    output_error,
)
from jaxid.estimate.confidence.agreement import rms
from jaxid.estimate.output_error import output_error as module
from jaxid.estimate.output_error import windows
from jaxid.estimate.output_error.windows import Lost
from jaxid.explanation.explain import without_windows
from jaxid.explanation.left.heldout import held_out_state
from jaxid.logs.noise import third_differences, usual_size
from jaxid.logs.windows import in_windows

SAMPLES = 300


@pytest.fixture(scope="module")
def inverted(pendulum) -> LogSet:
    logs = [
        pendulum.recorded(
            f"{k}", pendulum.held(3.0, SAMPLES, 15, k), (np.pi, 0.0), controller=pendulum.upright, noise=0.002, seed=k
        )
        for k in range(3)
    ]
    return LogSet(logs)


@pytest.fixture(scope="module")
def fit(inverted, pendulum):
    return output_error(pendulum.robot(g=6.0, d=0.3, b=0.7), inverted[:2])


def test_an_unstable_plant_is_fitted_in_windows_and_the_result_says_so(fit, inverted, pendulum):
    assert fit.window is not None and fit.converged
    for name, truth in pendulum.truth.items():
        assert abs(fit[name].value - truth) < 4.0 * fit[name].std_error, name
        assert fit[name].std_error < 0.2
    assert fit.noise["q"] == pytest.approx(0.002, rel=0.1)
    assert "unstable" in fit.notes[0] and "windows" in fit.notes[0] and "closed loop" in fit.notes[0]
    assert set(fit.log_status) == set(inverted[:2].names)


def test_held_out_logs_are_predicted_in_the_same_windows(fit, inverted):
    found = compare(fit, held_out=inverted[2:])
    judged = found.predicted["output_error"]
    assert judged.normalised_rms == pytest.approx(1.0, abs=0.1)
    assert judged.simulated["2"].shape == (SAMPLES, 1)
    assert any("windows" in note for note in found.notes)


def test_windows_as_long_as_the_log_are_free_simulation_with_free_initial_states(pendulum):
    log = LogSet([pendulum.recorded("hanging", pendulum.held(1.0, SAMPLES, 25), d=2.0)])
    start = dict(g=8.0, d=1.5, b=0.9)
    free = output_error(pendulum.robot(), log, start=start, windows=None, initial_states="estimate")
    whole = output_error(pendulum.robot(), log, start=start, windows=100.0)
    for name in pendulum.truth:
        assert whole[name].value == pytest.approx(free[name].value, abs=0.02 * free[name].std_error)
        assert whole[name].std_error == pytest.approx(free[name].std_error, rel=0.02)


def dragged(pendulum, seed=20) -> tuple[np.ndarray, np.ndarray]:
    """Speed and position of a mass with nothing but cubic drag, in steps of 1 ms."""
    u, v, q = pendulum.held(2.0, SAMPLES, seed), np.zeros(SAMPLES), np.zeros(SAMPLES)
    for k in range(SAMPLES - 1):
        v[k + 1], q[k + 1] = v[k], q[k]
        for _ in range(20):
            v[k + 1] += 0.001 * (u[k] - 2.0 * v[k + 1] ** 3)
            q[k + 1] += 0.001 * v[k + 1]
    return v, q


@pytest.mark.parametrize("channels", ["v", "q", "vq"])
def test_a_plant_that_is_not_unstable_stays_free_though_its_model_is_wrong(pendulum, channels):
    """Windows would hide what is missing, whichever channels are measured: a position's errors grow, but not without
    bound for their size."""
    v, q = dragged(pendulum)
    outputs = {
        name: y + 0.002 * np.random.default_rng(k).normal(size=SAMPLES)
        for k, (name, y) in enumerate({"v": v, "q": q}.items())
        if name in channels
    }
    time, u = 0.02 * np.arange(SAMPLES), pendulum.held(2.0, SAMPLES, 20)
    logs = LogSet([Log.from_arrays("cubic drag", time, u, outputs, AXIS)])
    fit = output_error(Axis(), logs)
    assert fit.window is None
    assert max(fit.noise[name] for name in outputs) > 0.01
    if channels == "q":
        windowed = output_error(Axis(), logs, windows=0.2)
        free = without_windows(windowed, logs)
        assert windowed.window is not None and free.window is None and "hidden" in free.notes[-1]
        assert free.noise["q"] == pytest.approx(fit.noise["q"], rel=0.02)


def test_an_unstable_plant_keeps_its_windows_to_be_explained(fit, inverted):
    assert without_windows(fit, inverted[:2]) is fit


def test_windows_of_a_record_in_the_open_lead_on_to_the_free_fit_with_every_rescue(pendulum, monkeypatch):
    """From this start the free fit is lost, with errors that grow. One from the windows' parameters tells more than they do,
    and is not given up at its first minimum, as a record that its controller holds up would be: where that is poor
    (here: whenever somebody asks), other starts are still to be tried."""
    log = pendulum.recorded("over the top", pendulum.held(8.0, SAMPLES, 25, 5))
    after_windows = []

    def choose(robot, logs, once, start):
        def unlucky(window, start, unless=None):
            if window is None and isinstance(start, Fit):
                after_windows.append(start.window)
                if unless is not None:
                    raise Lost(10.0)
            return once(window, start, unless)

        return windows.choose(robot, logs, unlucky, start)

    monkeypatch.setattr(module, "choose", choose)
    fit = output_error(pendulum.robot(g=25.0, d=0.2, b=0.6), LogSet([log]))
    assert len(after_windows) == 1 and 0.0 < after_windows[0] < log.duration
    assert fit.window is None and fit.judgement.verdict == "sound"
    assert f"a fit in windows of {after_windows[0]:.3g} s led to" in fit.notes[-1]
    for name, truth in pendulum.truth.items():
        assert abs(fit[name].value - truth) < 4.0 * fit[name].std_error < 0.05, name


def _balancing(th, om, u, p):
    return {"th": om, "om": p["g"] * th - p["d"] * om + p["b"] * u}


@pytest.fixture(scope="module")
def restless() -> LogSet:
    """An unstable plant whose controller answers every sample, so that its own motion is as quick as noise; by exact steps."""
    g, d, b, dt = 36.0, 0.5, 4.0, 0.01
    A = np.array([[0.0, 1.0, 0.0], [g, -d, b], [0.0, 0.0, 0.0]])
    step = expm(A * dt)
    logs = []
    for seed in range(3):
        random, x, rows = np.random.default_rng(seed), np.array([0.05, 0.0]), []
        for _ in range(SAMPLES):
            u = -20.0 * x[0] - 4.0 * x[1] + 5.0 * random.normal()
            rows.append((u, x[1] + 0.03 * random.normal()))
            x = (step @ [*x, u])[:2]
        u, om = np.array(rows).T
        logs.append(Log.from_arrays(f"{seed}", dt * np.arange(SAMPLES), u[:, None], om[:, None], _BALANCE))
    return LogSet(logs)


_BALANCE = Channels(inputs=("u",), outputs=("om",))


def test_quick_motion_that_passes_for_noise_hides_no_lost_simulation(restless):
    table = ParameterTable({n: Parameter(v, free=True, lower=0.0) for n, v in (("g", 20.0), ("d", 1.0), ("b", 2.5))})
    robot = Custom(
        dynamics=lambda s, u, p: _balancing(s["th"], s["om"], u["u"], p),
        state_names=("th", "om"),
        own_channels=_BALANCE,
        table=table,
    )
    fit = output_error(robot, restless[:2])
    shown = np.concatenate([third_differences(log.output("om")) for log in restless[:2]])
    assert usual_size(shown) > 3 * 0.03 > noise_level(restless[:2])["om"] > 0.03  # differences show motion
    assert fit.window is not None and fit.noise["om"] == pytest.approx(0.03, rel=0.1)
    for name, truth in dict(g=36.0, d=0.5, b=4.0).items():
        assert abs(fit[name].value - truth) < 4.0 * fit[name].std_error, name
    # Each window's start is estimated, also where it looks like rest: the plant may lean.
    state = held_out_state(fit.robot, in_windows(restless[2:], fit.window))
    assert rms(np.concatenate([r[:, 0] for r in state.residuals])) * state.noise["om"] == pytest.approx(0.03, rel=0.15)
    # Held-out logs are judged by noise alone, too, and not by a motion that is as quick.
    (seen,) = compare(fit, held_out=restless[2:]).predicted.values()
    assert seen.normalised_rms == pytest.approx(1.0, abs=0.15)

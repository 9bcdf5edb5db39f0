"""jaxid/estimate/multi_start.py, and the rescue of a fit whose start leads nowhere: starts off by factors of ten."""

from dataclasses import replace
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import (
    Axis,
    Channels,
    Custom,
    Integrator,
    Log,
    LogSet,
    Parameter,
    Pioneer,
    integral_least_squares,
    multi_start,
    output_error,
    read_logs,
)
from jaxid.estimate.output_error.multi_start import _unlikelihood
from jaxid.estimate.output_error.rescue import one_astray
from jaxid.model_file import read_model

TRUE = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}
ROBOT = Axis().change("offset", free=False).with_values(**TRUE)
STEP = Integrator(2)


@pytest.fixture(scope="module")
def logs(axis_log):
    inputs = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 50)
    return LogSet([axis_log("a", inputs, noise=0.01, seed=4, position=False, **TRUE)])


def test_the_best_basin_is_found_and_the_stuck_one_is_told(logs):
    found = multi_start(ROBOT, logs, starts=32, integrator=STEP, seed=1)
    plain = output_error(ROBOT, logs, integrator=STEP)
    for name in TRUE:
        assert abs(found.fit[name].value - plain[name].value) < 0.05 * plain[name].std_error
    assert sum(basin.starts for basin in found.basins) + found.lost == 32
    assert found.basins[0].rise == 0.0 and found.share > 0.6
    rises = [basin.rise for basin in found.basins]
    assert rises == sorted(rises) and all(rise > 0.5 for rise in rises[1:])
    # With more dry friction than the input overcomes, nothing moves and nothing can be learned.
    assert any(basin.parameters["Fc"] > 4.0 for basin in found.basins[1:])
    assert f"{found.basins[0].starts} of 32 starts" in repr(found)


@pytest.mark.slow
def test_starts_of_a_robot_without_machine_code_are_fitted_where_no_initial_state_is_estimated():
    """Its program answers for all starts together; a log that begins at rest leaves no initial state to estimate."""
    robot = Custom(
        dynamics=lambda s, u, p: {"v": jnp.sort(jnp.stack([(u["u"] - p["drag"] * s["v"]) / p["mass"], 1e6]))[0]},
        state_names=("v",),
        own_channels=Channels(inputs=("u",), outputs=("v",), units={"u": "N", "v": "m/s"}),
        table={"mass": Parameter(2.0, "kg", free=True, lower=0.1), "drag": Parameter(4.0, "N s/m", free=True)},
    )
    u, v = np.repeat([0.0, 3.0, -2.0, 4.0], 25), np.zeros(100)
    for k in range(99):
        v[k + 1] = u[k] / 4.0 + (v[k] - u[k] / 4.0) * np.exp(-0.04)
    seen = v + 0.005 * np.random.default_rng(1).normal(size=100)
    logs = LogSet([Log.from_arrays("cart", 0.02 * np.arange(100), u[:, None], seen[:, None], robot)])
    with pytest.warns(UserWarning, match="sort"):
        found = multi_start(robot, logs, starts=4, integrator=STEP)
    assert found.fit["mass"].value == pytest.approx(2.0, abs=4 * found.fit["mass"].std_error)


def test_minima_are_compared_by_the_likelihood_whose_noise_each_leaves():
    """Two channels of 100 samples: one minimum leaves 1 and 1, the other 0.5 and 1.6 times the noise assumed: more by squares
    (140 against 100), and likelier by 100 log(0.5 1.6), whatever noise was assumed."""
    problem = SimpleNamespace(mask=np.ones((1, 100, 2), dtype=bool))
    left = np.array([[1.0, 1.0], [0.5, 1.6]])
    rises = []
    for assumed in (np.ones(2), np.array([0.1, 3.0])):
        squares = 100 * (left / assumed) ** 2
        optimum = SimpleNamespace(triangle=SimpleNamespace(squares=squares[:, None]), cost=0.5 * squares.sum(axis=1))
        found = _unlikelihood(problem, SimpleNamespace(optimum=optimum, sigma=np.tile(assumed, (2, 1))))
        rises.append(found[1] - found[0])
    assert rises == pytest.approx([100 * np.log(0.8)] * 2)


@pytest.mark.parametrize("wrong", [{"Fc": 5.0}, {"M": 10.0, "Fv": 0.2, "Fc": 0.05}, {"M": 0.1, "Fv": 20.0, "Fc": 5.0}])
def test_output_error_comes_back_from_a_model_off_by_ten(logs, wrong):
    said = []
    fit = output_error(ROBOT.with_values(**wrong), logs, integrator=STEP, report=said.append)
    plain = output_error(ROBOT, logs, integrator=STEP)
    for name in TRUE:
        assert abs(fit[name].value - plain[name].value) < 0.05 * plain[name].std_error
    if wrong["Fc"] > 4.0:  # the robot never moves there
        assert any("poor minimum" in sentence for sentence in said)


@pytest.fixture(scope="module")
def reversing(tmp_path_factory):
    """A Pioneer at 100 Hz whose caster, simulated with the nominal model, flips to the wrong side in one of three logs."""
    cases = pytest.importorskip("benchmarks.hidden.cases")
    folder = tmp_path_factory.mktemp("reversing")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "SAMPLING", 0.01)
        patch.setattr(cases, "SAMPLES", 2501)
        patch.setattr(cases, "CHECK", ())
        case = cases.make("pioneer", {}, 9001)
    _, _, model = case.write(folder)
    kinds = ("prbs_reversing", "turning", "crawl")
    logs = read_logs([f"{folder}/fit_{kind}.csv" for kind in kinds], robot="pioneer")
    return read_model(model, Pioneer()), logs, case


@pytest.mark.parametrize("linear", [pytest.param(False, id="nominal"), pytest.param(True, id="linear")])
@pytest.mark.slow
def test_a_caster_that_flips_in_one_log_is_fitted_right(reversing, linear):
    """Once from the nominal model, once from a fit that leads there (made up: the linear one does not)."""
    robot, logs, case = reversing
    start = integral_least_squares(robot, logs)
    if linear:
        start = replace(start, robot=robot)
        robot = robot.with_values(**{name: case.truth[name] for name in start.free_names})
    fit = output_error(robot, logs, start=start if linear else None)
    assert fit.noise["eta2"] == pytest.approx(case.noise[1], rel=0.05)
    for name in ("I0", "Cs", "Cv"):
        assert abs(fit[name].value - case.truth[name]) < 4 * fit[name].std_error


@pytest.mark.parametrize(
    ("squares", "astray"),
    [
        ([1.0, 1.0, 1.0], False),
        ([1.0, 1.0, 9.0], True),  # at three times the noise where the others are at it
        ([9.0, 9.0, 9.0], False),  # all of them: the model, not one log's minimum
        ([0.01, 0.01, 1.0], False),  # far above the others, and still noise
    ],
)
def test_one_log_far_above_the_others_is_a_reason_to_look_for_another_minimum(squares, astray):
    samples = 400
    assert one_astray(np.ones((3, samples, 1), dtype=bool), samples * np.array(squares)[:, None]) == astray

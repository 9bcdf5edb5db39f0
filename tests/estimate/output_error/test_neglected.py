"""Forces that a model lacks and whose mark stays in a residual that passes for noise: a drive integrated by SciPy."""

import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import kstest

from jaxid import Axis, Log, LogSet, output_error
from jaxid.estimate.output_error import neglected
from jaxid.estimate.output_error.neglected import _together

SAMPLES, DT, NOISE = 400, 0.05, 0.02
ROBOT = Axis().with_values(M=1.0, Fv=1.0, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)


def driven(drag=0.0, push=0.0, one_way=0.0, seed=0, colour=0.0, late=0, dead=0.0, noise=NOISE):
    """M = 1 kg, 1 N s/m, and what the model lacks: `drag` v |v|, a constant `push`, friction that is larger by a share
    `one_way` forwards and smaller by it backwards, inputs `late` by samples, or `dead` up to
    a force."""
    random = np.random.default_rng(seed)
    inputs = np.repeat(random.uniform(-3, 3, SAMPLES // 20), 20)
    v = [0.0]
    acting = np.append(np.full(late, 0.0), inputs)[:SAMPLES]
    acting = np.sign(acting) * np.maximum(np.abs(acting) - dead, 0.0)
    for u in acting[:-1]:
        found = solve_ivp(
            lambda t, x, u=u: u + push - x - (one_way + drag * x) * abs(x), (0, DT), v[-1:], rtol=1e-8, atol=1e-10
        )
        v.append(float(found.y[0, -1]))
    errors = random.normal(size=SAMPLES)
    for k in range(1, SAMPLES):
        errors[k] = colour * errors[k - 1] + np.sqrt(1 - colour**2) * errors[k]
    measured = np.array(v) + noise * errors
    return LogSet([Log.from_arrays("run", DT * np.arange(SAMPLES), inputs[:, None], measured[:, None], "axis")])


@pytest.mark.parametrize(
    ("hidden", "words"),
    [
        ({"drag": 0.02}, "the square of v"),
        ({"push": 0.012}, "a constant force on v"),
        ({"one_way": 0.008}, "one way than the other in v"),
    ],
)
def test_a_small_force_that_biases_the_estimates_is_named_and_the_bias_foretold(hidden, words):
    right, fit = output_error(ROBOT, driven()), output_error(ROBOT, driven(**hidden))
    assert right.judgement.verdict == "sound"
    # The residual is hardly above the noise, and white to every other test.
    assert fit.judgement.normalised_rms < 1.2 * right.judgement.normalised_rms and fit.judgement.white
    assert fit.judgement.verdict == "poor" and words in fit.judgement.sentence and fit.converged
    # What the sentence foretells: by how much the worst parameter is off.
    off = max(abs(fit[name].value - 1.0) / fit[name].std_error for name in ("M", "Fv"))
    if off > 2.0:
        text = fit.judgement.sentence.partition("would move by ")[2]
        assert float(text.split()[0]) == pytest.approx(off, rel=0.25, abs=1.0)


@pytest.mark.parametrize(
    ("hidden", "noise", "words"),
    [({"late": 1}, 0.4, "act later"), ({"dead": 0.3}, 0.3, "a dead zone of the inputs")],
)
def test_what_happens_to_commands_on_their_way_is_said_under_noise_that_hides_it(hidden, noise, words):
    fit = output_error(ROBOT, driven(**hidden, noise=noise))
    assert fit.judgement.normalised_rms < 1.05
    assert words in " ".join(fit.notes)


def test_noise_alone_white_or_not_bears_no_mark():
    for seed in range(5):
        assert "mark of" not in output_error(ROBOT, driven(seed=seed)).judgement.sentence
        assert "mark of" not in output_error(ROBOT, driven(seed=seed, colour=0.8)).judgement.sentence


@pytest.mark.parametrize("told", [1, 0])
def test_directions_of_less_than_no_variance_tell_nothing_and_end_no_fit(monkeypatch, told):
    """Autocovariances that are cut short may leave such ones, of which no eigenvalues can be had."""
    module = sys.modules["jaxid.estimate.output_error.neglected"]
    real = module._by_chance

    def short(problem, d):
        covariance = real(problem, d)
        covariance[told:, told:] = -1.0
        return covariance

    monkeypatch.setattr(module, "_by_chance", short)
    fit = output_error(ROBOT, driven(colour=0.8))
    assert fit.converged and ("mark of" in fit.judgement.sentence) == 0


def test_a_force_that_the_model_has_is_not_missed():
    fit = output_error(ROBOT.change("offset", free=True), driven(push=0.05))
    assert fit.judgement.verdict == "sound"
    assert fit["offset"].value == pytest.approx(-0.05, abs=5 * fit["offset"].std_error)  # a force that resists


def correlated(count=5, samples=400, seed=0):
    """Unit directions [samples, count] of which the last two are nearly one."""
    random = np.random.default_rng(seed)
    directions = random.normal(size=(samples, count))
    directions[:, -1] = directions[:, -2] + 0.05 * directions[:, -1]
    return directions / np.linalg.norm(directions, axis=0)


def test_all_directions_together_are_as_likely_as_said_in_noise():
    directions, random = correlated(), np.random.default_rng(1)
    covariance = directions.T @ directions
    p_values = [_together(directions.T @ random.normal(size=400), covariance, 0.0, 400) for _ in range(2000)]
    assert kstest(p_values, "uniform").pvalue > 0.001 and np.mean(np.array(p_values) < 0.01) < 0.02


def test_what_stands_out_in_none_of_two_like_directions_stands_out_in_both():
    directions = correlated()
    covariance = directions.T @ directions
    apart = directions[:, -1] - directions[:, -2]
    residual = 6.0 * apart / np.linalg.norm(apart)
    scores = directions.T @ residual
    assert np.abs(scores).max() < 1.0
    assert _together(scores, covariance, 0.0, 400) < 1e-4
    # What the simulation's own error may have done along it is no mark of anything.
    assert _together(scores, covariance, 6.0, 400) == 1.0


def by_position(seed, decimals):
    """Positions of a drive by a fine sensor, whose held inputs were logged with so many decimals."""
    rng, dt, logs = np.random.default_rng(seed), 0.02, []
    for k in range(2):
        acted = np.repeat(np.append(0.0, rng.uniform(-3, 3, 59)), 20)
        v, q, read = 0.0, 0.0, []
        for u in acted:
            read.append(q)
            q += u * dt + (v - u) * (1.0 - np.exp(-dt))
            v = u + (v - u) * np.exp(-dt)
        seen = np.array(read) + 3e-4 * rng.normal(size=len(acted))
        logged = np.round(acted, decimals)[:, None]
        logs.append(Log.from_arrays(f"run {k}", dt * np.arange(len(acted)), logged, {"q": seen}, "axis"))
    return LogSet(logs)


def test_what_rounding_of_the_logged_inputs_does_is_no_force(monkeypatch):
    """Four decimals of newtons leave a fifth of the noise in a position, along the directions of forces."""

    def marks():
        fits = [output_error(ROBOT, by_position(seed, 4), windows=None) for seed in range(5)]
        return sum("holds the mark" in fit.judgement.sentence for fit in fits)

    assert marks() == 0
    monkeypatch.setattr(neglected, "_PLAIN", 0.0)  # it would show
    assert marks() > 2


def counted(seed, step, drag=0.0):
    """Three logs of the counts, rounded down, of an axis that sticks (8 kg, 11 N s/m, 4 N), by 50 first-order steps a sample,
    which err by a small part of a count."""
    made, h = [], 4e-4
    for k in range(3):
        random, v, read = np.random.default_rng(100 * seed + k), 0.0, []
        inputs, q = np.repeat(random.uniform(-30, 30, 25), 20), random.uniform(0, step)
        for u in inputs:
            read.append(np.floor(q / step))
            for _ in range(50):
                free = v + h / 8.0 * (u - 11.0 * v - drag * v * abs(v))
                v = np.sign(free) * max(abs(free) - h * 4.0 / 8.0, 0.0)
                q += h * v
        counts = {"q": step * np.array(read)}
        made.append(Log.from_arrays(f"log {k}", 0.02 * np.arange(500), inputs[:, None], counts, "axis"))
    return LogSet(made)


@pytest.mark.parametrize(("seed", "step"), [(3, 0.002), (4, 0.002), (4, 0.005)])
def test_what_rounding_of_counts_could_be_bears_no_mark(seed, step):
    """Rounding stays what it is where the robot rests, and is no noise there: it had been friction that rises, or a dead zone
    with p = 1e-20, of logs from a simulator whose own steps err by less than a count."""
    robot = Axis().with_values(M=6.0, Fv=9.0, Fc=3.0, offset=0.0)
    fit = output_error(robot, counted(seed, step))
    assert fit.judgement.trustworthy and not any("mark of" in note for note in fit.notes)
    for name, truth in {"M": 8.0, "Fv": 11.0, "Fc": 4.0}.items():
        assert fit[name].value == pytest.approx(truth, rel=2e-3)
    assert not output_error(robot, counted(seed, step, drag=0.3)).judgement.trustworthy

"""Forces that a linear fit lacks and whose mark its equations do not show: a drive integrated by SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import Axis, Log, LogSet, integral_least_squares

SAMPLES, DT, NOISE = 400, 0.05, 0.02
ROBOT = Axis().with_values(M=1.0, Fv=1.0, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)


def driven(drag=0.0, push=0.0, one_way=0.0, seed=0, colour=0.0, moving=False):
    """M = 1 kg, 1 N s/m, and what the model lacks: `drag` v |v|, a constant `push`, or friction that is larger by a
    share `one_way` forwards and smaller by it backwards; a log may begin in motion."""
    random = np.random.default_rng(seed)
    inputs = np.repeat(random.uniform(-3, 3, SAMPLES // 20), 20)
    v = [1.5 if moving else 0.0]
    for u in inputs[:-1]:
        found = solve_ivp(
            lambda t, x, u=u: u + push - x - (one_way + drag * x) * abs(x), (0, DT), v[-1:], rtol=1e-8, atol=1e-10
        )
        v.append(float(found.y[0, -1]))
    errors = random.normal(size=SAMPLES)
    for k in range(1, SAMPLES):
        errors[k] = colour * errors[k - 1] + np.sqrt(1 - colour**2) * errors[k]
    measured = np.array(v) + NOISE * errors
    return LogSet([Log.from_arrays("run", DT * np.arange(SAMPLES), inputs[:, None], measured[:, None], "axis")])


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize(
    ("hidden", "words"),
    [
        ({"drag": 0.05}, "the square of v"),
        ({"push": 0.03}, "a constant force on v"),
        ({"one_way": 0.04}, "one way than the other in v"),
    ],
)
def test_a_force_that_biases_the_estimate_is_named_and_the_bias_foretold(hidden, words, moving):
    right, fit = (integral_least_squares(ROBOT, driven(**own, moving=moving)) for own in ({}, hidden))
    assert right.judgement is not None and fit.judgement is not None
    assert right.judgement.verdict == "sound"
    assert fit.judgement.normalised_rms < 1.2 * right.judgement.normalised_rms
    assert fit.judgement.verdict == "poor" and words in fit.judgement.sentence
    off = max(abs(fit[name].value - 1.0) / fit[name].std_error for name in ("M", "Fv"))
    if off > 2.0:
        text = fit.judgement.sentence.partition("would move by ")[2]
        assert float(text.split()[0]) == pytest.approx(off, rel=0.4, abs=1.5)


@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_noise_alone_white_or_not_bears_no_mark(colour):
    for seed in range(5):
        fit = integral_least_squares(ROBOT, driven(seed=seed, colour=colour))
        assert fit.judgement is not None and "mark of" not in fit.judgement.sentence


def test_a_force_is_named_where_it_is_much_of_what_is_left_too():
    fit = integral_least_squares(ROBOT, driven(drag=0.3))
    assert abs(fit["Fv"].value - 1.0) > 5.0 * fit["Fv"].std_error and fit.judgement is not None
    assert fit.judgement.verdict == "poor" and "the mark of drag that grows" in fit.judgement.sentence
    # What the parameters would do is known near the estimate alone.
    assert "would move" not in fit.judgement.sentence

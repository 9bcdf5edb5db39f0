"""Bounds that exclude the truth are said to, on the closed form of an axis' first-order answer."""

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, output_error

M, B, DT, HELD = 3.0, 4.0, 0.02, 15


@pytest.fixture(scope="module")
def logs():
    """M v' = u - B v under held forces, exactly, with noise."""
    rng, a = np.random.default_rng(8), np.exp(-B / M * DT)
    logs = []
    for k in range(2):
        u, v = np.repeat(rng.uniform(-30, 30, 20), HELD), [0.0]
        for force in u[:-1]:
            v.append(a * v[-1] + (1.0 - a) / B * force)
        noisy = np.array(v) + 0.01 * rng.standard_normal(len(v))
        logs.append(Log.from_arrays(f"log {k}", DT * np.arange(len(u)), u[:, None], noisy[:, None], Axis()))
    return LogSet(logs)


def axis(**bounds):
    robot = Axis().with_values(M=3.0, Fc=0.0).change("Fc", free=False).change("offset", free=False)
    for name, (lower, upper) in bounds.items():
        robot = robot.with_values(**{name: upper}).change(name, lower=lower, upper=upper)
    return robot


def test_a_bound_that_excludes_what_the_logs_say_is_doubted(logs):
    alone = output_error(axis(), logs)
    limit = B - 10.0 * alone["Fv"].std_error
    fit = output_error(axis(Fv=(0.0, limit)), logs)
    assert fit["Fv"].status == "at_bound" and fit["Fv"].value == limit and not fit.judgement.trustworthy
    (said,) = [sentence for sentence in fit.judgement.sentences if "bound of Fv" in sentence]
    value, error = (float(part) for part in said.split("say about ")[1].split(" N")[0].split(" ± "))
    assert value == pytest.approx(B, abs=4 * alone["Fv"].std_error)
    assert error == pytest.approx(alone["Fv"].std_error, rel=0.1)


def test_one_that_noise_alone_goes_beyond_is_not_spoken_of(logs):
    alone = output_error(axis(), logs)
    limit = alone["Fv"].value - 1.5 * alone["Fv"].std_error
    fit = output_error(axis(Fv=(0.0, limit)), logs)
    assert fit["Fv"].status == "at_bound" and fit.judgement.verdict == "sound"
    assert not any("bound" in note for note in fit.notes)

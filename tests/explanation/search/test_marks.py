"""What hardly changes a prediction and moves parameters by many standard errors is looked for, on logs of Euler's steps."""

from dataclasses import replace

import numpy as np

from jaxid import Axis, Log, LogSet, Policy, explain, output_error

M, FC, B, DT, FINE = 2.0, 1.0, 1.5, 0.02, 20


def logs(seeds, exponent, noise=0.05, n=1500):
    """M v' = u - B v |v|^(exponent - 1) - Fc sgn v, which sticks."""
    made = []
    for seed in seeds:
        rng, v, speeds = np.random.default_rng(seed), 0.0, []
        u = np.repeat(rng.uniform(-6.0, 6.0, n // 15), 15)
        for force in u:
            speeds.append(v)
            for _ in range(FINE):
                free = v + DT / FINE * (force - B * np.sign(v) * abs(v) ** exponent) / M
                v = np.sign(free) * max(abs(free) - DT / FINE * FC / M, 0.0)
        measured = np.array(speeds) + noise * rng.normal(size=n)
        made.append(Log.from_arrays(f"log {seed}", DT * np.arange(n), u[:, None], measured[:, None], Axis()))
    return LogSet(made)


class Searched(Exception):
    pass


def searches(fit, fitted, held_out):
    """Whether `explain` looks for anything where every gap up to a fifth of the noise is too small to matter."""

    def report(message):
        if message.startswith("held-out error"):
            raise Searched

    try:
        found = explain(fit, fitted, held_out, policy=Policy(negligible=1.2), report=report)
    except Searched:
        return True
    assert found.verdict == "adequate"
    return False


def test_a_force_that_moves_parameters_is_looked_for_where_predictions_hardly_change():
    """It was "nothing is missing that stands out", beside a dry friction 13 standard errors off."""
    fitted, held_out = logs(range(2), 0.6), logs(range(4, 6), 0.6)
    fit = output_error(Axis().with_values(M=3.0, Fv=1.0, Fc=0.5), fitted)
    assert fit.judgement.verdict == "poor" and abs(fit["Fc"].value - FC) > 5 * fit["Fc"].std_error
    told = {
        marked: searches(replace(fit, judgement=replace(fit.judgement, follows={}, marked=marked)), fitted, held_out)
        for marked in ((1.0, 0.0), (1e-4, 13.0), (1e-12, 1.0), (1e-12, 13.0))
    }
    assert told == {(1.0, 0.0): False, (1e-4, 13.0): False, (1e-12, 1.0): False, (1e-12, 13.0): True}


def test_a_complete_model_bears_no_mark():
    fit = output_error(Axis().with_values(M=3.0, Fv=1.0, Fc=0.5), logs(range(2), 1.0))
    assert fit.judgement.verdict == "sound" and fit.judgement.marked == (1.0, 0.0)

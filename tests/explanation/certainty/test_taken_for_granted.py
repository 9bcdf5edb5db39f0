"""jaxid/explanation/certainty/taken_for_granted.py: an axis in closed form, all of whose parameters are in proportion to its
gain."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import AXIS, Axis, Custom, LogSet, Parameter, output_error
from jaxid.explanation.certainty import taken_for_granted as under_test
from jaxid.explanation.certainty.taken_for_granted import taken_for_granted
from jaxid.logs import noise_scale
from jaxid.simulation.scaled import scaled_to
from tests.explanation.closed_form_axis import driven


def fitted(**fixed):
    logs, _ = driven(lambda u: u, 4, count=5)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0), logs).change("Fc", free=False)
    for name in fixed:
        robot = robot.change(name, free=False)
    return output_error(robot, logs), logs


def test_what_is_in_proportion_to_the_gain_is_said_with_a_gain_that_is_off():
    fit, logs = fitted()
    said = taken_for_granted(fit, logs, noise_scale(logs))
    assert said.startswith(
        "Errors of a per cent in the table, which these logs would not show, would move: with gain larger by 1 %, "
    )
    for name in ("M", "Fv"):
        assert f"{name} {1.01 * fit[name].value:.4g} instead of {fit[name].value:.4g} {fit[name].unit}" in said


def test_nothing_is_said_where_the_logs_would_show_it():
    """With the mass known, a gain that is off is seen."""
    fit, logs = fitted(M=1.0)
    assert taken_for_granted(fit, logs, noise_scale(logs)) == ""


def test_constants_beyond_those_that_are_listed_are_named():
    """Three constants of a cart, each of which a parameter makes up for, in another way."""

    def dynamics(state, inputs, p):
        resistance = (p["Fv"] + p["brush"]) * state["v"]
        return {"v": (p["gain"] * inputs["u"] - resistance) / (p["M"] + p["load"]), "q": state["v"]}

    free = {name: Parameter(value, unit, free=True, lower=0.0) for name, value, unit in
            (("M", 0.6, "kg"), ("Fv", 1.2, "N s/m"))}  # fmt: skip
    known = {"load": Parameter(0.4, "kg"), "brush": Parameter(0.8, "N s/m"), "gain": Parameter(1.0, "")}
    logs, _ = driven(lambda u: u, 4, count=5)
    fit = output_error(Custom(dynamics=dynamics, state_names=("v", "q"), own_channels=AXIS, table=free | known), logs)
    said = taken_for_granted(fit, logs, noise_scale(logs))
    listed = [name for name in known if f"with {name} " in said]
    (rest,) = set(known) - set(listed)
    assert len(listed) == 2 and said.endswith(f"; and so would, by more than standard errors say, errors of {rest}.")


def test_what_coloured_noise_hides_is_said(monkeypatch):
    """With the mass known a gain that is off is seen beside white noise, and not beside noise that is as slow as the motion."""
    fit, logs = fitted(M=1.0)
    rng, slow = np.random.default_rng(2), []
    for log in logs:
        noise = np.zeros(len(log))
        for k in range(1, len(log)):
            noise[k] = 0.97 * noise[k - 1] + 0.003 * rng.normal()
        slow.append(replace(log, outputs=np.asarray(log.outputs) + noise[:, None]))
    factors = []
    larger = under_test._larger_than_white

    def seen(*given):
        factors.append(larger(*given))
        return factors[-1]

    monkeypatch.setattr(under_test, "_larger_than_white", seen)
    assert taken_for_granted(fit, logs, noise_scale(logs)) == ""
    coloured = output_error(fit.robot, LogSet(slow))
    taken_for_granted(coloured, LogSet(slow), noise_scale(logs))
    white, slower = factors
    assert white == pytest.approx(1.0, abs=0.3) and slower > 20.0
    monkeypatch.setattr(under_test, "_larger_than_white", lambda *given: 1e6)
    assert "with gain larger by 1 %" in taken_for_granted(fit, logs, noise_scale(logs))

"""One log in which something happened, beside others that a complete robot explains: an axis in closed form."""

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.explanation.left.odd_logs import unlike_the_others

ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)


def recorded(pushed, law=lambda u: u, count=6):
    """Speeds of an axis; those in `pushed` were pushed from 5 s to 6.5 s, by a force that no log tells."""
    logs = []
    for k in range(count):
        rng = np.random.default_rng([81, k])
        u = np.repeat(rng.uniform(-4, 4, 60), 10)
        time = 0.02 * np.arange(len(u))
        force = law(u) + np.where((time > 5.0) & (time < 6.5), 1.5, 0.0) * (k in pushed)
        decay, v, found = np.exp(-2.0 * 0.02), 0.0, []
        for own in force:
            found.append(v)
            v = own / 2.0 + (v - own / 2.0) * decay
        outputs = {"v": np.array(found) + 0.003 * rng.normal(size=len(u))}
        logs.append(Log.from_arrays(f"run {k}", time, u[:, None], outputs, AXIS))
    return LogSet(logs[:-2]), LogSet(logs[-2:])


def dead(u):
    return np.sign(u) * np.maximum(np.abs(u) - 0.8, 0.0)


@pytest.fixture(scope="module")
def pushed_once():
    logs, held_out = recorded({1})
    return output_error(ROBOT, logs), logs, held_out


@pytest.mark.slow
def test_the_log_that_was_pushed_is_told_with_when(pushed_once):
    found = explain(*pushed_once)
    assert found.verdict == "unexplained" and not found.effects
    said = found.sentence
    assert said.startswith("All logs but one are explained by the robot as it is")
    assert "run 1 (" in said and not any(f"run {k}" in said for k in (0, 2, 3, 4, 5))
    begin, end = (float(word) for word in said.split("of it from ")[1].split(" s)")[0].split(" s to "))
    # The speed follows a force in half a second.
    assert begin == pytest.approx(5.0, abs=0.5) and end == pytest.approx(6.5, abs=0.5)


def test_of_a_held_out_log_too_and_of_no_others(pushed_once):
    fit, logs, held_out = pushed_once
    every = [*logs, *held_out]
    swapped = LogSet([every[k] for k in (0, 2, 3, 4)]), LogSet([every[k] for k in (1, 5)])
    said = unlike_the_others(output_error(ROBOT, swapped[0]), *swapped, ["run 1"])
    assert "on the other held-out logs" in said and "run 1 (" in said
    # Too many to be the odd ones; none left to judge on; one that is like the others.
    assert unlike_the_others(fit, logs, held_out, ["run 1", "run 2", "run 3"]) == ""
    assert unlike_the_others(fit, logs, held_out, ["run 4", "run 5"]) == ""
    assert unlike_the_others(fit, logs, held_out, ["run 1", "run 2"]) == ""


def test_where_the_others_lack_something_too_no_log_is_odd():
    logs, held_out = recorded({1}, dead)
    assert unlike_the_others(output_error(ROBOT, logs), logs, held_out, ["run 1"]) == ""

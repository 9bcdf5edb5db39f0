"""Naming from encoders alone, whose counts are what the logs hold: data of the independent simulator, whose friction sticks."""

import pytest

import jaxid
from tests.counted_runs import Hidden, logged, model

pytest.importorskip("numba", reason="the independent simulator needs numba")


def stribeck(amplitude):
    return Hidden(effects=(("stribeck_friction", (("amplitude", amplitude), ("speed", 0.05))),))


def explained(name, counts, hidden):
    logs, held_out = logged(name, counts, hidden)
    start = jaxid.integral_least_squares(model(name), logs)
    fit = jaxid.output_error(model(name), logs, start=start)
    return fit, jaxid.explain(fit, logs, held_out)


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("axis", 64),
        pytest.param("own drive", 4096, marks=pytest.mark.slow),
        pytest.param("omni", 2048, marks=pytest.mark.slow),
        pytest.param("pioneer", 512, marks=pytest.mark.slow),
    ],
)
def test_nothing_is_missing_in_a_complete_model(name, counts):
    fit, found = explained(name, counts, Hidden())
    assert fit.window is None and fit.trustworthy
    assert found.verdict == "adequate" and not found.effects


@pytest.mark.parametrize(
    ("name", "counts", "hidden", "effect"),
    [
        pytest.param("axis", 8192, Hidden(dead_zone=0.3), "actuator_dead_zone", marks=pytest.mark.slow),
        pytest.param("own drive", 2048, stribeck(1.5), "stribeck_friction", marks=pytest.mark.slow),
        pytest.param("pioneer", 2048, stribeck(0.4), "stribeck_friction", marks=pytest.mark.slow),
    ],
)
def test_what_is_hidden_is_named_and_closes_the_gap(name, counts, hidden, effect):
    """By hundreds of counts the incomplete model is off; it is neither taken for an unstable plant nor left so."""
    fit, found = explained(name, counts, hidden)
    assert fit.window is None and not fit.trustworthy
    assert found.verdict == "named" and [own.id for own in found.effects] == [effect]
    assert found.before.normalised_rms > 20 and found.after.normalised_rms < 1.15


@pytest.mark.slow
def test_a_delay_of_fine_counts_is_one_of_two_that_nothing_tells_apart():
    """Positions between samples are interpolated, by less than half of what 8,192 counts a turn round off."""
    _, found = explained("own drive", 8192, Hidden(delay=0.03))
    assert found.verdict == "ambiguous" and found.after.normalised_rms < 1.15
    (delay,) = found.effects
    assert {delay.id, *delay.equivalent_to} == {"input_delay", "sensor_delay"}

"""The numbers by which an explanation decides: few, in force only where they are asked for, and honest about nonsense."""

from dataclasses import fields, replace

import numpy as np
import pytest

from jaxid import Axis
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.policy import Policy, at_policy, current_policy, keeps_policy
from jaxid.explanation.refits.refit import Trial
from jaxid.explanation.search.telling_apart import not_told_apart, told_apart
from jaxid.explanation.search.worth import worth_it


def trial(residual, name=""):
    state = HeldOut(float(np.sqrt(np.mean(residual**2))), {"v": 1.0}, (residual[:, None],), {"v": 1.0}, 0.0)
    return Trial(name, Axis(), float(np.sum(residual**2)), 3, state, lambda: state, {})


def test_there_are_at_most_twenty_and_each_is_explained():
    names = [entry.name for entry in fields(Policy)]
    assert len(names) <= 20
    assert all(f"`{name}`" in (Policy.__doc__ or "") for name in names)


@pytest.mark.parametrize("value", [0, -1.0, float("nan"), "many", None])
def test_what_is_no_number_above_zero_is_refused(value):
    with pytest.raises(ValueError, match="Policy.many is .*; give a number above zero"):
        Policy(many=value)


def test_a_policy_holds_where_it_is_asked_for_and_nowhere_else():
    strict = Policy(separated=5.0)

    @keeps_policy
    def asked(*, policy=None):
        return current_policy().separated

    assert asked() == Policy().separated and asked(policy=strict) == 5.0
    with at_policy(strict):
        assert asked() == 5.0
    assert current_policy() == Policy()


def test_names_further_apart_than_asked_for_are_told_apart():
    noise = np.random.default_rng(1).normal(size=5000)
    best, other = trial(noise, "a"), trial(noise + 0.1 * np.random.default_rng(2).choice([-1.0, 1.0], size=5000), "b")
    other = replace(other, squares=best.squares)
    lead = told_apart(best.fitted, other.fitted)
    assert lead > 4.0
    assert not_told_apart([best, other]) == ()
    with at_policy(Policy(separated=2.0 * lead)):
        assert not_told_apart([best, other]) == ("b",)


def test_what_an_effect_must_close_follows_the_policy():
    noise = np.random.default_rng(1).normal(size=5000)
    wave = np.sin(np.arange(5000) / 40)
    before, after = trial(noise + 2.0 * wave), trial(noise + 1.8 * wave)
    assert worth_it(before, after, before, tried=10)
    with at_policy(Policy(least_gain=0.5)):
        assert not worth_it(before, after, before, tried=10)

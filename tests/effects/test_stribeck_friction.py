"""What is left of the excess by each formula, at shares of its speed."""

import math

import pytest

from jaxid import Axis
from jaxid.effects import effect_by_id


@pytest.mark.parametrize(
    ("law", "left"),
    [
        ("gaussian", lambda share: math.exp(-share * share)),
        ("exponential", lambda share: math.exp(-share)),
        ("lorentzian", lambda share: 1.0 / (1.0 + share * share)),
        ("hyperbolic", lambda share: 1.0 / (1.0 + share)),
        ("exponent_one_half", lambda share: math.exp(-math.sqrt(share))),
    ],
)
def test_the_excess_falls_off_as_its_formula_says_both_ways(law, left):
    effect = effect_by_id(Axis(), "stribeck_friction", law)
    axis = (Axis() + effect).with_values(Fc=2.0, **{effect.key("amplitude"): 3.0, effect.key("speed"): 0.1})
    numbers = {name: float(value) for name, value in axis.parameters.numbers.items()}
    for speed in (0.0, 0.03, 0.1, 0.4):
        for way in (1.0, -1.0):
            state = dict.fromkeys(axis.states, 0.0) | {"v": way * speed}
            ((backward, forward),) = axis.coulomb(state, numbers)
            assert float(forward) == float(backward) == pytest.approx(2.0 + 3.0 * left(speed / 0.1), abs=4e-3)

"""One log on which a caster swings round on the other side, and what stands out at all."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from jaxid.estimate.output_error.astray import past_the_astray, stands_out
from jaxid.estimate.output_error.problem import Unknowns


def left(*sizes, samples=400):
    """A problem and a minimum whose logs leave these residuals, in units of the noise."""
    problem = SimpleNamespace(mask=np.ones((len(sizes), samples, 2), dtype=bool))
    squares = samples * np.square(sizes)[:, None] * np.ones((1, 2))
    return problem, SimpleNamespace(triangle=SimpleNamespace(squares=squares))


@pytest.mark.parametrize(
    "sizes, worst",
    [
        ((1.0, 1.02, 1.3), 2),
        ((1.0, 1.02, 1.1), None),  # by chance, of so few samples
        ((1.5, 1.55, 1.52), None),  # as all others
        ((1.5, 2.0, 1.52), 1),
        ((1.0, 2.0), None),  # which of two?
    ],
)
def test_a_log_stands_out_by_more_than_chance_and_from_the_others(sizes, worst):
    assert stands_out(*left(*sizes)) == worst


def test_where_the_others_are_not_explained_none_is_the_only_one():
    assert stands_out(*left(1.5, 2.0, 1.52), others=1.1) is None
    assert stands_out(*left(1.0, 2.0, 1.05), others=1.1) == 1
    problem, optimum = left(1.0, 1.0, 2.0, 3.0)
    problem.mask[3] = False  # left out already
    assert stands_out(problem, optimum) == 2


@dataclass
class Masked:
    """A problem of which only the mask counts."""

    mask: np.ndarray


class Valley:
    """A cost of one parameter: each log wants it at one, and the third has a ridge at a half, beyond which it cannot see."""

    def __call__(self, problem, unknowns):
        x = float(unknowns.z[0])
        held = bool(problem.mask[2].any()) and x < 0.5
        return self.at(problem, 0.2 if held else 1.0, unknowns)

    def at(self, problem, x, unknowns):
        counted = problem.mask.sum(axis=(1, 2))
        sizes = np.array([1.0 + 0.02 * (1 - x), 1.0 + 0.02 * (1 - x), 1.5 if x < 0.5 else 1.0, 1.0])
        squares = (sizes**2 * counted / 2)[:, None] * np.ones((1, 2))
        found = SimpleNamespace(
            cost=0.5 * squares.sum(), diverged=False, unknowns=unknowns._replace(z=np.array([x])),
            triangle=SimpleNamespace(squares=squares),
        )  # fmt: skip
        return found


def test_the_minimum_beyond_is_found_without_the_log_that_holds():
    problem, valley = Masked(np.ones((4, 400, 2), dtype=bool)), Valley()
    first = valley(problem, Unknowns(np.array([0.0]), np.zeros((4, 1))))
    assert first.unknowns.z[0] == 0.2
    found = past_the_astray(problem, first, valley)
    assert found.unknowns.z[0] == 1.0 and found.cost < first.cost and problem.mask.all()
    assert past_the_astray(problem, found, valley) is found

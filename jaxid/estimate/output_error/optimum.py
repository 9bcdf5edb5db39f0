"""Where an optimisation stopped, and why."""

from enum import IntEnum
from typing import NamedTuple

from jaxtyping import Bool, Float, Int

from ..._arrays import AnyArray as Array
from ..._arrays import namespace
from .problem import Triangle, Unknowns


class Outcome(IntEnum):
    """Why an optimiser stopped. Only the first is a minimum."""

    OPTIMUM = 0
    NO_PROGRESS = 1
    STEP_LIMIT = 2
    DIVERGED = 3
    INSENSITIVE = 4

    @property
    def sentence(self) -> str:
        """In words, with what helps."""
        return _SENTENCES[self]


_SENTENCES = {
    Outcome.OPTIMUM: "converged: no step changes the fit noticeably any more",
    Outcome.NO_PROGRESS: (
        "no further progress: the sensitivities promise a lower cost, and no step finds it, as in a simulation that is not "
        "smooth in the parameters; try other start values or shorter logs"
    ),
    Outcome.STEP_LIMIT: "not converged within the steps allowed; start closer, free fewer parameters, or allow more steps",
    Outcome.DIVERGED: "the simulation diverges at the start values; check the logs' units and signs",
    Outcome.INSENSITIVE: (
        "not converged: no free parameter changes the simulation there, as when dry friction holds the robot still; give "
        "other start values"
    ),
}


class Optimum(NamedTuple):
    """Where an optimisation stopped. `triangle` is the linearisation at `unknowns`.

    `cost` is half the sum of squares there and `start_cost` at the start, `promise` the drop of the cost that the
    linearisation still promises, `outcome` an `Outcome`. In a fleet all have one lane a member.
    """

    unknowns: Unknowns
    triangle: Triangle
    cost: Float[Array, "*lanes"]
    iterations: Int[Array, "*lanes"]
    outcome: Int[Array, "*lanes"]
    start_cost: Float[Array, "*lanes"]
    promise: Float[Array, "*lanes"]

    @property
    def converged(self) -> Bool[Array, "*lanes"]:
        """Whether this is a minimum."""
        return self.outcome == Outcome.OPTIMUM

    @property
    def diverged(self) -> Bool[Array, "*lanes"]:
        """Whether the simulation is not finite even at the best point (of every lane)."""
        xp = namespace(self.triangle.squares)
        return ~xp.isfinite(self.triangle.squares).all(axis=(-2, -1))

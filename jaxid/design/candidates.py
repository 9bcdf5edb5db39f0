"""Candidate inputs of an experiment, and who judges them.

Every candidate is simulated with the robot's own parameters and with all of them off, up and down. The least information
of the three counts; a candidate is out where it breaks a limit with any of them, or where the outputs do not go where the
sensitivities say: its information is that of a linearisation which does not hold.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .information import Laboratory, Trials, criterion
from .limits import Limits, used

Array = NDArray[np.float64]
_MOST_BEND = 0.2
"""How far outputs may be from where the sensitivities put them, in units of the way from the nominal outputs."""


class Candidates(NamedTuple):
    """N inputs [N, T, nu] with their origins, scores [N] (-inf: not allowed) and information [N, 3, n, n]."""

    inputs: Array
    titles: tuple[str, ...]
    scores: Array
    information: Array

    def best(self, count: int) -> "Candidates":
        order = np.argsort(-self.scores, kind="stable")[:count]
        return Candidates(
            self.inputs[order], tuple(self.titles[i] for i in order), self.scores[order], self.information[order]
        )

    def with_others(self, other: "Candidates") -> "Candidates":
        return Candidates(
            np.concatenate([self.inputs, other.inputs]), (*self.titles, *other.titles),
            np.concatenate([self.scores, other.scores]), np.concatenate([self.information, other.information]),
        )  # fmt: skip


class Judge:
    """Scores candidates: the least log det over the three sets of parameters, with what is known already [3, n, n]."""

    def __init__(self, laboratory: Laboratory, limits: Limits):
        self.laboratory, self.limits, self.tried = laboratory, limits, 0

    def _shares(self, trials: Trials) -> dict[str, Array]:
        laboratory = self.laboratory
        return used(self.limits, laboratory.robot, trials.outputs, laboratory.interval)

    def _allowed(self, trials: Trials) -> NDArray[np.bool_]:
        """Which runs [N] stay finite and within the limits."""
        outputs = trials.outputs[..., : len(self.laboratory.robot.channels.outputs)]
        allowed = np.all(np.isfinite(outputs), axis=(1, 2))
        for share in self._shares(trials).values():
            allowed &= share <= 1.0
        return allowed

    def shares(self, inputs: Array) -> dict[str, Array]:
        """The largest share of each limit [N] over the three sets of parameters."""
        parts = [self._shares(self.laboratory.run(inputs, which)) for which in range(3)]
        return {name: np.max([part[name] for part in parts], axis=0) for name in parts[0]}

    def __call__(self, inputs: Array, titles: Sequence[str], base: Array, floor: float, most: int) -> Candidates:
        """Those of the candidates [N, T, nu] that are allowed and score more than `floor`, at most `most` of them.

        The score at the robot's own parameters is an upper bound of the least of the three, so the other two are looked
        at only for candidates that are good enough there.
        """
        own = self.laboratory.run(inputs)
        self.tried += len(inputs)
        scores = np.where(self._allowed(own), criterion(own.information + base[0]), -np.inf)
        order = np.argsort(-scores, kind="stable")[:most]
        order = order[scores[order] > floor]
        chosen = Trials(*(part[order] for part in own))
        up, down = (self.laboratory.run(inputs[order], which) for which in (1, 2)) if len(order) else (chosen, chosen)
        information = np.stack([chosen.information, up.information, down.information], axis=1)
        allowed = self._allowed(up) & self._allowed(down) & (self.laboratory.bend(chosen, up, down) <= _MOST_BEND)
        least = np.min(criterion(information + base), axis=1) if len(order) else np.zeros(0)
        origins = tuple(str(titles[i]) for i in order)
        found = Candidates(inputs[order], origins, np.where(allowed, least, -np.inf), information)
        kept = np.flatnonzero(found.scores > floor)
        return found.best(len(kept))

"""What a rival hands back from one fit."""

import time
from dataclasses import dataclass, field

import numpy as np


@dataclass
class Clock:
    """Processor seconds and cost of every iterate, from `Clock()` on."""

    begin: float = field(default_factory=time.process_time)
    seen: list[tuple[float, float]] = field(default_factory=list)

    def note(self, cost: float) -> None:
        """The solver stands at `cost` now."""
        self.seen.append((time.process_time() - self.begin, float(cost)))

    def lowest(self) -> list[tuple[float, float]]:
        """The path with the lowest cost so far in place of each cost (trial steps that went up come back)."""
        costs = np.minimum.accumulate([cost for _, cost in self.seen])
        return [(seconds, float(cost)) for (seconds, _), cost in zip(self.seen, costs, strict=True)]


@dataclass(frozen=True)
class Reached:
    """The point [7 + 3 E] in the common units, the solver's own count of linearisations, and why it stopped.

    `path`: (processor seconds, cost) along the way, where the solver shows it.
    """

    x: np.ndarray
    linearisations: int
    reason: str
    path: list[tuple[float, float]] = field(default_factory=list)

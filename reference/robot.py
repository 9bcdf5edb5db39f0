"""What the simulator needs to know of a robot."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Robot:
    """Equations and constants of one robot.

    :param dynamics: compiled right-hand side (signature `stick_slip.DYNAMICS`).
    :param parameters: constants in the papers' symbols, SI units; copied into the vector `p` in this order.
    :param n_states: length of the state; the pose comes first, the speeds are `first : first + len(speeds)`.
    :param filtered: index of the first state of the sensor filter (one per speed).
    :param n_axes: number of rubbing axes.
    :param n_forces: external generalised forces that follow the motor inputs in `u`.
    :param mass: parameter that a dropped payload lightens.
    :param initial: further states at the start, {index: value}.
    :param currents: optional function (states, inputs, parameters) -> (N, motors) of motor currents at the samples [A].
    """

    name: str
    dynamics: Callable
    parameters: dict[str, float]
    inputs: tuple[str, ...]
    speeds: tuple[str, ...]
    n_states: int
    first: int
    filtered: int
    n_axes: int
    n_forces: int
    mass: str
    initial: dict[int, float] = field(default_factory=dict)
    currents: Callable[..., np.ndarray] | None = None

    def with_parameters(self, **changes: float) -> "Robot":
        """The same robot with other constants. Raises ValueError for a name it does not have."""
        unknown = set(changes) - set(self.parameters)
        if unknown:
            raise ValueError(
                f"The robot '{self.name}' has no parameter {sorted(unknown)}; it has {', '.join(self.parameters)}."
            )
        return Robot(**{**self.__dict__, "parameters": {**self.parameters, **changes}})

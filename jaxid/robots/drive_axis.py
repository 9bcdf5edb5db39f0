"""An axis of a user's own robot, as effects see it."""

from collections.abc import Callable
from dataclasses import dataclass

from .effect import Numbers, Scalar, State


@dataclass(frozen=True)
class DriveAxis:
    """An axis on which something rubs or drives.

    - `speed`: the state that is its speed, or a function `(state, params) -> speed`.
    - `coulomb`, `viscous`: the parameters that are its Coulomb level and its viscous coefficient. The dynamics keep their
      own viscous term; naming the coefficient lets effects act on it, in whatever unit the dynamics have it.
    - `torque`: `(state, input, params) -> drive torque` as in the dynamics, which keep their own, too.
    - `angle`: the state that is its angle, or a name for it, if no state of the dynamics is.
    - `lever`: a number or the parameter (a radius) that turns its speed into one at the wheel's rim.
    - `driven`: False for an axis that only rubs, such as a caster's.
    """

    speed: str | Callable[[State, Numbers], Scalar]
    coulomb: str | None = None
    viscous: str | None = None
    torque: Callable[[State, State, Numbers], Scalar] | None = None
    angle: str | None = None
    lever: str | float = 1.0
    driven: bool = True

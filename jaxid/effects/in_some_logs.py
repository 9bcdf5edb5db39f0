"""What is there throughout some of the logs and not in the others: another load, battery or floor."""

from typing import ClassVar

from ..robots.effect import Effect, Numbers, Scalar, Scalars, State
from ..robots.robot import Robot


class InSomeLogs(Effect):
    """An effect of the logs whose column (`from_columns`, one) is 1, and not of those where it is 0 or missing: a state of that
    name, which stays as it begins."""

    law: ClassVar[str] = "in_some_logs"

    @property
    def column(self) -> str:
        """Name of the column."""
        return self.from_columns[0]

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return (self.own(self.column),)

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot) -> State:
        return {self.own(self.column): 0.0}

    def here(self, state: State) -> Scalar:
        """How much of it there is: one, or none."""
        return state[self.own(self.column)]

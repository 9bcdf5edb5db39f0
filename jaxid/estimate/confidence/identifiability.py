"""What logs can tell about a robot's parameters, from the sensitivities alone: before anything is fitted.

The model is simulated at the parameters it has and linearised. Directions in which the parameters can move without moving
the simulation are free: structurally if nothing could tell, practically if the noise hides it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..._arrays import array
from ..._float64 import in_float64
from ..._origin import Origin, with_origin
from ..._table import html_table, text_table
from ...logs import LogSet
from ...robots.given import given_logs
from ...robots.robot import Robot
from ..output_error.direct import linearised_now
from ..output_error.magnitudes import magnitudes
from ..output_error.setup import InitialStates, build
from ..result import Estimate
from ..uncertainty import PRACTICAL, RANK, combinations, spread

_TAKES_PART = 0.05
"""Share of a direction below which a parameter is left out of its description."""
_MOVES_AT_ALL = 1e-3
"""The same of a direction in which nothing at all shows: a parameter that moves with it however little is as open as those that
move most; less is rounding."""


@dataclass(frozen=True)
class FreeDirection:
    """A way in which parameters can change together and hardly show.

    `change` are relative changes (of length one all together), `std_error` how far the data let the parameters go that
    way, in units of `change` (infinite if structural). Knowing any one of them ends it; `decisive` is the one that takes
    part most.
    """

    kind: Literal["structural", "practical"]
    change: dict[str, float]
    std_error: float
    decisive: str

    @property
    def sentence(self) -> str:
        """The direction in words."""
        names = list(self.change)
        if len(names) == 1:
            what = "does not show at all" if self.kind == "structural" else "hardly shows"
            return f"{names[0]} {what} in these logs."
        largest = max(abs(v) for v in self.change.values())
        moves = ", ".join(f"{name} by {10 * v / largest:+.2g} %" for name, v in self.change.items())
        how = "nothing changes" if self.kind == "structural" else "hardly anything changes"
        return f"Move {moves}, and {how}; a value for {self.decisive} from elsewhere would settle it."


@dataclass(frozen=True, repr=False)
class Identifiability:
    """What the logs determine.

    - `std_errors`: expected standard error of each free parameter in its own unit, infinite where nothing determines it.
    - `rank` of the sensitivities and their `condition` number, columns scaled to the parameters' magnitudes.
    - `free_directions`, structural ones first, and the robot's `combinations` with the errors to expect.
    """

    values: dict[str, float]
    std_errors: dict[str, float]
    rank: int
    condition: float
    free_directions: tuple[FreeDirection, ...]
    combinations: dict[str, Estimate]
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def identifiable(self) -> bool:
        """Whether every free parameter can be estimated on its own."""
        return not self.free_directions

    def to_pandas(self) -> pd.DataFrame:
        """A row for every free parameter, then combination, by symbol: `value` and expected `std_error`, in its own unit."""
        rows = {name: (value, self.std_errors[name]) for name, value in self.values.items()}
        rows |= {name: (estimate.value, estimate.std_error) for name, estimate in self.combinations.items()}
        columns = ["value", "std_error"]
        return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("parameter")

    def _rows(self) -> list[tuple[str, str, str, str]]:
        rows = [("", "value", "expected std error", "of the value")]
        for name, value in self.values.items():
            error = self.std_errors[name]
            share = f"{100 * error / abs(value):.2g} %" if value and np.isfinite(error) else "-"
            rows.append((name, f"{value:.5g}", f"{error:.2g}", share))
        for label, estimate in self.combinations.items():
            rows.append((label, f"{estimate.value:.5g}", f"{estimate.std_error:.2g}", ""))
        return rows

    @property
    def sentence(self) -> str:
        """How much of the parameters these logs determine."""
        return f"{self.rank} of {len(self.values)} directions determined, condition number {self.condition:.2g}"

    def __repr__(self) -> str:
        return text_table(self._rows(), [self.sentence], [direction.sentence for direction in self.free_directions])

    def _repr_html_(self) -> str:
        return html_table(self._rows(), [self.sentence], [direction.sentence for direction in self.free_directions])


def _directions(
    jacobian: NDArray[np.float64], names: tuple[str, ...]
) -> tuple[list[FreeDirection], NDArray[np.float64]]:
    """Free directions of a whitened Jacobian [m, n] by relative changes, and all singular values [n]."""
    _, found, Vt = np.linalg.svd(jacobian, full_matrices=True)
    singular = np.zeros(len(names))
    singular[: found.size] = found
    free = []
    for value, direction in zip(singular, Vt, strict=True):
        structural = value <= RANK * max(singular.max(), 1e-300)
        if not structural and value * PRACTICAL > 1.0:
            continue
        leading = direction * np.sign(direction[np.argmax(np.abs(direction))])
        least = _MOVES_AT_ALL if structural else _TAKES_PART
        part = {n: float(v) for n, v in zip(names, leading, strict=True) if abs(v) > least}
        error = float("inf") if structural else float(1 / value)
        decisive = max(part, key=lambda n: abs(part[n]))
        free.append(FreeDirection("structural" if structural else "practical", part, error, decisive))
    return sorted(free, key=lambda direction: -direction.std_error), singular


@with_origin
@in_float64
def identifiability(
    robot: Robot,
    logs: LogSet,
    *,
    noise: Mapping[str, float] | None = None,
    initial_states: InitialStates = "auto",
) -> Identifiability:
    """What output error could learn about the free parameters of `robot` from `logs`; nothing is fitted.

    The sensitivities are those at the robot's own parameters under the logs' inputs, so that planned experiments (with any
    outputs) can be judged too. `noise` is the standard deviation by channel; by default the data's. Priors count as
    measurements. Raises `ParameterError` if no parameter is free.
    """
    logs = given_logs(robot, logs)
    structure, problem, unknowns = build(robot, logs, start={}, initial=initial_states)
    if noise is not None:
        sigma = [noise.get(name, float(problem.sigma[i])) for i, name in enumerate(logs.channels.measured)]
        problem = replace(problem, sigma=array(sigma))
    triangle = linearised_now(structure, problem, unknowns)
    slope = np.asarray(problem.bounds.slope(unknowns.z))
    jacobian = np.asarray(triangle.shared) / slope
    names = structure.names
    magnitude = magnitudes(problem, triangle, np.array([robot.parameters[name].value for name in names]))
    free, singular = _directions(jacobian * magnitude, names)
    found = spread(jacobian, np.ones(len(names), dtype=bool), magnitude)
    errors = np.sqrt(np.diag(found.covariance))
    unseen = {name for direction in free if direction.kind == "structural" for name in direction.change}
    values = {name: float(robot.parameters[name].value) for name in names}
    rank = sum(direction.kind != "structural" for direction in free) + int(np.sum(singular * PRACTICAL > 1.0))
    return Identifiability(
        values=values,
        std_errors={n: float("inf") if n in unseen else float(e) for n, e in zip(names, errors, strict=True)},
        rank=min(rank, len(names)),
        condition=float(singular.max() / singular.min()) if singular.min() > 0 else float("inf"),
        free_directions=tuple(free),
        combinations=combinations(robot, robot.parameters.numbers, names, found.covariance),
    )

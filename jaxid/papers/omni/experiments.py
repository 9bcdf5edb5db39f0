"""The omni paper's methods 1, 2 and 1+2 on logs: find the stretches that each may use, then estimate."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...logs import Log, LogError
from ...robots.omni import Omni
from ..paper_table import PaperTable
from .methods import Friction, Inertia, coast_down_friction, coast_down_inertia, steady_state_friction
from .printed import AXES, TABLE_1, TABLE_2, TABLE_3, TABLE_6, Axis
from .stretches import MOVING, SHORTEST, force_free_stretch, forces, speeds_of, steady_stretches

Array = NDArray[np.float64]
_PARTS = 8  # of a steady stretch, whose means count as independent


@dataclass(frozen=True)
class SteadyPoint:
    """One steady stretch, `start` to `stop` [s]: mean speed [m/s, rad/s] and force [N, N m] with standard errors."""

    log: str
    axis: Axis
    start: float
    stop: float
    speed: float
    speed_error: float
    force: float
    force_error: float


@dataclass(frozen=True, repr=False)
class SteadyState:
    """Method 1 on logs: steady points, the friction of each axis that moved, and `notes` on what was passed over."""

    points: tuple[SteadyPoint, ...]
    friction: Mapping[Axis, Friction]
    notes: tuple[str, ...] = ()

    @property
    def table_1(self) -> PaperTable:
        """Speeds and forces next to the paper's Table 1 (where it has that speed to 5 %)."""
        rows = []
        for point in self.points:
            printed = dict(zip(*TABLE_1[point.axis], strict=True))
            near = min(printed, key=lambda speed: abs(speed - abs(point.speed)))
            paper = printed[near] if abs(near - abs(point.speed)) < 0.05 * near else None
            rows.append((point.log, point.axis, point.speed, point.force, point.force_error, paper))
        columns = ("log", "axis", "speed [m/s, rad/s]", "force [N, N m]", "std error", "paper")
        return PaperTable("Steady speeds and forces (Table 1)", columns, tuple(rows), self.notes)

    @property
    def table_2(self) -> PaperTable:
        """Frictions next to the paper's Table 2."""
        return _friction_table("Frictions by method 1 (Table 2)", self.friction, TABLE_2)

    def __repr__(self) -> str:
        return "\n".join([repr(self.table_2), *self.notes])

    def _repr_html_(self) -> str:
        return self.table_2._repr_html_() + "".join(f"<p>{note}</p>" for note in self.notes)


@dataclass(frozen=True, repr=False)
class CoastDown:
    """Method 2 on logs: friction of V, Vn, J by methods 1+2, and each log's force-free stretch (axis, from, to [s])."""

    friction: Mapping[Axis, Friction]
    inertia: Inertia | None
    stretches: Mapping[str, tuple[Axis, float, float]] = field(default_factory=dict)

    @property
    def table_3(self) -> PaperTable:
        """Frictions and J next to the paper's Tables 3 and 6."""
        printed = {axis: values[2:] for axis, values in TABLE_3.items()}
        table = _friction_table("Frictions by method 2 (Table 3), J by methods 1+2 (Table 6)", self.friction, printed)
        if self.inertia is None:
            return table
        J = self.inertia.J
        row = ("J", J.value, J.std_error, J.unit, TABLE_6["Methods 1+2"])
        return PaperTable(table.title, table.columns, (*table.rows, row))

    def __repr__(self) -> str:
        return repr(self.table_3)

    def _repr_html_(self) -> str:
        return self.table_3._repr_html_()


def _friction_table(
    title: str, friction: Mapping[Axis, Friction], printed: Mapping[str, tuple[float, ...]]
) -> PaperTable:
    rows = []
    for axis, result in friction.items():
        for (name, e), paper in zip(result.estimates.items(), printed.get(axis, (None, None)), strict=True):
            rows.append((name, e.value, e.std_error, e.unit, paper))
    return PaperTable(title, ("symbol", "value", "std error", "unit", "paper"), tuple(rows))


def _mean(values: Array) -> tuple[float, float]:
    """Mean and its standard error from the means of eight parts: neighbours are alike, or opposite under control."""
    values = values[np.isfinite(values)]
    parts = [np.mean(part) for part in np.array_split(values, _PARTS)]
    return float(np.mean(values)), float(np.std(parts, ddof=1) / np.sqrt(_PARTS))


def method_1(logs: Iterable[Log], robot: Omni | None = None) -> SteadyState:
    """Method 1 (section 3.1) on omni logs: friction of every axis that was driven alone at two or more steady speeds.

    **Arguments:** `logs` of steady runs (transients may be in them); `robot` gives `l, Kt, r, b` (and the motor where
    no currents are logged). Raises `LogError` if no log holds a steady stretch in motion, or an axis has too few
    speeds.
    """
    points, notes = [], []
    for log in logs:
        acting, used = forces(log, robot), False
        for stretch in steady_stretches(log):
            speeds = [_mean(speeds_of(log)[stretch, j]) for j in range(3)]
            moving = [j for j in range(3) if abs(speeds[j][0]) > MOVING]
            start, stop = float(log.time[stretch.start]), float(log.time[stretch.stop - 1])
            if len(moving) == 1:
                j = moving[0]
                points.append(SteadyPoint(log.name, AXES[j], start, stop, *speeds[j], *_mean(acting[stretch, j])))
                used = True
            elif len(moving) > 1:
                axes = " and ".join(AXES[j] for j in moving)
                notes.append(f"{log.name}: {start:.4g}-{stop:.4g} s moves in {axes} at once and was passed over.")
        if not used:
            notes.append(f"{log.name}: no stretch of {SHORTEST} s or more at one steady speed of a single axis.")
    if not points:
        raise LogError(
            f"No log has a steady stretch of {SHORTEST} s or more in which one axis moves; hold each speed longer, "
            "one axis at a time."
        )
    friction: dict[Axis, Friction] = {}
    for axis in AXES:
        chosen = [point for point in points if point.axis == axis]
        if chosen:
            try:
                friction[axis] = steady_state_friction([p.speed for p in chosen], [p.force for p in chosen], axis)
            except ValueError as error:
                raise LogError(f"{error} (steady points of: {', '.join(p.log for p in chosen)})") from None
    return SteadyState(tuple(points), friction, tuple(notes))


def method_2(
    logs: Iterable[Log], first: SteadyState | None = None, robot: Omni | None = None, *, differentiate: bool = False
) -> CoastDown:
    """Method 2 (section 3.2) on coast-down logs: friction of V and Vn, and J by methods 1+2 from runs in W.

    **Arguments:** `first`, method 1's result, whose friction of W gives J; `robot` gives M; `differentiate=True` for
    the paper's Euler differences. Raises `LogError` where a log has no force-free stretch, or a run in W comes without
    `first`.
    """
    robot = Omni() if robot is None else robot
    runs: dict[Axis, list[tuple[Array, Array]]] = {}
    stretches: dict[str, tuple[Axis, float, float]] = {}
    for log in logs:
        axis, stretch = force_free_stretch(log, robot)
        time, speed = log.time[stretch], speeds_of(log)[stretch, AXES.index(axis)]
        there = np.isfinite(speed)
        runs.setdefault(axis, []).append((time[there], speed[there]))
        stretches[log.name] = (axis, float(time[0]), float(time[-1]))
    if not runs:
        raise LogError("Method 2 was given no logs; give at least one coast-down.")
    M = robot.parameters["M"].value
    friction: dict[Axis, Friction] = {
        axis: coast_down_friction(runs[axis], M, axis, differentiate=differentiate) for axis in AXES[:2] if axis in runs
    }
    inertia = None
    if "W" in runs:
        known = None if first is None else first.friction.get("W")
        if known is None:
            raise LogError(
                "The coast-down in W gives J only with the friction of W; give method 1's result as `first`."
            )
        inertia = coast_down_inertia(runs["W"], known, differentiate=differentiate)
    return CoastDown(friction, inertia, stretches)

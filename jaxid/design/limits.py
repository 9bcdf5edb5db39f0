"""What an experiment must keep to: input amplitudes, speeds, and the space it drives in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..logs import Channels
from ..robots.robot import Robot
from ..simulation.reckoning import readout, reckoned

Array = NDArray[np.float64]
_USED_UP = 0.97
"""Share of a limit above which it is said to bind."""


class DesignError(ValueError):
    """An experiment that cannot be designed; the message says why and what to change."""


@dataclass(frozen=True)
class Limits:
    """Limits of an experiment.

    - `inputs` [nu]: largest absolute value of each input, in its unit.
    - `outputs`: largest absolute value by channel, in the channels' units.
    - `rectangle`: (x, y) extent [m] of the floor, sides along and across the heading at the start; where in it the run
      starts is free. `radius` [m] around the start.
    """

    inputs: Array
    outputs: Mapping[str, float]
    rectangle: tuple[float, float] | None = None
    radius: float | None = None


def _each(limit: float | Sequence[float] | Mapping[str, float], names: tuple[str, ...]) -> Array:
    """One limit per input. Raises `DesignError`."""
    if isinstance(limit, Mapping):
        missing = [name for name in names if name not in limit]
        unknown = [name for name in limit if name not in names]
        if missing or unknown:
            raise DesignError(f"limit names {list(limit)}; give one number for each of the inputs {list(names)}.")
        limit = [limit[name] for name in names]
    values = np.atleast_1d(np.asarray(limit, dtype=float))
    if values.shape not in ((1,), (len(names),)):
        raise DesignError(
            f"limit holds {values.size} numbers; give one for all inputs, or one for each of {list(names)}."
        )
    return np.broadcast_to(values, (len(names),)).copy()


def make_limits(
    robot: Robot,
    limit: float | Sequence[float] | Mapping[str, float],
    speeds: Mapping[str, float] | None,
    rectangle: tuple[float, float] | None,
    radius: float | None,
) -> Limits:
    """Limits, checked. Raises `DesignError` for numbers that are not above zero, unknown channels and unknown paths."""
    channels = robot.channels
    inputs, outputs = _each(limit, channels.inputs), dict(speeds or {})
    for name in outputs:
        if name not in channels.measured:
            raise DesignError(f"speeds names {name!r}; use some of {', '.join(channels.measured)}.")
    numbers = {**{f"limit of {n}": v for n, v in zip(channels.inputs, inputs, strict=True)}, **outputs}
    if rectangle is not None:
        if len(rectangle) != 2:
            raise DesignError(f"rectangle holds {len(rectangle)} numbers; give its two extents in metres.")
        numbers |= {"first extent of the rectangle": rectangle[0], "second extent of the rectangle": rectangle[1]}
    if radius is not None:
        numbers["radius"] = radius
    for what, value in numbers.items():
        if not (np.isfinite(value) and value > 0):
            raise DesignError(f"The {what} is {value}; give a finite number above zero, or leave the limit out.")
    if (rectangle or radius) and path(robot, np.zeros((2, len(channels.measured))), 1.0) is None:
        raise DesignError(
            f"Where the robot {robot.name!r} drives does not follow from its outputs {', '.join(channels.outputs)}; "
            "leave rectangle and radius out, and limit its speeds instead."
        )
    if rectangle and len(channels.inputs) == 1:
        raise DesignError("A single axis has no rectangle to drive in; give radius, its largest way from the start.")
    return Limits(inputs, outputs, rectangle, radius)


def path(robot: Robot, outputs: Array, interval: float) -> Array | None:
    """Where a robot drives [..., T, 2] in m, from its outputs [..., T, ny]: x and y from the start, in the world of the
    robot's own heading (one that moves along a line has x only). None for a robot that does not say how it moves.
    """
    columns = {name: outputs[..., j] for j, name in enumerate(robot.channels.measured)}
    if not set(robot.velocities) <= set(columns):
        sensors = readout(robot)
        if sensors is None:
            return None
        seen = np.stack([columns[name] for name in sensors[0]], axis=-1)
        columns |= dict(zip(robot.velocities, np.moveaxis(seen @ sensors[1].T, -1, 0), strict=True))
    _, found = reckoned(robot, columns, np.full(outputs.shape[-2] - 1, interval))
    if found is None or found.shape[-1] == 2:
        return found
    return np.concatenate([found, np.zeros_like(found)], axis=-1)


def used(limits: Limits, robot: Robot, outputs: Array, interval: float) -> dict[str, Array]:
    """Share of each limit [...] that runs with outputs [..., T, ny] use; above one is too much, inputs apart."""
    shares = {}
    channels = robot.channels
    for name, largest in limits.outputs.items():
        shares[name] = np.max(np.abs(outputs[..., channels.measured.index(name)]), axis=-1) / largest
    if limits.rectangle or limits.radius:
        where = path(robot, outputs, interval)
        assert where is not None  # make_limits has seen to that
        if limits.rectangle:
            extent = np.max(where, axis=-2) - np.min(where, axis=-2)
            shares["rectangle"] = np.max(extent / np.asarray(limits.rectangle), axis=-1)
        if limits.radius:
            shares["radius"] = np.max(np.linalg.norm(where, axis=-1), axis=-1) / limits.radius
    return shares


def binding(limits: Limits, channels: Channels, inputs: Array, shares: Mapping[str, float]) -> tuple[str, ...]:
    """Which limits one run with inputs [T, nu] uses up, in words."""
    found = []
    for i, name in enumerate(channels.inputs):
        time = float(np.mean(np.abs(inputs[:, i]) >= _USED_UP * limits.inputs[i]))
        if time > 0:
            unit = channels.units.get(name, "")
            found.append(
                f"{name} is at its limit of {limits.inputs[i]:.4g} {unit}".rstrip() + f" for {time:.0%} of the time"
            )
    for name, share in shares.items():
        if share >= _USED_UP:
            found.append(f"{limit_in_words(limits, channels, name)} is used to {share:.0%}")
    return tuple(found)


def limit_in_words(limits: Limits, channels: Channels, name: str) -> str:
    """A limit by name with its size."""
    if name == "rectangle" and limits.rectangle:
        return "the floor of {:.4g} m by {:.4g} m".format(*limits.rectangle)
    if name == "radius":
        return f"the radius of {limits.radius:.4g} m"
    return f"the largest {name} of {limits.outputs[name]:.4g} {channels.units.get(name, '')}".rstrip()

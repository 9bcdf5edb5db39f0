"""The columns of the logs of a robot on wheels, and about how far each command drives each speed."""

from dataclasses import replace
from functools import lru_cache
from typing import Literal

import numpy as np

from ..logs import Channels
from .wheels import MOST_LAYOUTS, Wheel, rim_rows, twists

Shown = Literal["body", "wheels", "wheels and yaw rate"]
"""What the speeds in a log are of."""


@lru_cache(MOST_LAYOUTS)
def channels_of(wheels: tuple[Wheel, ...], motors: bool, shown: Shown, with_angles: bool) -> Channels:
    """Commands in volts of `motors` or in N m; the speeds that are `shown`; angles beside these or in their place."""
    inputs = tuple(dict.fromkeys(wheel.input for wheel in wheels))
    planar = len(twists(wheels)) == 3
    body = {"V": "m/s", "Vn": "m/s", "W": "rad/s"} if planar else {"v": "m/s", "w": "rad/s"}
    speeds = {f"speed_{wheel.name}": "rad/s" for wheel in wheels}
    turning = "W" if planar else "w"
    outputs = {"body": body, "wheels": speeds, "wheels and yaw rate": {**speeds, turning: body[turning]}}[shown]
    units = dict.fromkeys(inputs, "V" if motors else "N m") | outputs
    angles = tuple(f"angle_{wheel.name}" for wheel in wheels)
    pushed = _mixing(wheels, inputs, tuple(body))
    own = Channels(inputs=inputs, outputs=tuple(outputs), units=units, mixing={name: pushed[name] for name in outputs})
    if not with_angles:
        return own
    mixing = {angle: pushed[f"speed_{wheel.name}"] for angle, wheel in zip(angles, wheels, strict=True)}
    if shown == "body":
        return own.with_positions(angles, "rad", own.outputs, mixing)
    told = dict(zip(speeds, angles, strict=True))
    return replace(
        own,
        optional=angles,
        units={**own.units, **dict.fromkeys(angles, "rad")},
        mixing={**own.mixing, **mixing},
        substitutes=told,
    )


def _mixing(wheels: tuple[Wheel, ...], inputs: tuple[str, ...], body: tuple[str, ...]) -> dict[str, tuple[float, ...]]:
    """About how far each command drives each speed: those of the body, and of the wheels, for bodies that turn as easily as
    they move along."""
    rows = np.array(rim_rows(wheels))
    rows = rows / np.abs(rows).max(axis=0)
    of = np.array([[float(wheel.input == name) for name in inputs] for wheel in wheels])
    by_name = dict(zip(body, rows.T @ of, strict=True))
    by_name |= {f"speed_{wheel.name}": row for wheel, row in zip(wheels, rows @ rows.T @ of, strict=True)}
    return {name: tuple(np.where(np.abs(row) < 1e-9, 0.0, row).round(6).tolist()) for name, row in by_name.items()}

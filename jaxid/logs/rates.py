"""Speeds from measured positions, where the speed itself was not measured, and what that costs."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from .finding import LogError
from .noise import counting_step

Vector = Float[np.ndarray, " n"]


def _wrapped(angles: Vector) -> bool:
    """Whether an angle jumps by a turn at half a turn."""
    return bool(np.max(np.abs(angles)) < 3.2 and np.max(np.abs(np.diff(angles))) > np.pi)


def rate(time: Vector, positions: Vector, name: str, column: str, path: Path) -> tuple[Vector, str]:
    """Rates of change of the finite `positions` by central differences (second order, also at uneven `time` [s]), NaN at the
    first and the last, and a sentence without file and full stop that says what this does to the noise.

    Steps q of a counter, whose rounding errors have the variance q^2/12 and are independent of one another, become noise of
    q / (sqrt(6) 2 h) at samples h apart. Angles that jump at half a turn are unwrapped first. Raises `LogError` for fewer than
    three positions.
    """
    if len(positions) < 3:
        raise LogError(
            f"{path}: {column!r} has {len(positions)} position(s), too few to differentiate for {name!r}; map another one."
        )
    positions = np.unwrap(positions) if _wrapped(positions) else positions
    with np.errstate(all="ignore"):  # times that repeat are an error of their own
        speeds = np.gradient(positions, time)
    speeds[[0, -1]] = np.nan  # a one-sided difference there would be another, coarser sensor
    width = 2.0 * float(np.median(np.diff(time)))
    step = counting_step(positions)
    noise = f"its steps of {step:.3g} become noise of {step / np.sqrt(6.0) / width:.3g}" if step else "its noise grows"
    return speeds, (
        f"{name!r} is differentiated from the position {column!r} over {width:.3g} s, so that {noise}, related from sample to "
        "sample; map a measured speed if there is one"
    )

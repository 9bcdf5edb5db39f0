"""Which experiment would separate two names that the data so far leaves open."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .._atomic import replacing
from ..logs import Log, LogSet, signals
from ..robots.robot import Robot
from ..simulate.simulate import simulate

_DURATION = 20.0  # s
_LEVELS = (0.15, 0.4, 1.0)
"""Of the largest input seen in the logs."""
_FASTEST = 1.05
"""Of the fastest motion seen in the logs, which the simulated experiment must not exceed."""
_MODES = {
    "pioneer": {"straight": (1.0, 1.0), "on the spot": (1.0, -1.0), "in curves": (1.0, 0.5)},
    "omni": {
        "forwards": (0.0, -1.0, 0.0, 1.0),
        "sideways": (1.0, 0.0, -1.0, 0.0),
        "on the spot": (0.5, 0.5, 0.5, 0.5),
        "along and turning": (0.3, -0.7, 0.3, 1.0),
    },
}
"""Directions in which inputs can be driven."""


@dataclass(frozen=True)
class NextExperiment:
    """Inputs [T, nu] to drive, `separation`: RMS difference of the two models' outputs in units of noise."""

    between: tuple[str, str]
    description: str
    separation: float
    so_far: float
    time: NDArray[np.float64]
    inputs: NDArray[np.float64]
    input_names: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """What to do and what it would show."""
        one, other = (name.replace("_", " ") for name in self.between)
        return (
            f"Drive {self.description}: there the models with {one} and with {other} differ by {self.separation:.1f} "
            f"times the noise (RMS), against {self.so_far:.2f} on the held-out logs."
        )

    def save(self, path: str | Path) -> None:
        """Write the inputs as a log with time and input columns. Raises `OSError`."""
        table = pd.DataFrame({"t": self.time, **dict(zip(self.input_names, self.inputs.T, strict=True))})
        with replacing(path) as temporary:
            table.to_csv(temporary, index=False, float_format="%.6g", lineterminator="\n")

    def to_dict(self) -> dict[str, Any]:
        """For explanation.json."""
        return {
            "between": list(self.between),
            "description": self.description,
            "separation": self.separation,
            "so_far": self.so_far,
            "file": "next_experiment.csv",
            "sentence": self.sentence,
        }


def _shapes(interval: float) -> dict[str, NDArray[np.float64]]:
    """Signals of unit amplitude."""
    n = round(_DURATION / interval)
    bits = signals.prbs(7, 1.0, max(interval, 0.3), interval, seed=3)
    slow = signals.prbs(5, 1.0, max(interval, 1.2), interval, seed=2)
    shapes = {
        "a step forwards and back": signals.step_forward_and_back(1.0, 1.0, 8.0, 8.0, 3.0, interval),
        "a fast random binary sequence": bits,
        "a slow random binary sequence": slow,
        "a sweep from 0.1 to 3 Hz": signals.chirp(1.0, 0.1, 3.0, _DURATION, interval),
        "random levels": signals.multilevel([-1.0, -0.5, 0.2, 0.5, 1.0], 1.0, _DURATION, interval, 5),
        "one long run": signals.step(1.0, 0.5, _DURATION, interval),
    }
    return {name: np.resize(np.asarray(s, float).ravel(), n) for name, s in shapes.items()}


def _family(robot: Robot, logs: LogSet) -> list[tuple[str, NDArray[np.float64]]]:
    """Descriptions and inputs of drivable experiments."""
    names: tuple[str, ...] = tuple(logs.channels.inputs)
    interval = float(np.median([log.sampling_interval for log in logs]))
    largest = max(float(np.max(np.abs(log.inputs))) for log in logs)
    unit = logs.channels.units.get(next(iter(names)), "")
    plain: dict[str, tuple[float, ...]] = {
        name: tuple(float(i == k) for i in range(len(names))) for k, name in enumerate(names)
    }
    modes: dict[str, tuple[float, ...]] = _MODES.get(robot.name, plain) if len(names) > 1 else {"": (1.0,)}
    family: list[tuple[str, NDArray[np.float64]]] = []
    for mode, direction in modes.items():
        for shape, signal in _shapes(interval).items():
            for level in _LEVELS:
                where = f"{mode} with " if mode else "with "
                size = level * largest
                title = f"{where}{shape} at {size:.3g} {unit}".strip()
                family.append((title, size * signal[:, None] * np.array(direction)))
    return family


def propose(
    one: tuple[str, Robot], other: tuple[str, Robot], logs: LogSet, noise: dict[str, float], so_far: float
) -> NextExperiment | None:
    """The experiment of the family in which the two fitted models differ most, within the speeds seen so far.

    `so_far` is their RMS difference on the held-out logs in units of the noise. None if no drivable input tells more.
    """
    channels = logs.channels
    outputs = [c for c in channels.outputs if c in noise]
    columns = [channels.measured.index(c) for c in outputs]
    scale = np.array([noise[c] for c in outputs])
    family = _family(one[1], logs)
    interval = float(np.median([log.sampling_interval for log in logs]))
    time = np.asarray(np.arange(len(family[0][1])) * interval, np.float64)
    nothing = np.zeros((len(time), len(channels.measured)))
    runs = LogSet(
        [Log.from_arrays(f"run {i}", time, inputs, nothing, channels) for i, (_, inputs) in enumerate(family)]
    )
    first, second = simulate(one[1], runs), simulate(other[1], runs)
    fastest = [max(float(np.nanmax(np.abs(log.outputs[:, c]))) for log in logs) for c in columns]
    differences = _differences(first, second, columns, scale, np.array(fastest))
    best = int(np.argmax(differences))
    if differences[best] <= so_far:
        return None
    description, inputs = family[best]
    return NextExperiment(
        (one[0], other[0]), description, float(differences[best]), so_far, time, inputs, channels.inputs
    )


def _differences(
    first: Sequence[NDArray], second: Sequence[NDArray], columns: list[int], scale: NDArray, fastest: NDArray
) -> NDArray[np.float64]:
    """RMS difference of every run in units of noise; zero for runs that are too fast or diverge."""
    found = np.zeros(len(first))
    for i, (a, b) in enumerate(zip(first, second, strict=True)):
        y = a[:, columns]
        if (
            np.all(np.isfinite(a))
            and np.all(np.isfinite(b))
            and np.all(np.max(np.abs(y), axis=0) <= _FASTEST * fastest)
        ):
            found[i] = float(np.sqrt(np.mean(((y - b[:, columns]) / scale) ** 2)))
    return found

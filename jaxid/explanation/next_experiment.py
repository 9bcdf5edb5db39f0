"""Which experiment would separate two names that the data so far leaves open."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .._atomic import replacing
from ..estimate.confidence.agreement import counted_channels
from ..logs import Log, LogSet
from ..robots.effect import in_words
from ..robots.robot import Robot
from ..simulation.excitation import Drive, single_modes, tuned_shapes
from ..simulation.reckoning import measured_velocities
from ..simulation.simulate import integrator_for, simulate
from .policy import current_policy

_LEVELS = (0.15, 0.4, 1.0)
"""Of the largest input seen in the logs."""
_FASTEST = 1.05
"""Of the fastest motion seen in the logs, which the simulated experiment must not exceed."""

_FAR = 1000.0
"""Times the noise beyond which a difference of predictions is said to be large, and no more: one of the two ran away."""


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
        one, other = map(in_words, self.between)
        there = f"{self.separation:.1f}" if self.separation < _FAR else f"more than {_FAR:,.0f}"
        so_far = f"{self.so_far:.2f}" if self.so_far < _FAR else f"more than {_FAR:,.0f}"
        return (
            f"Drive {self.description}: there the models with {one} and with {other} differ by {there} times the noise (RMS), "
            f"against {so_far} on the held-out logs."
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


def _family(robot: Robot, logs: LogSet) -> list[Drive]:
    """Drivable experiments as long as those so far, with inputs as large."""
    interval = float(np.median([log.sampling_interval for log in logs]))
    largest = max(float(np.max(np.abs(log.inputs))) for log in logs)
    sizes = [level * largest for level in _LEVELS]
    duration = float(np.median([log.duration for log in logs]))
    return single_modes(robot, tuned_shapes(duration, interval, robot.scales.time), sizes)


def propose(
    one: tuple[str, Robot], other: tuple[str, Robot], logs: LogSet, noise: dict[str, float], so_far: float
) -> NextExperiment | None:
    """The experiment of the family in which the two fitted models differ most, within the speeds seen so far.

    `so_far` is their RMS difference on the held-out logs in units of the noise. None if no drivable input tells more, or
    none that lasts as long as the logs tells anything.
    """
    channels = logs.channels
    judged = dict.fromkeys(c for log in logs for c in counted_channels(log) if c in noise)
    columns = [channels.measured.index(c) for c in judged]
    scale = np.array([noise[c] for c in judged])
    family = _family(one[1], logs)
    interval = float(np.median([log.sampling_interval for log in logs]))
    time = np.asarray(np.arange(len(family[0].inputs)) * interval, np.float64)
    nothing = np.zeros((len(time), len(channels.measured)))
    runs = LogSet(
        [Log.from_arrays(f"run {i}", time, drive.inputs, nothing, channels) for i, drive in enumerate(family)]
    )
    # The same steps for both, so that these make no difference between them.
    steps = max((integrator_for(robot, runs) for _, robot in (one, other)), key=lambda own: own.substeps)
    first, second = (simulate(robot, runs, integrator=steps) for _, robot in (one, other))
    differences = _differences(first, second, columns, scale, _fastest(one[1], logs))
    best = int(np.argmax(differences))
    # A difference in which the likelihoods of the two would stay within chance tells nothing, however much more it is.
    enough = differences[best] ** 2 * len(time) * len(columns) >= (2.0 * current_policy().separated) ** 2
    if differences[best] <= so_far or not enough:
        return None
    drive = family[best]
    return NextExperiment(
        (one[0], other[0]), drive.description, float(differences[best]), so_far, time, drive.inputs, channels.inputs
    )


def _fastest(robot: Robot, logs: LogSet) -> dict[int, float]:
    """The largest value of each output, by its column, that the logs show, or say by the positions that stand in for it."""
    channels, found = logs.channels, dict[int, float]()
    for log in logs:
        speeds = measured_velocities(robot, log)
        for column, name in enumerate(channels.outputs):
            seen = log.output(name) if name in log.measured else speeds.get(name, log.output(name))
            if np.isfinite(seen).any():
                found[column] = max(found.get(column, 0.0), float(np.nanmax(np.abs(seen))))
    return found


def _differences(
    first: Sequence[NDArray], second: Sequence[NDArray], columns: list[int], scale: NDArray, fastest: dict[int, float]
) -> NDArray[np.float64]:
    """RMS difference of every run in units of noise; zero for runs that diverge, or are too fast by the largest speeds seen in
    the columns of `fastest`."""
    found = np.zeros(len(first))
    for i, (a, b) in enumerate(zip(first, second, strict=True)):
        apart = (a[:, columns] - b[:, columns]) / scale
        if (
            np.all(np.isfinite(a))
            and np.all(np.isfinite(b))
            and all(np.max(np.abs(a[:, c])) <= _FASTEST * top for c, top in fastest.items())
        ):
            found[i] = float(np.sqrt(np.mean(apart**2)))
    return found

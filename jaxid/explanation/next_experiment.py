"""Which experiment would separate two names that the data so far leaves open."""

from collections.abc import Callable, Sequence
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
from ..simulation.excitation import Drive, combined_modes, single_modes, tuned_shapes
from ..simulation.reckoning import measured_velocities
from ..simulation.simulate import integrator_for, simulate
from .policy import current_policy
from .refits.planned_runs import left_after_refit, left_by_refit
from .refits.refit import Trial
from .search.telling_apart import differ

_LEVELS = (0.15, 0.4, 1.0)
"""Of the largest input seen in the logs."""
_FASTEST = 1.05
"""Of the fastest motion seen in the logs, which the simulated experiment must not exceed."""
_DRIVEN = 0.1
"""Share of the fastest motion that inputs as large would make, below which the logs did not drive that way at all."""
_SURE = 5.0
"""Times the evidence that tells two models apart at least (`policy.separated`), which an experiment is to promise."""

_STEPPED = 60
"""Experiments in which the models as they are differ that one linear step of a refit is tried on, from all sizes of difference:
where a parameter ran away, all of the largest are alike."""
_CONFIRMED = 3
"""Experiments that are tried by a whole refit, the most promising by one linear step first."""
_FAR = 1000.0
"""Times the noise beyond which a difference of predictions is said to be large, and no more: one of the two ran away."""


@dataclass(frozen=True)
class NextExperiment:
    """Inputs [T, nu] to drive, `separation`: RMS difference in units of noise that the better of two refits would leave between
    the two models' outputs. `only_if`: the one of the two that has to be true for it, where the other can be made of it."""

    between: tuple[str, str]
    description: str
    separation: float
    so_far: float
    time: NDArray[np.float64]
    inputs: NDArray[np.float64]
    input_names: tuple[str, ...]
    only_if: str = ""

    @property
    def sentence(self) -> str:
        """What to do and what it would show."""
        one, other = map(in_words, self.between)
        there = f"{self.separation:.1f}" if self.separation < _FAR else f"more than {_FAR:,.0f}"
        so_far = f"{self.so_far:.2f}" if self.so_far < _FAR else f"more than {_FAR:,.0f}"
        told = f"Drive {self.description}: "
        if self.only_if:
            told += f"if it is {in_words(self.only_if)}, "
        return (
            f"{told}there the models with {one} and with {other} would still differ by {there} times the noise (RMS) after a "
            f"refit, against {so_far} on the held-out logs."
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
            "only_if": self.only_if,
            "file": "next_experiment.csv",
            "sentence": self.sentence,
        }


def _family(robot: Robot, logs: LogSet) -> list[Drive]:
    """Drivable experiments as long as those so far, every input as large as it was: directions of driving on their own, and
    what drives several of them."""
    interval = float(np.median([log.sampling_interval for log in logs]))
    largest = np.max([np.max(np.abs(log.inputs), axis=0) for log in logs], axis=0)
    duration = float(np.median([log.duration for log in logs]))
    shapes = tuned_shapes(duration, interval, robot.scales.time)
    family = single_modes(robot, shapes, _LEVELS, largest) + combined_modes(logs.channels, shapes, _LEVELS, largest)
    return [drive for drive in family if np.any(drive.inputs)]


@dataclass(frozen=True)
class _Planned:
    """Experiments of a family as each of two models makes them: `shown` [2, N, T, ny], by the model that is taken for true."""

    models: tuple[Trial, Trial]
    logs: LogSet
    family: Sequence[Drive]
    time: NDArray[np.float64]
    shown: NDArray[np.float64]

    def runs(self, places: Sequence[int], true: int) -> LogSet:
        """Some of the experiments as logs of the model that is taken for true."""
        channels = self.logs.channels
        return LogSet(
            [
                Log.from_arrays(f"experiment {i}", self.time, self.family[i].inputs, self.shown[true, i], channels)
                for i in places
            ]
        )

    def by_one_step(self, places: Sequence[int]) -> NDArray[np.float64]:
        """What one linear step of a refit of the other model would leave, for either that is true [2, places]."""
        noise = self.models[0].held_out.noise
        return np.array(
            [left_by_refit(self.models[1 - true], self.logs, self.runs(places, true), noise) for true in (0, 1)]
        )

    def after_refit(self, place: int) -> tuple[float, float]:
        """What a whole refit of the other model would leave of one experiment, for either that is true."""
        noise = self.models[0].held_out.noise
        one, other = (
            left_after_refit(self.models[1 - true], self.logs, self.runs([place], true), noise) for true in (0, 1)
        )
        return one, other

    def best(
        self, apart: NDArray[np.float64], least: float, of_two: Callable[..., Any]
    ) -> tuple[int, float, str] | None:
        """The place of the best of the experiments in which the models as they are differ by more than the `least` (`apart`, of
        each), what would be left there `of_two` refits, and which model has to be true for it, if one has to be."""
        places = [int(i) for i in np.argsort(-apart, kind="stable") if apart[i] > least]
        places = places[:: max(-(-len(places) // _STEPPED), 1)]
        left = of_two(*self.by_one_step(places)) if places else np.zeros(0)
        for k in np.argsort(-left, kind="stable")[:_CONFIRMED]:
            refitted = self.after_refit(places[k]) if left[k] > least else (0.0, 0.0)
            separation = float(of_two(*refitted))
            if separation > least:
                sure = min(refitted) > least
                return places[k], separation, "" if sure else self.models[int(np.argmax(refitted))].id
        return None


def propose(one: Trial, other: Trial, logs: LogSet) -> NextExperiment | None:
    """The experiment of the family that would tell most of the two models apart, within the speeds seen so far.

    What counts is what would be left of their difference once either is refitted to the logs so far and to what the other
    would show there: what a refit makes up for separates nothing, however far apart the two are as they stand. Where each
    experiment lets one of them be made the other, it is one that tells if the other is true (`only_if`). None if no
    drivable input would tell more than the held-out logs do, or none that lasts as long as the logs tells anything.
    """
    channels, noise = logs.channels, one.held_out.noise
    so_far = differ(one.held_out, other.held_out)
    judged = dict.fromkeys(c for log in logs for c in counted_channels(log) if c in noise)
    columns = [channels.measured.index(c) for c in judged]
    scale = np.array([noise[c] for c in judged])
    family = _family(one.robot, logs)
    if not family:  # no input was driven: how large one may be is not known
        return None
    interval = float(np.median([log.sampling_interval for log in logs]))
    time = np.asarray(np.arange(len(family[0].inputs)) * interval, np.float64)
    nothing = np.full((2, len(family), len(time), len(channels.measured)), np.nan)
    runs = _Planned((one, other), logs, family, time, np.zeros_like(nothing)).runs(range(len(family)), 0)
    # The same steps for both, so that these make no difference between them.
    steps = max((integrator_for(trial.robot, runs) for trial in (one, other)), key=lambda own: own.substeps)
    first, second = (np.asarray(simulate(trial.robot, runs, integrator=steps)) for trial in (one, other))
    shown = nothing
    shown[..., columns] = np.stack([first, second])[..., columns]
    planned = _Planned((one, other), logs, family, time, shown)

    fastest = _fastest(one.robot, logs)
    within = _differences(first, second, columns, scale, fastest)
    # Where logs never turned, say, an experiment that turns is no faster than they were.
    driven = {c: top for c, top in fastest.items() if top >= _DRIVEN * _possible(first[..., c])}
    further = np.where(within > 0, 0.0, _differences(first, second, columns, scale, driven))
    # Chance takes some of what is promised, and what two models' numbers cost some more.
    least = max(so_far, _SURE * current_policy().separated / np.sqrt(len(time) * len(columns)))
    # One model may be made the other, as a curve a straight line: then only one of the two answers is told.
    ways = ((apart, of_two) for of_two in (np.minimum, np.maximum) for apart in (within, further))
    found = next(filter(None, (planned.best(apart, least, of_two) for apart, of_two in ways)), None)
    if found is None:
        return None
    place, separation, only_if = found
    drive = family[place]
    return NextExperiment(
        (one.id, other.id), drive.description, separation, so_far, time, drive.inputs, channels.inputs, only_if
    )


def _possible(outputs: NDArray[np.float64]) -> float:
    """The largest value of an output that runs [N, T] reach, those that diverge apart."""
    finite = outputs[np.all(np.isfinite(outputs), axis=1)]
    return float(np.max(np.abs(finite))) if finite.size else 0.0


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
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    columns: list[int],
    scale: NDArray,
    fastest: dict[int, float],
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

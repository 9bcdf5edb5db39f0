"""What outputs that integrate are searched through: windows first, whole logs for every answer.

The error of a position is the sum of all errors before it. With something missing, a simulation of a whole log is soon so
far from the counts of an encoder, hundreds of their steps, that parameters bend to follow the drift and nothing is linear any
more: what explains a little of everything then comes before what is missing. In windows, each with an initial state of its
own, errors grow for the length of a window only (multiple shooting), and a first look sees the missing force where it acts.
But a window's initial state takes up what is slow, and windows cost less than whole logs do. So windows only lead there: all
models of one comparison are fitted to the same windows, and then all of them once more to the whole logs, where they are
ranked and judged.
"""

from collections.abc import Sequence
from dataclasses import replace

from ..logs import LogSet
from ..logs.windows import in_windows
from ..robots.robot import Robot
from ..simulation.scaled import scales_of
from .candidate_refits import Report
from .fine_steps import with_fine_steps
from .refit import Trial, continued, refit
from .steps import Step
from .telling_apart import alike, not_told_apart, supersets

_FAR, _NEAR = 5.0, 1.5
"""Residual of whole logs, in units of the noise, from which they are too far off to be searched, and of windows, down to which
there is something to search for in them."""
_TIMES, _SAMPLES = 5.0, 40
"""A window's length: at least so many time constants of the robot, and so many samples."""
_FEWEST = 4
"""Windows of a log below which they are no shorter than the log to speak of."""


def integrates(robot: Robot, logs: LogSet) -> bool:
    """Whether any of the outputs measured is a position."""
    places = {*robot.positions.values(), *robot.measured_angles, *logs.channels.positions}
    return any(name in places for log in logs for name in log.measured)


def search_length(robot: Robot, logs: LogSet) -> float | None:
    """The length [s] of windows to search in; None where the logs are too short for any."""
    scales = scales_of(robot, logs)
    seconds = max(_TIMES * scales.time, _SAMPLES * scales.interval)
    return seconds if min(log.duration for log in logs) >= _FEWEST * seconds else None


def windows_to_search(trial: Trial, logs: LogSet, held_out: LogSet) -> tuple[LogSet, LogSet] | None:
    """The logs in windows, where the whole ones are too far from what `trial` simulates to be searched; else None."""
    cut = any(log.cut for log in logs)
    if cut or not integrates(trial.robot, logs) or trial.fitted.normalised_rms < _FAR:
        return None
    seconds = search_length(trial.robot, LogSet([*logs, *held_out]))
    return None if seconds is None else (in_windows(logs, seconds), in_windows(held_out, seconds))


def left_over(trial: Trial) -> bool:
    """Whether a trial in windows leaves something that can be searched for in them."""
    return trial.fitted.normalised_rms > _NEAR


def _on(trial: Trial, states: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> Trial:
    """The model of a trial, refitted to these logs from its own values and from initial states of the trial `states`."""
    start = {name: trial.robot.parameters[name].value for name in trial.robot.parameters.free_names}
    again = refit(trial.robot, [start], logs, held_out, noise, states.initial_states)
    return continued(replace(again, id=trial.id), logs, held_out, noise)


def in_these(trial: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> Trial:
    """The model of a trial of whole logs, refitted to their windows."""
    return _on(trial, replace(trial, initial_states={}), logs, held_out, noise)


def on_whole_logs(
    steps: Sequence[Step], first: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float], say: Report
) -> list[Step]:
    """Steps that were found in windows, with every model of theirs refitted to the whole logs and ranked there. `first` is the
    model before them, of whole logs."""
    found, before = list[Step](), first
    for step in steps:
        again: dict[int, Trial] = {}
        every = {id(trial): trial for trial in (*step.trials, *step.laws)}
        for number, (key, trial) in enumerate(every.items(), start=1):
            say(f"refitting to whole logs with {trial.title}, {number} of {len(every)}")
            again[key] = with_fine_steps(_on(trial, first, logs, held_out, noise), logs, held_out, noise)
            say(f"{trial.title}: held-out {again[key].held_out.normalised_rms:.3f} x noise")
        trials = sorted((again[id(trial)] for trial in step.trials), key=lambda trial: trial.score)
        laws = sorted((again[id(trial)] for trial in step.laws), key=lambda trial: trial.score)
        if laws and laws[0].id == trials[0].id and laws[0].score < trials[0].score:
            trials[0] = laws[0]
        elif trials[0].id != step.chosen.id:
            laws = [trials[0]]
        equivalent = tuple(name for name in not_told_apart(trials) if name not in supersets(trials))
        same = tuple(trial.law for trial in alike(laws))
        found.append(Step(tuple(trials), equivalent, step.screened, before, trials[0], tuple(laws), same))
        before = trials[0]
    return found

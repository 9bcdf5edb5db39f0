"""The first look at what may be missing, of outputs that integrate in windows.

The error of a position is the sum of all errors before it. With something missing, a simulation of a whole log is soon so
far from the counts of an encoder, hundreds of their steps, that parameters bend to follow the drift and nothing is linear any
more: to first order, what explains a little of everything then promises more than what is missing. In short windows, each with
an initial state of its own, errors grow for the length of a window only (multiple shooting), and a first look sees the missing
force where it acts. But a window's initial state takes up what is slow, and costs in windows and of whole logs do not compare.
Where windows hide all that is missing, they are made longer.
So windows are for the first look, all candidates in the same ones: it says which are refitted and from where. Refits are made
to whole logs, where they are ranked and judged (`short_windows.py`).

A fit that does not follow its logs may have gone where nothing moves any more, such as to a mass that no motor turns, because
what is missing holds the robot still. Nothing is seen from there, and no few steps lead back: the look is then one from where
that fit began, too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...estimate.result import Fit
from ...logs import LogSet
from ...logs.windows import Windows
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..refits.candidate_refits import Report
from ..refits.refit import Trial, refit
from ..refits.short_windows import needs_the_past, windows_to_look_in
from .screen import Candidate, screen

_LONGER = 3.0
"""How much longer windows are in which something is seen, where nothing is in the shorter ones."""


def _from_there(candidate: Candidate, known: dict[str, float]) -> Candidate:
    """The candidate with further starts, from the parameters `known` of the fit in windows."""
    starts = (*candidate.starts, *({**known, **start} for start in candidate.starts))
    return replace(candidate, starts=starts, laws=tuple(_from_there(law, known) for law in candidate.laws))


def _rescaled(candidate: Candidate, scale: float) -> Candidate:
    """The candidate with its gain in units of another look, in which all that there is to explain is `scale`."""
    laws = tuple(_rescaled(law, scale) for law in candidate.laws)
    return replace(candidate, gain=candidate.share * scale, in_colour=candidate.share * scale, laws=laws)


def begun_at(fit: Fit) -> dict[str, float]:
    """The free parameters from which a fit began, as far as its origin tells; none where it does not."""
    arguments = fit.origin.arguments if fit.origin is not None else {}
    robot, start = arguments.get("robot"), arguments.get("start")
    if not isinstance(robot, Robot) or not set(fit.free_names) <= set(robot.parameters):
        return {}
    values = {name: robot.parameters[name].value for name in fit.free_names}
    given = start if isinstance(start, Mapping) else {}
    return values | {name: float(value) for name, value in given.items() if name in values}


def _from_the_start(
    found: list[Candidate],
    begun: dict[str, float],
    trial: Trial,
    logs: LogSet,
    effects: Sequence[Effect],
    noise: dict[str, float],
    report: Report,
) -> list[Candidate]:
    """The candidates with those of a look from the values `begun`: of each mechanism the one that promises the greater share of
    what there is to explain where it was looked for, and refits from there, too."""
    robot = trial.robot.with_values(**begun)
    others = [
        _from_there(own, begun) for own in screen(robot, logs, effects, noise, trial.initial_states, None, report)
    ]
    scale = max((c.gain / c.share for c in found if c.share > 0), default=0.0)
    best = {candidate.effect.id: _from_there(candidate, begun) for candidate in found}
    for other in others:
        known = best.get(other.effect.id)
        if scale and (known is None or other.share > known.share):
            best[other.effect.id] = _rescaled(other, scale)
    return sorted(best.values(), key=lambda candidate: -candidate.gain)


def first_look(
    trial: Trial,
    logs: LogSet,
    effects: Sequence[Effect],
    noise: dict[str, float],
    report: Report,
    begun: Mapping[str, float] | None = None,
    lost: bool = False,
) -> list[Candidate]:
    """Score `effects` that `trial` lacks, as `screen` does.

    `begun` are the values from which its fit began, such as those of a fit in windows. Windows are fitted from there, too, and
    where the fit was `lost`, the look is one from there besides.
    """
    found = _first_look(trial, logs, effects, noise, report, begun or {})
    return _from_the_start(found, dict(begun), trial, logs, effects, noise, report) if begun and lost else found


def _in_windows(robot: Robot, starts: Sequence[dict[str, float]], windows: Windows, noise: dict[str, float]) -> Trial:
    """`robot` refitted to the windows from the better of `starts`."""
    tried = [refit(robot, [start], windows, windows, noise, {}) for start in starts]
    return min(tried, key=lambda trial: trial.squares)


def _first_look(
    trial: Trial,
    logs: LogSet,
    effects: Sequence[Effect],
    noise: dict[str, float],
    report: Report,
    begun: Mapping[str, float],
) -> list[Candidate]:
    windows = windows_to_look_in(trial, logs)
    if windows is None:
        return screen(trial.robot, logs, effects, noise, trial.initial_states, trial.angles, report)
    report("whole logs are too far off for a first look; looking in windows of them")
    start = {name: trial.robot.parameters[name].value for name in trial.robot.parameters.free_names}
    starts = [start] if {**start, **begun} == start else [start, {**start, **begun}]
    there, longer = _in_windows(trial.robot, starts, windows, noise), 1.0
    # Windows whose own initial states take up all that is missing show nothing of it.
    while there.fitted.adequate and windows is not None:
        longer *= _LONGER
        windows = windows_to_look_in(trial, logs, longer)
        there = _in_windows(trial.robot, starts, windows, noise) if windows is not None else there
    if windows is None or there.fitted.diverged:
        return screen(trial.robot, logs, effects, noise, trial.initial_states, trial.angles, report)
    known = {name: there.robot.parameters[name].value for name in start}
    # The first look at what needs the past is one of whole logs.
    whole = [effect for effect in effects if needs_the_past(effect, trial.robot)]
    rest = [effect for effect in effects if effect.id not in {own.id for own in whole}]
    found = screen(there.robot, windows, rest, noise, there.initial_states, None, report) if rest else []
    found = [_from_there(candidate, known) for candidate in found]
    whole = [effect for effect in effects if effect not in rest]
    others = screen(trial.robot, logs, whole, noise, trial.initial_states, None, report) if whole else []
    # Promises of the two looks compare as shares of what there is to explain.
    scale = max((c.gain / c.share for c in found if c.share > 0), default=0.0)
    others = [_rescaled(candidate, scale) for candidate in others] if scale else others
    return sorted([*found, *others], key=lambda candidate: -candidate.gain)

"""Delays and lags that differ by what the motion does between two rows.

A sensor's law follows outputs between rows along parabolas, and a command that changes at a row bends them there. So the names
of what is late by less than some rows are told apart on logs with rows put between: the same inputs, nothing measured.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...effects.catalogue import laws_of
from ...logs import Log, LogSet
from ...logs.windows import Windows
from ...robots.effect import Effect
from ..policy import current_policy
from ..refits.candidate_refits import Report
from ..refits.refit import Trial, refit_from_itself
from .denser import bare_of
from .steps import Step
from .telling_apart import UNKNOWN_PAST, differ, not_told_apart, supersets

_PARTS = 4
"""Rows in the place of one."""
_NEAR = 0.3
"""Difference of two late models, as a share of what being late changes, up to which rows may hide which one is right."""


def _between(log: Log) -> Log:
    """`log` with rows put between its own."""
    rows = np.repeat(np.arange(len(log)), _PARTS)[: (len(log) - 1) * _PARTS + 1]
    share = np.arange(len(rows)) % _PARTS / _PARTS
    steps = np.append(np.diff(log.time), 0.0)
    outputs = np.where((share == 0.0)[:, None], log.outputs[rows], np.nan)
    extra = log.extra.iloc[rows].reset_index(drop=True) if len(log.extra.columns) else log.extra
    time = log.time[rows] + share * steps[rows]
    return replace(log, time=time, inputs=log.inputs[rows], outputs=outputs, extra=extra)


def with_rows_between(logs: LogSet) -> LogSet:
    """The logs with rows put between theirs, in which inputs are held and nothing is measured."""
    return LogSet(_between(log) for log in logs)


def _near(step: Step) -> list[Trial]:
    """The trials of what is late that do nearly what the best one does, that one first; none where that one is not late, or
    leaves so much that the motion between rows decides nothing."""
    best, base = step.chosen, step.before
    if not best.fitted.normalised_rms < current_policy().many:
        return []
    if best.effect is None or not best.effect.late or any(t.angles or t.in_colour is not None for t in (best, base)):
        return []
    whole = differ(best.fitted, base.fitted, UNKNOWN_PAST)
    late = (t for t in step.trials if t.id not in step.refused and t.effect is not None and t.effect.late)
    return [t for t in late if not t.angles and differ(best.fitted, t.fitted, UNKNOWN_PAST) < _NEAR * whole]


def _plainer(trial: Trial) -> list[Trial]:
    """The trial, and the same by the usual law of its mechanism where that has the same parameters."""
    assert trial.effect is not None
    bare = bare_of(trial.robot, trial.effect)
    usual: Effect = laws_of(bare, trial.id)[0]
    own = {n: p.value for n, p in trial.robot.parameters.items() if n.startswith(trial.effect.key(""))}
    if usual.law == trial.law or set(usual.parameters(bare)) != set(own):
        return [trial]
    return [trial, replace(trial, robot=(bare + usual).with_values(**own))]


def ranked_between_rows(step: Step, logs: LogSet, held_out: LogSet, noise: dict[str, float], say: Report) -> Step:
    """The step with those of its models that are late, and nearly alike, ranked by what they do between rows."""
    near = _near(step)
    if len(near) < 2 or isinstance(logs, Windows):
        return step
    say(f"telling {' and '.join(trial.id for trial in near)} apart by the motion between rows")
    fine, fine_held_out = with_rows_between(logs), with_rows_between(held_out)
    coarse: dict[int, Trial] = {}
    ranked: list[Trial] = []
    for trial in near:
        laws = _plainer(trial)
        again = [replace(refit_from_itself(own.robot, own, fine, fine_held_out, noise), id=trial.id) for own in laws]
        best = min(again, key=lambda own: own.score)
        coarse[id(best)] = laws[again.index(best)]
        ranked.append(best)
    ranked.sort(key=lambda own: own.score)
    first = coarse[id(ranked[0])]
    # Of what is told apart by nothing, the one that came first on the rows alone stays there.
    led = next(own for own in ranked if own.id == step.chosen.id)
    if led.id in not_told_apart(ranked):
        ranked = [led, *(own for own in ranked if own is not led)]
        first = step.chosen
    elif first not in step.trials:  # by another law than on the rows alone
        first = replace(refit_from_itself(first.robot, first, logs, held_out, noise), id=first.id)
    by_id = {trial.id: trial for trial in step.trials}
    order = [own.id for own in ranked[1:]]
    rest = (trial for trial in step.trials if trial.id != first.id and trial.id not in order)
    trials = (first, *(by_id[name] for name in order), *rest)
    alike = _alike(step, {trial.id for trial in near}, ranked, trials)
    found = replace(step, trials=trials, equivalent=alike, finer={own.id: own.score for own in ranked})
    if first.id == step.chosen.id and first.law == step.chosen.law:
        return found
    return replace(found, after=first, laws=(first,), laws_alike=())


def _alike(step: Step, late: set[str], ranked: Sequence[Trial], trials: Sequence[Trial]) -> tuple[str, ...]:
    """The ids not told apart from the first: of those that are late by `ranked`, of the others as they were."""
    others = [name for name in step.equivalent if name not in late]
    same = [name for name in not_told_apart(ranked) if name not in supersets(trials)]
    return (*same, *others)

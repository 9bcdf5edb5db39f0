"""Constants of the table that are wrong, or that would do what a named effect does if they were.

A mass, a gear ratio, a wheel radius or a supply voltage is taken as known; a wrong one, or two, are then named by what looks
the same, such as a sensor's scale. Where no name reaches the noise, few constants are tried in its place (`constants_instead`):
those whose changes, and changes of the fitted parameters with them, leave least of the residual to first order. Where one
does, it is asked whether constants change the simulation like it (`constants_like`).
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ...effects.catalogue import ALL
from ...effects.curve import SHAPE
from ...effects.table_constants import TableConstants
from ...logs import LogSet
from ...logs.windows import Windows
from ...parameters import ParameterError
from ...robots.effect import Effect
from ...robots.robot import Robot
from ...robots.traits import refusal
from ..policy import current_policy
from ..refits.refit import Trial, continued, refit_from_itself
from .constants_from_the_end import models_from_the_end
from .constants_to_first_order import MOST_SETS, TOGETHER, best_of, beyond, known_constants, likely, secants_of
from .telling_apart import told_apart_from

_BENT = 0.1
"""Share of what another candidate explains that constants may explain less, to first order, and are fitted all the same."""
_ALIKE = 0.2
"""Share of its size by which what several parts have alike may differ between them."""
_MOST_IN_WINDOWS = 16
"""Most constants that are fitted one by one in windows."""
_FARTHEST = 0.5
"""Share of their values by which no table has several constants wrong."""
_TWICE = 2.2
"""Factor by which no table has one wrong: a diameter for a radius, a half track for a track."""
_NONE = 1e-3
"""Share of its value by which a constant is as good as right: it is not what explains."""
BELIEVABLE = 0.15
"""Share by which a table may be wrong that is not asked for by a name: what is farther off stands in for something else, but
for one constant that leaves nothing."""
Shares = Mapping[str, float]


class Wrong(NamedTuple):
    """Constants of the table by the shares of their values that they would be wrong by, and the robot with them right."""

    shares: Shares
    robot: Robot


def constants_like(before: Trial, after: Trial, logs: LogSet, held_out: LogSet) -> list[Wrong]:
    """The constants of the table that explain what the last effect of `after` explains of `before`: each set of as few as do,
    fitted in its place, with the shares of their values by which they then change; those that do worse by more than chance,
    or by changes that no table is wrong by, are left out. An effect that is nothing but a constant of the table is that one,
    or a part of another that the table has none of."""
    meant = _meant(after.effect, before.robot) if after.effect is not None else ()
    if meant:
        shares = changed_by(meant, before.robot, after.robot.parameters)
        itself = [Wrong(shares, after.robot)] if max(map(abs, shares.values())) < _FARTHEST else []
        parts = _none_of(before.robot)
        return itself + [wrong for part in parts for wrong in _as_well(before, after, part, logs, held_out)]
    freed = {name for effect in after.robot.effects for name in effect.frees(after.robot)}
    constants = [name for name in known_constants(before.robot) if name not in freed]
    if not constants or before.fitted.diverged or after.fitted.diverged:
        return []
    if before.angles or after.angles:
        # To first order of whole logs nothing is known there.
        alone = [(name,) for name in constants[:_MOST_IN_WINDOWS]]
        return _as_good(alone if _alike_for_all(after) else [], before, after, logs, held_out)
    _, secants, changes = secants_of(before.robot, before.held_out.noise, [after.robot], constants, logs)
    own = secants[: -len(constants)]
    columns = dict(zip(constants, secants[-len(constants) :], strict=True))
    found: list[Wrong] = []
    while columns and not found:
        sets, twins = likely(own, columns, changes[0])
        failed: set[str] = set()
        too_far: set[str] = set()
        for chosen in sets:
            if found and len(chosen) > len(found[0].shares):
                break  # fewer do
            if len(chosen) == 1 and chosen[0] in failed:
                continue
            trial = _with_freed(before, chosen, logs, held_out)
            shares = changed_by(chosen, before.robot, trial.robot.parameters)
            if max(map(abs, shares.values())) < _NONE or told_apart_from(after, trial):
                failed |= set(twins[chosen[0]]) if len(chosen) == 1 else set()
            elif not (far := _too_far(shares, before.robot)):
                found.append(Wrong(shares, trial.robot))
            else:
                too_far |= far
        if not too_far:
            break
        # What those would have to be wrong by too much for, others may do by less.
        columns = {name: column for name, column in columns.items() if name not in too_far}
    return found


def constants_in_the_end(
    bare: Robot, after: Trial, logs: LogSet, held_out: LogSet, noise: Mapping[str, float]
) -> list[Wrong]:
    """The same, asked of the finished model `after`: constants that promise where all else is right to do what its effect does.
    `bare` is that model without it."""
    freed = {name for effect in after.robot.effects for name in effect.frees(after.robot)}
    constants = [name for name in known_constants(bare) if name not in freed]
    if not constants or after.angles or after.fitted.diverged or isinstance(logs, Windows):
        return []
    found: list[Wrong] = []
    for chosen, robot in models_from_the_end(bare, after, constants, noise, logs):
        if found and len(chosen) > len(found[0].shares):
            break
        if _too_far(changed_by(chosen, bare, robot.parameters), bare):
            continue
        try:
            trial = refit_from_itself(robot, after, logs, held_out, noise)
        except ParameterError:  # nothing follows the motion that these numbers make
            continue
        trial = continued(trial, logs, held_out, noise)
        shares = changed_by(chosen, bare, trial.robot.parameters)
        # With fewer numbers hardly anything is left either: what more of them gain may be a robot that is no model.
        left = max(trial.fitted.normalised_rms, trial.held_out.normalised_rms)
        enough = trial.free < after.free and left < current_policy().coarse_law
        if _may_be(shares, bare) and (enough or not told_apart_from(after, trial)):
            found.append(Wrong(shares, trial.robot))
    return found


def constants_as_well(before: Trial, after: Trial, logs: LogSet, held_out: LogSet) -> list[Wrong]:
    """Other sets of as many constants of the table that do what those do by which `after` differs from `before`."""
    own = after.effect.frees(before.robot) if after.effect is not None else ()
    freed = {name for effect in before.robot.effects for name in effect.frees(before.robot)}
    constants = [name for name in known_constants(before.robot) if name not in freed]
    if before.angles or before.fitted.diverged or after.fitted.diverged or not own:
        return []
    if isinstance(logs, Windows):
        sets = [(name,) for name in constants[:_MOST_IN_WINDOWS]] if len(own) == 1 else []
    else:
        _, secants, changes = secants_of(before.robot, before.held_out.noise, [after.robot], constants, logs)
        columns = dict(zip(constants, secants[-len(constants) :], strict=True))
        sets, _ = likely(secants[: -len(constants)], columns, changes[0])
    others = [names for names in sets if len(names) == len(own) and set(names) != set(own)]
    return _as_good(others, before, after, logs, held_out)[:MOST_SETS]


def _as_good(
    sets: Sequence[tuple[str, ...]], before: Trial, after: Trial, logs: LogSet, held_out: LogSet
) -> list[Wrong]:
    """Those of the sets of constants that do as well as `after` does, each fitted."""
    found = []
    for chosen in sets:
        trial = _with_freed(before, chosen, logs, held_out)
        shares = changed_by(chosen, before.robot, trial.robot.parameters)
        if _may_be(shares, before.robot) and not told_apart_from(after, trial):
            found.append(Wrong(shares, trial.robot))
    return found


def _alike_for_all(after: Trial) -> bool:
    """Whether the last effect has the same share for each of several parts, as a constant of all of them would make it."""
    effect = after.effect
    names = effect.either_nominal(after.robot) if effect is not None else {}
    shares = [after.robot.parameters[name].value for name in names]
    spread, size = max(shares, default=0.0) - min(shares, default=0.0), abs(sum(shares)) / max(len(shares), 1)
    return len(shares) > 1 and spread < _ALIKE * size


def _none_of(robot: Robot) -> tuple[str, ...]:
    """The constants of the table that are no part of their whole, and might be."""
    return tuple(n for n in robot.parts if robot.parameters[n].value == 0.0 and not robot.parameters[n].free)


def _as_well(before: Trial, after: Trial, constant: str, logs: LogSet, held_out: LogSet) -> list[Wrong]:
    """That constant in the place of the last effect of `after`, where it does what that does."""
    trial = _with_freed(before, (constant,), logs, held_out)
    shares = changed_by((constant,), before.robot, trial.robot.parameters)
    alike = not _too_far(shares, before.robot) and not told_apart_from(after, trial)
    return [Wrong(shares, trial.robot)] if alike else []


def _may_be(shares: Shares, robot: Robot) -> bool:
    """Whether each of the constants differs, and none by more than a table of the robot may be wrong by."""
    return min(map(abs, shares.values())) > _NONE and not _too_far(shares, robot)


def _too_far(shares: Shares, robot: Robot) -> set[str]:
    """Those of the constants of the robot's table that nobody's table has so wrong."""
    least, most = (1.0 / _TWICE - 1.0, _TWICE - 1.0) if len(shares) == 1 else (-_FARTHEST, _FARTHEST)
    parts = _none_of(robot)
    return {
        name for name, share in shares.items() if not (0.0 < share < 1.0 if name in parts else least < share < most)
    }


def _meant(effect: Effect, robot: Robot) -> tuple[str, ...]:
    """The constants of the robot's table that the effect frees, where it does nothing else; none where they are nothing."""
    table, freed = robot.parameters, effect.frees(robot)
    known = all(name in table and not table[name].free and table[name].value != 0.0 for name in freed)
    return tuple(freed) if known and not effect.parameters(robot) else ()


def effects_that_are(constants: Sequence[str], robot: Robot) -> tuple[str, ...]:
    """The ids of the catalogue's effects that are nothing but other values of just these `constants`: one model by two
    names."""
    meant = {effect.id: _meant(effect, robot) for effect in ALL if refusal(effect, robot) is None}
    return tuple(identifier for identifier, names in meant.items() if names and set(names) == set(constants))


def _alone_in_windows(before: Trial, constants: Sequence[str], logs: LogSet, held_out: LogSet) -> list[Trial]:
    """`before` with one of the constants right, each in turn: a window's own initial state takes up a part of what a constant
    does, and first order says little of the rest."""
    fitted = [((name,), _with_freed(before, (name,), logs, held_out)) for name in constants[:_MOST_IN_WINDOWS]]
    return [t for own, t in fitted if not _too_far(changed_by(own, before.robot, t.robot.parameters), before.robot)]


def _together(before: Trial, constants: Sequence[str], rival: float, logs: LogSet, held_out: LogSet) -> list[Trial]:
    """`before` with few of the constants right, ever more of them, as long as they may leave less than `rival`."""
    residual, secants, _ = secants_of(before.robot, before.held_out.noise, [], constants, logs)
    own, columns = secants[: -len(constants)], dict(zip(constants, secants[-len(constants) :], strict=True))
    names, directions, wanted, _ = beyond(own, columns, -residual)
    trials: list[Trial] = []
    for number in range(1, min(TOGETHER, len(names)) + 1):
        left, places = best_of(number, directions, wanted)
        chosen = tuple(names[k] for k in places)
        # To first order; what the fit finds may be less.
        if left > rival + _BENT * (before.squares - rival):
            continue
        trial, chosen = _needed(before, _with_freed(before, chosen, logs, held_out), chosen, logs, held_out)
        shares = changed_by(chosen, before.robot, trial.robot.parameters)
        alone = len(chosen) == 1 and trial.fitted.adequate
        if not (_too_far(shares, before.robot) if alone else max(map(abs, shares.values())) >= BELIEVABLE):
            trials.append(trial)
        if trial.fitted.adequate:
            break
    return trials


def constants_instead(before: Trial, best: Trial | None, logs: LogSet, held_out: LogSet) -> Trial | None:
    """`before` with few constants of the table right that explain more than the `best` effect does, by more than chance where
    that is a formula; of ever more of them, the number that the Bayesian criterion prefers. None where there are none."""
    constants = known_constants(before.robot)
    if not constants or before.angles or before.fitted.diverged:
        return None
    if isinstance(logs, Windows):
        trials = _alone_in_windows(before, constants, logs, held_out)
    else:
        rival = best.squares if best is not None else before.squares
        trials = _together(before, constants, rival, logs, held_out)
    found = min(trials, key=lambda trial: trial.score, default=None)
    if found is None or best is None:
        return found
    # A curve follows many things; constants that do as well are the simpler answer.
    better = found.score < best.score and (best.law == SHAPE or told_apart_from(found, best))
    return found if better else None


def changed_by(names: Sequence[str], robot: Robot, table: Mapping[str, Any]) -> Shares:
    """By which share of their values in `robot` constants differ in another table (of parameters, or estimates); parts of a
    whole that were none of it, by which share of it they are."""
    old = robot.parameters

    def share(name: str) -> float:
        if old[name].value:
            return float(table[name].value / old[name].value - 1.0)
        return float(table[name].value / table[robot.parts[name]].value)

    return {name: share(name) for name in names}


def _with_freed(before: Trial, names: Sequence[str], logs: LogSet, held_out: LogSet) -> Trial:
    """`before` refitted with these constants estimated."""
    robot = before.robot + TableConstants(tuple(names))
    return refit_from_itself(robot, before, logs, held_out, before.held_out.noise)


def _needed(
    before: Trial, trial: Trial, chosen: tuple[str, ...], logs: LogSet, held_out: LogSet
) -> tuple[Trial, tuple[str, ...]]:
    """The trial, with those of the `chosen` constants that it needs, by the Bayesian criterion: sets are chosen to first order,
    and where one of them bends, another may make up for that until it is fitted."""
    if len(chosen) == 1:
        return trial, chosen
    found = trial.robot.parameters
    for name in chosen:
        rest = tuple(own for own in chosen if own != name)
        robot = before.robot + TableConstants(rest)
        robot = robot.with_values(**{own: found[own].value for own in robot.parameters.free_names})
        fewer = refit_from_itself(robot, trial, logs, held_out, before.held_out.noise)
        if fewer.score < trial.score:
            return _needed(before, fewer, rest, logs, held_out)
    return trial, chosen

"""What changed between two sets of logs of one robot: a battery, a load, a floor, a tyre, a gear?

One model for both sets, of which one thing at a time may differ, is held against one in which nothing does. A change is said
where that is unlikely by chance for any of the candidates, all of which are counted; it is named where its candidate leaves no
more of the difference than two separate models would, and follows both sets alike.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from ..._compile import seldom_collected
from ..._distributions import chi_squared_beyond, chi_squared_tail, normal_beyond
from ..._float64 import in_float64
from ..._memory import bounded_memory
from ..._origin import with_origin
from ...effects.catalogue import check_mechanisms
from ...estimate.result import Estimate, Fit, checked_fit
from ...logs import LogError, LogSet
from ...parameters import ParameterError
from ...robots.effect import in_words
from ...robots.given import given_logs
from ..left.other_way import CHECK, other_way
from ..level import FALSE_ALARM, checked_level
from .beside import changed_beside
from .candidates import EACH, Side
from .change import ExplainedChange, Looked, Noticeable, Verdict
from .first_look import FirstLook, Score, first_look
from .in_both import constants_of_both, fitted_with, lacking_in_both
from .joint import SIDES, Colours, Joint, Pair, refit
from .judged import Worse, differ_at_all, follows_one_worse, noticed_from
from .named import named
from .noise_left import MOST
from .sides import SetOfLogs, side_of
from .trials import LEFT, HeldOutLogs, Trial, only_later, refitted, simplest_first, unlikely, with_a_number_more
from .what_else import as_well, promising_beside

_IN_BOTH = 3
"""Mechanisms that are added to both sets at most."""
_NO_MORE = 1.05
"""Times the noise, as it is known from the logs themselves, up to which nothing but noise is left of a set."""
_CLEAR, _NAMED = 4.0, 3
"""Standard errors from which another parameter of the two fits is said to differ, too, and how many of them are."""


def _checked(before: Fit, after: Fit) -> None:
    """Raise `ParameterError` where the two fits are not of one model."""
    if before.robot.structure != after.robot.structure:
        raise ParameterError(
            f"the two fits are of different models ({before.robot.name} and {after.robot.name}, or other effects); fit the "
            "same model to both sets of logs"
        )
    if before.free_names != after.free_names:
        raise ParameterError(
            f"the two fits estimate different parameters ({', '.join(before.free_names)}, and {', '.join(after.free_names)}); "
            "free the same ones in both"
        )
    for name, parameter in before.robot.parameters.items():
        other = after.robot.parameters[name].value
        if name not in before.free_names and parameter.value != other:
            raise ParameterError(
                f"the two fits take {name} for {parameter.value:g} and {other:g}: what is known to differ is no change to be "
                "found; give both the same value, or free it"
            )
    if (before.window is None) != (after.window is None):
        raise ParameterError("one fit is by free simulation, the other in windows; fit both with the same `windows=`")


def _two_sets(before: LogSet, after: LogSet) -> None:
    """Raise `LogError` where one log stands in both sets: its noise is then not by chance the same."""
    there = {log.sha256: log.name for log in before}
    both = [(there[log.sha256], log.name) for log in after if log.sha256 in there]
    if both:
        raise LogError(
            f"The log {both[0][0]!r} of before and the log {both[0][1]!r} of after hold the same numbers; give logs that were "
            "recorded before, and others that were recorded after."
        )


def _noticeable(look: FirstLook, pair: Pair, chance: float) -> tuple[Noticeable, ...]:
    """The smallest noticeable change of everything but the catalogue's mechanisms, causes first."""
    found: dict[str, Noticeable] = {}
    scores = {score.candidate: score for score in look.scores if score.own}
    # One axis of each, all else the same, is that axis alone, which is a candidate of its own.
    for candidate in (own for own in pair.own if own in scores and own.id != EACH):
        for c, size in zip(candidate.coordinates, noticed_from(scores[candidate], chance), strict=True):
            value = pair.robot.parameters[c.of].value if c.of else 0.0
            if np.isfinite(size) and c.name not in found:
                found[c.name] = Noticeable(candidate.id, candidate.title, c.name, float(size), c.unit, value)
    return tuple(found.values())


@with_origin
@in_float64
@bounded_memory()
@seldom_collected()
def explain_change(
    before: Fit,
    after: Fit,
    logs_before: LogSet,
    logs_after: LogSet,
    held_out_before: LogSet | None = None,
    held_out_after: LogSet | None = None,
    *,
    false_alarm: float = FALSE_ALARM,
    report: Callable[[str], None] = lambda message: None,
) -> ExplainedChange:
    """Say what changed between two sets of logs of one robot, given the output-error fit of each.

    Both fits are of the same model with the same free parameters. Candidates are every parameter of the robot, fixed or free;
    what one cause changes together (a payload, the gain of supply or driver, the friction of one drive axis or of all, the
    radius of one wheel); and every mechanism of the catalogue, which may have appeared or vanished. `false_alarm` is how often
    two sets between which nothing changed may be said to differ, by whichever candidate. With held-out logs of both sets, the
    change that was found on the fitted ones has to explain these, too. `report` is called with a sentence whenever something
    is done.

    Noise may be coloured, and other in one set than in the other. What scatters between the logs of one set beyond their noise
    widens what a change must exceed.

    Raises `ParameterError` for fits of different models and `LogError` for logs of another robot, or held-out logs of one set
    only; `ValueError` for a `false_alarm` that is no share below a half.
    """
    level = checked_level(false_alarm)
    _checked(checked_fit(before), checked_fit(after))
    check_mechanisms(before.robot)
    if (held_out_before is None) != (held_out_after is None):
        raise LogError("Held-out logs are given of one set only; give some of both, or none.")
    logs_before, logs_after = given_logs(before.robot, logs_before), given_logs(after.robot, logs_after)
    _two_sets(logs_before, logs_after)
    held_out = None
    if held_out_before is not None and held_out_after is not None:
        given = given_logs(before.robot, held_out_before), given_logs(after.robot, held_out_after)
        held_out = HeldOutLogs({"before": given[0], "after": given[1]})
    return _explained(before, after, (logs_before, logs_after), held_out, level, report)


def _explained(
    before: Fit,
    after: Fit,
    logs: tuple[LogSet, LogSet],
    held_out: HeldOutLogs | None,
    level: float,
    report: Callable[[str], None],
    lacked: tuple[str, ...] = (),
    gained: float = 0.0,
    freed: Mapping[str, float] = MappingProxyType({}),
) -> ExplainedChange:
    """`explain_change` of two fits to which what both sets lacked (`lacked`, mechanisms, of which one `gained` so much in
    chi-squared) has been added, and that estimate what both contradict of the table (`freed`, with its values)."""
    sides: dict[Side, SetOfLogs] = {"before": side_of(before, logs[0]), "after": side_of(after, logs[1])}
    pair = Pair.of(before.robot, before.free_names, sides)
    # What two poor fits leave is more than noise, and no change: one alone may lack just what has changed.
    poor = all(fit.judgement is not None and fit.judgement.doubt for fit in (before, after))
    known: dict[Side, Mapping[str, Mapping[str, float]]] = {
        "before": before.initial_states,
        "after": after.initial_states,
    }
    look = first_look(before.robot, pair, known, report, 1 if poor else MOST)
    report("first look: " + ", ".join(f"{s.candidate.title} {s.gain:.0f}" for s in look.scores[:5]))
    null, colours = refit(pair, None, look.colours, look.theta), look.colours
    by_name = min([1.0, *(s.p_value * look.tried for s in look.scores)])
    # By their covariances and by what two models leave: where one parameter hides behind others, either may be far off.
    separate = _separate(pair, after, colours)
    likelier = chi_squared_tail(null.squares - separate, len(pair.free))
    apart = max(differ_at_all(before, after), float(likelier))
    otherwise = min(2.0 * by_name, 4.0 * apart)
    worse = follows_one_worse(pair, null.residuals, slow=otherwise >= level)
    p = min(otherwise, 4.0 * worse.p_value, 1.0)
    trials: list[Trial] = []
    best, likeliest, equivalent, doubts, same = None, None, [], list[str](), list[Trial]()
    notes: tuple[str, ...] = (worse.noise,) if worse.noise and p >= level else ()
    # Less than the laws of what both sets lacked may be off is no change, whatever would explain it.
    differs = max([null.squares - separate, *(s.gain for s in look.scores)])
    if p < level and not differs < LEFT * gained:
        trials, likeliest, null, colours = refitted(pair, look, null, held_out, report)
        best, *equivalent = simplest_first(trials, null, poor)
        equivalent += only_later(best, [t for t in trials if all(t is not own for own in (best, *equivalent))], null)
        likely = [best, trials[0], *(trial for trial in trials if trial.score.own)][:3]
        constants = constants_of_both(pair, [trial.joint for trial in likely], colours)
        if constants is not None:
            names, joint = constants
            again = fitted_with(before, after, logs, names, joint)
            if again is not None:
                report(
                    f"both sets follow another {' and '.join(names)} than the table's; both fitted and compared with it"
                )
                wrong = {name: before.robot.parameters[name].value for name in names}
                return _explained(*again, logs, held_out, level, report, lacked, gained, {**freed, **wrong})
        lacking = lacking_in_both(pair, look, trials, null, best, colours, poor) if len(lacked) <= _IN_BOTH else None
        if lacking is not None:
            candidate, both = lacking
            said = f"{in_words(candidate.id)} explains more where both sets have it than any change does"
            again = fitted_with(before, after, logs, candidate, both) if len(lacked) < _IN_BOTH else None
            if again is not None:
                report(f"{said}; both fitted and compared with it")
                most = max(null.squares - both.squares, gained)
                return _explained(*again, logs, held_out, level, report, (*lacked, candidate.id), most, freed)
            doubts = [f"{said}: the model lacks it"]
        worse = follows_one_worse(pair, best.joint.residuals)
    rows = sum(int(own.there.sum()) for own in pair.sides.values())
    separate = _separate(pair, after, colours)
    if best is not None:
        columns = _columns(before, after, logs)
        left = best.joint.squares - separate
        # Beside what both sets lacked, how far its law is from nature's would pass for a second change, unless nothing is left.
        alone = not doubts and not columns and (not lacked or all(fit.trustworthy for fit in (before, after)))
        promising = promising_beside(look, best, colours, level) if alone and not poor else []
        if alone and (promising or _significant(left, level, len(pair.free))):
            ground = likeliest if promising and likeliest is not None else best
            beside = promising if ground is best else promising_beside(look, ground, colours, level)
            grounds = [(ground, beside)]
            if ground.score.candidate.side == "before":
                # What was taken from before has no other of its side beside it but such: beside what came, all the robot's own.
                own = next((trial for trial in trials if trial.score.own), None)
                grounds += [(own, promising_beside(look, own, colours, level))] if own is not None else []
            together, same = _together(pair, look, grounds, null, separate, colours, held_out, level, poor, report)
            if together:
                best, *equivalent = together
                worse = follows_one_worse(pair, best.joint.residuals)
                promising = promising_beside(look, best, colours, level) if not poor else []
        doubts += columns
        doubts += _doubts(best, null, separate, worse, by_name, level, held_out, colours, pair)
        explained = null.squares - best.joint.squares
        if promising and promising[0].gain > LEFT * explained:
            doubts.append(
                f"beside it {promising[0].candidate.title} would explain more (chi-squared {promising[0].gain:.0f}, of "
                f"{explained:.0f} that it gains)"
            )
        notes = _remainder(best, null, separate, level, before, after) if not doubts else ()
        if same and not doubts:
            twice = [named(pair, trial, rows, look) for trial in same]
            said = " or ".join(f"{own.words} ({own.sizes})" for own in twice)
            notes += (f"{said} would be the same in these logs, with a number more.",)
        others = as_well(look, best, colours) if not doubts else []
        if others:
            notes += (f"With {' or '.join(others)} changed as well these sizes would be others: the logs cannot tell.",)
    if best is not None and null.squares - best.joint.squares < LEFT * gained:
        best, equivalent, doubts, notes = None, [], [], ()
    verdict: Verdict = "unchanged"
    if best is not None:
        verdict = "unexplained" if doubts else "ambiguous" if equivalent else "named"
    gain = float("nan")
    if held_out is not None and best is not None:
        gain = _held_out_gain(pair, held_out, null, best.joint, colours)
    return ExplainedChange(
        verdict=verdict,
        change=named(pair, best, rows, look) if best is not None else None,
        equivalent=tuple(named(pair, own, rows, look) for own in equivalent) if not doubts else (),
        p_value=float(p),
        false_alarm=level,
        rms_unchanged=float(np.sqrt(null.squares / rows)),
        rms_separate=float(np.sqrt(separate / rows)),
        before=before,
        after=after,
        noticeable=_noticeable(look, pair, 0.5 * level / look.tried),
        unseen=look.unseen,
        looked=tuple(Looked(s.candidate.id, s.candidate.title, s.gain, s.p_value) for s in look.scores),
        held_out_gain=gain,
        doubts=tuple(doubts),
        notes=notes,
        lacked=lacked,
        freed=dict(freed),
        only_noise=best is not None and verdict != "unexplained" and _only_noise(pair, best.joint),
    )


def _only_noise(pair: Pair, joint: Joint) -> bool:
    """Whether a refit leaves no more of either set than its noise."""
    left = (joint.residuals[side][own.there] for side, own in pair.sides.items())
    return all(float(np.sqrt(np.mean(np.square(r)))) < _NO_MORE for r in left)


def _separate(pair: Pair, after: Fit, colours: Colours) -> float:
    """The whitened sum of squares that the two fits leave, each on its own logs."""
    total = 0.0
    for side in SIDES:
        own = pair.sides[side]
        change = {} if side == "before" else {n: after.robot.parameters[n].value for n in pair.free}
        r = own.simulated(pair.robot, [change], own.nothing_moved)[0] - own.observed
        total += float(np.sum(own.whiten(r, colours[side]) ** 2))
    return total


def _held_out_gain(pair: Pair, held_out: HeldOutLogs, null: Joint, joint: Joint, colours: Colours) -> float:
    one, other = (held_out.residuals(pair, own, colours) for own in (null, joint))
    return float(sum(np.sum(a**2) - np.sum(b**2) for a, b in zip(one, other, strict=True)))


def _columns(before: Fit, after: Fit, logs: tuple[LogSet, LogSet]) -> list[str]:
    """That columns of one of the sets contradict the model of the other by their sign or unit: no change of the robot's."""
    said = other_way(before, logs[0]), other_way(after, logs[1], first=before.robot)
    return [
        f"in the logs {side} {text.removeprefix(CHECK).strip(': .')}"
        for side, text in zip(SIDES, said, strict=True)
        if text
    ]


def _together(
    pair: Pair, look: FirstLook, grounds: list[tuple[Trial, list[Score]]], null: Joint, separate: float, colours: Colours,
    held_out: HeldOutLogs | None, level: float, poor: bool, report: Callable[[str], None],
) -> tuple[list[Trial], list[Trial]]:  # fmt: skip
    """What changed beside the best candidate (the first of the `grounds`, each with what is promising beside it), and what
    these logs cannot tell from the two; empty where no two do as well as separate models, or better than one on logs that
    chose nothing. With it those of two that say the same by a number more."""
    best = grounds[0][0]
    found = changed_beside(pair, look, grounds, colours, held_out, level, report)
    if not found:
        return [], []
    first, *others = simplest_first(found, null, poor)
    others += only_later(first, [t for t in found if all(t is not own for own in (first, *others))], null)
    gained = null.squares - first.joint.squares
    left = first.joint.squares - separate
    if _significant(left, level, len(pair.free)) and left > LEFT * gained:
        return [], []
    if held_out is not None:
        more = _held_out_gain(pair, held_out, best.joint, first.joint, colours)
        if more <= float(normal_beyond(level / 2.0)) ** 2:
            return [], []
    return [first, *others], with_a_number_more(first, found)


def _significant(left: float, level: float, free: int) -> bool:
    """Whether two separate models of so many `free` parameters leave less by more than chance."""
    return left > float(chi_squared_beyond(level / 4.0, max(free, 1)))


def _remainder(best: Trial, null: Joint, separate: float, level: float, before: Fit, after: Fit) -> tuple[str, ...]:
    """That the named change is not all, where what it leaves is little beside it and yet no chance."""
    left, gained = best.joint.squares - separate, null.squares - best.joint.squares
    if not _significant(left, level, len(before.free_names)):
        return ()
    text = (
        f"That is not all: two separate models follow the logs better still (chi-squared by {left:.0f}, beside "
        f"{gained:.0f} that this change gains)"
    )
    changed = [c.of for c in best.score.candidate.coordinates]
    if all(name in before.free_names for name in changed):
        # A mechanism that appeared would have moved the other estimates, too; another value of a parameter does not.
        apart = {n: _apart(before[n], after[n]) for n in before.free_names if n not in changed}
        differ = sorted((n for n in apart if abs(apart[n]) > _CLEAR), key=lambda n: -abs(apart[n]))[:_NAMED]
        listed = ", ".join(
            f"{n} {after[n].value - before[n].value:+.3g} {before[n].unit}".rstrip()
            + f" ({abs(apart[n]):.0f} standard errors)"
            for n in differ
        )
        text += f". Of what else the two fits estimated differs: {listed}" if differ else ""
    return (f"{text}.",)


def _apart(one: Estimate, other: Estimate) -> float:
    """By how many standard errors of the difference the second estimate is above the first; 0 where they have none."""
    error = float(np.hypot(one.std_error, other.std_error))
    return (other.value - one.value) / error if np.isfinite(error) and error > 0 else 0.0


def _doubts(
    best: Trial, null: Joint, separate: float, worse: Worse, by_name: float, level: float,
    held_out: HeldOutLogs | None, colours: Colours, pair: Pair,
) -> list[str]:  # fmt: skip
    """Why the best candidate is not the answer, each reason in a sentence's part."""
    doubts = []
    if 2.0 * by_name >= level:
        doubts.append("no candidate stands out from chance by itself")
    left, gained = best.joint.squares - separate, null.squares - best.joint.squares
    if _significant(left, level, len(pair.free)) and left > LEFT * gained:
        doubts.append(
            f"two separate models follow the logs better (chi-squared by {left:.0f}, of {gained:.0f} that it gains)"
        )
    if 4.0 * worse.p_value < level:
        doubts.append(f"even so the model follows one of the two sets {worse.ratio:.2f} times less well than the other")
    doubts += unlikely(best, pair)
    if held_out is not None:
        gain = _held_out_gain(pair, held_out, null, best.joint, colours)
        if gain <= float(normal_beyond(level / 2.0)) ** 2:
            doubts.append(f"on held-out logs it gains nothing (chi-squared {gain:+.1f})")
    return doubts

"""Many robots, each explained as if it were alone, and what their explanations have in common.

One after another: as lanes of one batch, as fits are, they took as much processor time, and all of them memory at once.
"""

import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from .._origin import Origin, with_origin
from .._table import html_table, text_table
from ..estimate.output_error.conclude import Covariance
from ..estimate.output_error.far_members import FarMember, far_members, too_few
from ..estimate.output_error.fleet import Fleet, fit_fleet
from ..estimate.output_error.losses import Loss
from ..estimate.output_error.output_error import Windows
from ..estimate.result import Fit
from ..logs import LogError, LogSet
from ..parameters import ParameterError
from ..robots.effect import Effect, in_words
from ..robots.robot import Robot
from .explain import explain
from .explanation import Explanation
from .level import FALSE_ALARM
from .search.search import MOST_EFFECTS

_NAMED = ("named", "ambiguous")
_SHOWN = 20
"""Members that a representation holds."""
_WORTH_A_WORD = 0.1
"""Members that chance alone makes look incomplete, from which on it is said."""
EXPLANATIONS = (
    "member", "verdict", "effects", "equivalent", "before", "after", "gap_closed", "sentence", "next_experiment", "failure",
)  # fmt: skip
EFFECTS = (
    "member", "effect", "where", "equivalent", "before", "after", "parameter", "value", "std_error", "low", "high", "unit",
    "status",
)  # fmt: skip


def explanation_row(member: str, found: Mapping[str, Any] | None, failure: str = "") -> tuple[Any, ...]:
    """What became of one member, of an explanation's `to_dict()`; columns `EXPLANATIONS`. Several ids are joined by commas."""
    if found is None:
        nothing = float("nan")
        return (member, "", "", "", nothing, nothing, nothing, "", "", failure)
    named = [effect["id"] for effect in found["effects"]]
    alike = dict.fromkeys(other for effect in found["effects"] for other in effect["equivalent_to"])
    gap = found["gap"]
    return (
        member, found["verdict"], ",".join(named), ",".join(alike), _number(gap["before"]), _number(gap["after"]),
        _number(gap["closed"]), found["sentence"], found["next_experiment"].get("sentence", ""), "",
    )  # fmt: skip


def effect_rows(member: str, found: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """A row for each parameter of each named effect, of an explanation's `to_dict()`; columns `EFFECTS`."""
    rows = []
    for effect in found["effects"]:
        evidence, alike = effect["evidence"], ",".join(effect["equivalent_to"])
        first = (
            member,
            effect["id"],
            effect["where"],
            alike,
            _number(evidence["held_out_before"]),
            _number(evidence["held_out_after"]),
        )
        for name, e in effect["parameters"].items():
            numbers = map(_number, (e["value"], e["std_error"], *e["ci95"]))
            rows.append((*first, name, *numbers, e["unit"], e["status"]))
    return rows


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def unforeseen(failure: Exception) -> str:
    """What is said of a member whose explanation ended with an exception that jaxid should not raise."""
    last = traceback.extract_tb(failure.__traceback__)[-1]
    return (
        f"jaxid failed on it ({type(failure).__name__}: {failure}; {Path(last.filename).name}, line {last.lineno}), which is "
        "an error of jaxid's: please report it. The other members are as they were."
    )


def _listed(members: Sequence[str]) -> str:
    more = f" and {len(members) - _SHOWN} more" if len(members) > _SHOWN else ""
    return ", ".join(members[:_SHOWN]) + more


Answer = tuple[str, str, str, str, str]
"""Of one member: its name, and `verdict`, `effects`, `equivalent` and `failure` as in `EXPLANATIONS`."""


def named(verdict: str, effects: str, equivalent: str) -> str:
    """What a member lacks, in words: the names, with those that its logs cannot tell from them; empty where it has none."""
    found = [in_words(one) for one in sorted(filter(None, effects.split(",")))] if verdict in _NAMED else []
    others = ", ".join(in_words(one) for one in equivalent.split(",") if one)
    return " and ".join(found) + (f" (or {others})" if found and others else "")


def answers(members: Iterable[Answer]) -> dict[str, list[str]]:
    """Members by what their explanations say (the names, with those that the logs of any of them cannot tell from these, or
    the verdict where there are none), the commonest first."""
    by: dict[tuple[str, str], list[Answer]] = {}
    for answer in members:
        _, verdict, effects, _, failure = answer
        if not failure:
            own = ("", ",".join(sorted(effects.split(",")))) if verdict in _NAMED and effects else (verdict, "")
            by.setdefault(own, []).append(answer)
    found = {}
    for (verdict, effects), own in by.items():
        others = dict.fromkeys(other for answer in own for other in answer[3].split(",") if other)
        found[verdict or named("ambiguous", effects, ",".join(others))] = [answer[0] for answer in own]
    return dict(sorted(found.items(), key=lambda entry: -len(entry[1])))


def summary(members: Sequence[Answer], false_alarm: float = FALSE_ALARM) -> list[str]:
    """How many members were explained, which effects are named how often, who differs from most, and how many of so many
    chance alone may have made look incomplete."""
    sound = [answer[1:4] for answer in members if not answer[4]]
    counted = ", ".join(f"{count} {verdict}" for verdict, count in Counter(v for v, *_ in sound).most_common())
    said = [f"{len(sound)} of {len(members)} members explained{': ' if counted else ''}{counted}."]
    # A name that its logs cannot tell from others is none of those that are sure.
    sure = (one for verdict, ids, others in sound if verdict in _NAMED and not others for one in ids.split(",") if one)
    effects = Counter(sure)
    if effects:
        said.append("Missing: " + ", ".join(f"{in_words(e)} in {count}" for e, count in effects.most_common()) + ".")
    open_ = Counter(named(*own) for own in sound if own[0] in _NAMED and own[2])
    if open_:
        each = ", ".join(f"{words} in {count}" for words, count in open_.most_common())
        said.append(f"Missing, of names that the logs cannot tell apart: {each}.")
    by = list(answers(members).items())
    if len(by) > 1 and 2 * len(by[0][1]) > len(sound):
        said.append(f"One answer for most ({len(by[0][1])}): {by[0][0]}.")
        said += [f"Other than most, {answer}: {_listed(others)}." for answer, others in by[1:]]
    by_chance = false_alarm * len(sound)
    if by_chance >= _WORTH_A_WORD and any(verdict != "adequate" for verdict, *_ in sound):
        said.append(
            f"Every member is judged on its own: of {len(sound)} complete robots, chance makes {by_chance:.2g} look "
            "incomplete. One that is only just above its noise may be such a one; fresh logs of it tell."
        )
    return said


@dataclass(frozen=True, repr=False)
class ExplainedFleet:
    """Explanations by member, and why the others have none. `far` are the members whose numbers stand out from the fleet."""

    explanations: dict[str, Explanation]
    failed: dict[str, str]
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @cached_property
    def _documents(self) -> dict[str, dict[str, Any]]:
        return {member: found.to_dict() for member, found in self.explanations.items()}

    @cached_property
    def far(self) -> tuple[FarMember, ...]:
        """Sound members whose estimates, of the model with what was found missing, are farther from the fleet's than chance
        makes them. The same effect, or none, in all members says nothing of their numbers."""
        return far_members({member: found.final for member, found in self.explanations.items()})

    def to_pandas(self) -> pd.DataFrame:
        """A row for every member, those that failed last: `verdict`, `effects` and names that the data cannot tell from them
        (`equivalent`), held-out error in units of the noise `before` and `after`, and the rest of `EXPLANATIONS`."""
        rows = [explanation_row(member, found) for member, found in self._documents.items()]
        rows += [explanation_row(member, None, why) for member, why in self.failed.items()]
        return pd.DataFrame(rows, columns=list(EXPLANATIONS))

    def effects_to_pandas(self) -> pd.DataFrame:
        """A row for every member, effect named and parameter of it; columns `EFFECTS`."""
        rows = [row for member, found in self._documents.items() for row in effect_rows(member, found)]
        return pd.DataFrame(rows, columns=list(EFFECTS))

    @cached_property
    def sentences(self) -> tuple[str, ...]:
        """How many were explained, what is missing how often, and who differs from most."""
        rows = (explanation_row(member, document) for member, document in self._documents.items())
        found = [(row[0], row[1], row[2], row[3], "") for row in rows]
        level = next((e.before.false_alarm for e in self.explanations.values()), FALSE_ALARM)
        return tuple(summary([*found, *((member, "", "", "", why) for member, why in self.failed.items())], level))

    def _rows(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = [("", "verdict", "effects", "before", "after")] if self.explanations else []
        for member, found in list(self.explanations.items())[:_SHOWN]:
            document = self._documents[member]
            lacks = named(*explanation_row(member, document)[1:4])
            before, after = (f"{state.normalised_rms:.3g}" for state in (found.before, found.after))
            rows.append((member, found.verdict, lacks, before, after))
        return rows

    def _after(self) -> list[str]:
        left = len(self.explanations) - _SHOWN
        more = [f"{left} more in explanations."] if left > 0 else []
        more += [far.sentence for far in self.far[:_SHOWN]]
        sound = sum(found.final.trustworthy for found in self.explanations.values())
        more += filter(None, [too_few(sound, len(self.explanations) + len(self.failed))])
        return more + [f"{name}: {why}" for name, why in list(self.failed.items())[:_SHOWN]]

    def __repr__(self) -> str:
        return text_table(self._rows(), list(self.sentences), self._after())

    def _repr_html_(self) -> str:
        return html_table(self._rows(), list(self.sentences), self._after())


def _fitted(
    fits: Fleet | Mapping[str, Fit] | Robot | Mapping[str, Robot],
    logs: Mapping[str, LogSet],
    report: Callable[[str], None],
    options: Mapping[str, Any],
) -> Fleet:
    """The fits to be explained."""
    if isinstance(fits, Fleet):
        return fits
    if isinstance(fits, Robot):
        return fit_fleet(fits, logs, report=report, **options)
    own = {name: fit for name, fit in fits.items() if isinstance(fit, Fit)}
    robots = {name: robot for name, robot in fits.items() if isinstance(robot, Robot)}
    return fit_fleet(robots, logs, report=report, **options) if robots else Fleet(own, {})


@with_origin
def explain_fleet(
    fits: Fleet | Mapping[str, Fit] | Robot | Mapping[str, Robot],
    logs: Mapping[str, LogSet],
    held_out: Mapping[str, LogSet],
    *,
    effects: Sequence[Effect] = (),
    most: int = MOST_EFFECTS,
    loss: Loss | str = "squares",
    covariance: Covariance = "auto",
    windows: Windows = "auto",
    false_alarm: float = FALSE_ALARM,
    report: Callable[[str], None] = lambda message: None,
) -> ExplainedFleet:
    """`explain` for every member of a fleet, with its own fit, fitted logs and held-out logs, all by the member's name.

    `fits` are those that `fit_fleet` returns, fits by member, or a robot (or robots by member) that is fitted first. Every
    member gets exactly the explanation that it gets alone; the other arguments are those of `explain`, and `report` is
    told the member's name first. A member that has no fit, or that cannot be explained, is in `ExplainedFleet.failed`, and
    does not touch the others.

    Raises `LogError` for a fleet without members, or with a member that has a fit and no fitted or held-out logs.
    """
    options: dict[str, Any] = {"loss": loss, "covariance": covariance, "windows": windows}
    fitted = _fitted(fits, logs, report, options)
    failed = dict(fitted.failed)
    if not (fitted.fits or failed):
        raise LogError("There is no member to explain; give at least one fit.")
    for given, what in ((logs, "fitted"), (held_out, "held-out")):
        missing = [name for name in fitted.fits if not len(given.get(name, ()))]
        if missing:
            raise LogError(f"{missing[0]} has no {what} logs; give it some or leave it out.")
    found: dict[str, Explanation] = {}
    for name, fit in fitted.fits.items():
        try:
            found[name] = explain(
                fit,
                logs[name],
                held_out[name],
                effects=effects,
                most=most,
                false_alarm=false_alarm,
                report=lambda message, name=name: report(f"{name}: {message}"),
                **options,
            )
        except (ParameterError, LogError) as failure:
            failed[name] = str(failure)
        except Exception as failure:  # noqa: BLE001  one member's must not cost the others theirs
            failed[name] = unforeseen(failure)
        else:
            report(
                f"{name}: {found[name].sentence} ({len(found) + len(failed)} of {len(fitted.fits) + len(fitted.failed)})"
            )
    return ExplainedFleet(found, failed)

"""What `explain_change` found, as one object: verdict, the change with its size, and what could have gone unnoticed."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ..._json import plain, write_json
from ..._origin import Origin
from ..._table import html_table, text_table
from ...estimate.result import Estimate, Fit
from ...robots.effect import in_words

Verdict = Literal["unchanged", "named", "ambiguous", "unexplained"]
POWER = 0.9
"""Probability with which a change of the size that is called noticeable would have been noticed."""
_SHOWN = 12
_FRICTIONS = {"dry_friction.coulomb": "Coulomb", "viscous_friction.viscous": "viscous"}


def number_in_words(name: str, identifier: str, title: str) -> str:
    """A number by which a candidate of this title moves, as people say it; a parameter of the robot keeps its symbol."""
    if "." not in name:
        return title if name == identifier and f"({name})" not in title else name
    effect, own = name.rsplit(".", 1)
    kind = _FRICTIONS.get(".".join(name.split(".")[-2:]))
    if kind is not None:
        # Of each axis by itself: the name says which, from 1 on.
        axis = effect.split(".")[0].removeprefix(identifier).removeprefix("_")
        return f"{kind} {title.replace('each drive axis', f'drive axis {axis}') if axis else title}"
    if (effect == identifier and own == "gain") or name == f"{identifier}.drive_torque.torque":
        return title
    return own.replace("_", " ") if effect == identifier else f"{own.replace('_', ' ')} of {in_words(effect)}"


def apart_in_words(one: float, other: float) -> tuple[str, str]:
    """Two numbers with three digits, or as many as show that they differ."""
    texts = (f"{one:.3g}", f"{other:.3g}")
    for digits in range(4, 8):
        if texts[0] != texts[1] or one == other:
            break
        texts = (f"{one:.{digits}g}", f"{other:.{digits}g}")
    return texts


@dataclass(frozen=True)
class Difference:
    """By how much one number differs: `size` is added to `before` to give `after` (a share where it has no unit)."""

    before: float
    after: float
    size: Estimate

    @property
    def share(self) -> float:
        """The size in units of what there was before; NaN where there was nothing."""
        return self.size.value / abs(self.before) if self.before else math.nan

    def to_dict(self) -> dict[str, Any]:
        """As result files have it."""
        return {"before": self.before, "after": self.after, "difference": self.size.to_dict()}


@dataclass(frozen=True)
class NamedChange:
    """One thing that would explain the difference between the two sets of logs, or two that do so together (`parts`).

    `differences` by name; `rms` is the error that it leaves on all logs of both sets, in units of the (whitened) noise. `same`
    are other names of the very same model.
    """

    id: str
    title: str
    differences: dict[str, Difference]
    rms: float
    same: tuple[str, ...] = ()
    parts: tuple["NamedChange", ...] = ()
    law: str = ""
    formula: str = ""

    @property
    def words(self) -> str:
        """The title, with the law, where there are several, and the names that mean the same model."""
        if self.parts:
            return " and ".join(part.words for part in self.parts)
        title = f"{self.title}, by the law {in_words(self.law)} ({self.formula})" if self.law else self.title
        return f"{title}, which is the same as {' or '.join(self.same)}" if self.same else title

    @property
    def sizes(self) -> str:
        """Every difference with its 95 % interval, in words."""
        return ", ".join(_sized(self.words_of(name), d) for name, d in self.differences.items())

    def words_of(self, name: str) -> str:
        """A key of `differences` in words."""
        whose = next((part for part in self.parts if name in part.differences), None)
        if whose is not None:
            return whose.words_of(name)
        return number_in_words(name, self.id, self.title)

    def to_dict(self) -> dict[str, Any]:
        """As result files have it."""
        parameters = {name: d.to_dict() for name, d in self.differences.items()}
        return {
            "id": self.id,
            "title": self.title,
            "law": self.law,
            "formula": self.formula,
            "parameters": parameters,
            "rms": self.rms,
            "same_as": list(self.same),
            "together": [part.to_dict() for part in self.parts],
        }


def _percent(share: float, sign: str = "") -> str:
    """A share in two digits, or in whole per cents above a hundred: no powers of ten."""
    return f"{100 * share:{sign}.0f}" if abs(share) >= 1.0 else f"{100 * share:{sign}.2g}"


def _sized(name: str, d: Difference) -> str:
    unit = f" {d.size.unit}" if d.size.unit else ""
    low, high = d.size.ci95
    if not math.isfinite(d.size.std_error):
        return f"{name} {d.size.value:+.3g}{unit} (no interval)"
    if not unit and not d.before:
        low, high = 100 * low, 100 * high
        return f"{name} {100 * d.size.value:+.3g} % (95 % {low:.3g} to {high:.3g} %)"
    share = f", {_percent(d.share, '+')} %" if math.isfinite(d.share) else ""
    return f"{name} {d.size.value:+.3g}{unit} (95 % {low:.3g} to {high:.3g}{share})"


@dataclass(frozen=True)
class Noticeable:
    """The smallest change of one number of a candidate, all else the same, that these logs would have shown with a probability
    of `POWER` (infinite: they show none)."""

    id: str
    title: str
    name: str
    size: float
    unit: str
    value: float

    @property
    def text(self) -> str:
        """Name and size in words."""
        if self.is_share:
            return f"{self.words} by {_percent(self.size)} %"
        unit = f" {self.unit}" if self.unit else ""
        share = f" ({_percent(self.size / abs(self.value))} %)" if self.value else ""
        return f"{self.words} by {self.size:.2g}{unit}{share}"

    @property
    def words(self) -> str:
        """The number's name in words."""
        return number_in_words(self.name, self.id, self.title)

    @property
    def is_share(self) -> bool:
        """Whether the size is a share of what there is."""
        return not self.unit and not self.value


@dataclass(frozen=True)
class Looked:
    """A candidate at the first look: the drop of the sum of squares that it promises and its probability by chance, for this
    candidate alone."""

    id: str
    title: str
    gain: float
    p_value: float


@dataclass(frozen=True, repr=False)
class ExplainedChange:
    """What changed between two sets of logs of one robot. `str()` has it for people, `to_dict()` for programs.

    - `verdict`: "unchanged"; "named": one thing (`change`), or two together, explain the difference; "ambiguous": it or one of
      `equivalent`, which these logs cannot tell apart; "unexplained": something changed that neither one candidate nor two
      explain (`doubts` say why not; `change` is then the one that comes nearest).
    - `p_value`: of two sets this different if nothing had changed, all candidates accounted for.
    - `rms_unchanged` and `rms_separate`: error of one model for both sets and of two models, in units of the (whitened) noise.
    - `noticeable`: the smallest changes that would have been noticed; `unseen`: what these logs do not show at all.
    - `lacked`: what the model lacks in both sets is much like these mechanisms; `before` and `after` are fits with them, and
      compared so.
    - `freed`: constants, with the table's values, for which both sets have others; `before` and `after` are fits of them, too.
    - `only_noise`: whether the change leaves no more of both sets than their sensors' noise, whatever their own fits lack.
    - `looked`: all candidates, the likeliest first. `held_out_gain`: drop of chi-squared on held-out logs by the change, NaN
      without.
    """

    verdict: Verdict
    change: NamedChange | None
    equivalent: tuple[NamedChange, ...]
    p_value: float
    false_alarm: float
    rms_unchanged: float
    rms_separate: float
    before: Fit = field(repr=False)
    after: Fit = field(repr=False)
    noticeable: tuple[Noticeable, ...] = ()
    unseen: tuple[str, ...] = ()
    looked: tuple[Looked, ...] = ()
    held_out_gain: float = math.nan
    doubts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    lacked: tuple[str, ...] = ()
    freed: dict[str, float] = field(default_factory=dict)
    only_noise: bool = False
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def sentence(self) -> str:
        """The verdict in one sentence, and what both sets lacked, or contradict of the table, in others."""
        said = self._changed
        if self.freed:
            one, other = self.before.robot.parameters, self.after.robot.parameters
            values = [
                f"{name} of {value:.3g}{' ' if one[name].unit else ''}{one[name].unit} "
                f"({one[name].value:.3g} before, {other[name].value:.3g} after)"
                for name, value in self.freed.items()
            ]
            said += (
                f" Both sets contradict the table's {' and '.join(values)}: estimated in both, they were compared so."
            )
        if self.lacked:
            names = " and ".join(map(in_words, self.lacked))
            said += (
                f" The model lacks something in both sets, much like {names}: both were fitted again with that, and compared "
                "so. What it is, an explanation of one set says."
            )
        return said

    @property
    def _changed(self) -> str:
        if self.verdict == "unchanged" and self.lacked and self.p_value < self.false_alarm:
            return (
                f"What differs (p = {self.p_value:.2g}) is no more than the laws of what both sets lack may be off: so small a "
                "change would not show."
            )
        if self.verdict == "unchanged":
            return f"Nothing changed that these logs show (p = {self.p_value:.2g})."
        fall = ""
        if self.change is not None:
            before, after = apart_in_words(self.rms_unchanged, self.change.rms)
            fall = f"; the error of one model for both sets falls from {before} to {after} times the noise"
        if self.verdict == "unexplained":
            part = f" Nearest comes {self.change.title}: {self.change.sizes}{fall}." if self.change is not None else ""
            why = (
                f" It is not the answer, since {'; '.join(self.doubts)}."
                if self.change is not None and self.doubts
                else ""
            )
            return f"Something changed that no single thing explains (p = {self.p_value:.1e}).{part}{why}"
        assert self.change is not None
        others = ""
        if self.equivalent:
            others = (
                " These logs cannot tell it from "
                + " or ".join(f"{own.words} ({own.sizes})" for own in self.equivalent)
                + "."
            )
        return f"Changed: {self.change.words}: {self.change.sizes}{fall}.{others}"

    @property
    def unsound(self) -> str:
        """What it means that a set's own fit is poor or failed; empty where neither is, or where it lacks the change alone."""
        if self.only_noise:
            return ""
        said = {
            side: fit.judgement.verdict
            for side, fit in (("before", self.before), ("after", self.after))
            if fit.judgement is not None and fit.judgement.verdict in ("poor", "failed")
        }
        if not said:
            return ""
        if len(said) == 2:
            how = " and ".join(dict.fromkeys(said.values()))
            fits = f"The fits of both sets are {how}"
        else:
            ((side, how),) = said.items()
            fits = f"The fit of the set {side} is {how}"
        return (
            f"{fits}: what the model lacks may pass for a change, and sizes may be off by more than their intervals. "
            "`explain` says of each set what it lacks, or that it is slow noise."
        )

    @property
    def distinct(self) -> tuple[Looked, ...]:
        """Of `looked` the likeliest of each name: an effect is tried by several of its laws."""
        found: dict[str, Looked] = {}
        for own in self.looked:
            found.setdefault(own.title, own)
        return tuple(found.values())

    def _paragraphs(self) -> tuple[list[str], list[str]]:
        after = []
        if self.noticeable:
            after.append(
                f"With {100 * POWER:.0f} % probability a change on its own would have been noticed of "
                + "; ".join(own.text for own in self.noticeable[:_SHOWN])
                + "."
            )
        if self.unseen:
            after.append(f"Not shown at all: {', '.join(self.unseen[:_SHOWN])}.")
        return [self.sentence, *([self.unsound] if self.unsound else [])], [*after, *self.notes]

    def _rows(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = [("", "promises (chi-squared)", "p value alone")]
        rows += [
            (own.title, f"{own.gain:.1f}", f"{own.p_value:.2g}" if own.p_value > 0 else "< 1e-300")
            for own in self.distinct[:_SHOWN]
        ]
        return rows

    def __repr__(self) -> str:
        return text_table(self._rows(), *self._paragraphs(), right=(1, 2))

    def __str__(self) -> str:
        return repr(self)

    def _repr_html_(self) -> str:
        return html_table(self._rows(), *self._paragraphs(), right=(1, 2))

    def to_dict(self) -> dict[str, Any]:
        """What `change.json` holds; what is not a finite number is None."""
        return plain(
            {
                "robot": self.before.robot.name,
                "verdict": self.verdict,
                "sentence": self.sentence,
                "false_alarm": self.false_alarm,
                "p_value": self.p_value,
                "change": self.change.to_dict() if self.change is not None else None,
                "equivalent_to": [own.to_dict() for own in self.equivalent],
                "rms": {"unchanged": self.rms_unchanged, "separate": self.rms_separate},
                "held_out_gain": self.held_out_gain,
                "noticeable": [
                    {"id": n.id, "parameter": n.name, "size": n.size, "unit": n.unit, "value": n.value}
                    for n in self.noticeable
                ],
                "unseen": list(self.unseen),
                "candidates": [
                    {"id": c.id, "title": c.title, "gain": c.gain, "p_value": c.p_value} for c in self.looked
                ],
                "doubts": list(self.doubts),
                "unsound": self.unsound,
                "notes": list(self.notes),
                "lacked": list(self.lacked),
                "freed": self.freed,
            }
        )

    def save(self, folder: str | Path) -> list[Path]:
        """Write `change.json` into `folder` (made if missing) and return its path. Raises `OSError` if it cannot be written."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        write_json(folder / "change.json", self.to_dict())
        return [folder / "change.json"]

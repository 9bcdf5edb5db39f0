"""What `explain` found, as one object: verdict, names with their evidence, and the gap before and after."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from .._json import plain, write_json
from .._origin import Origin
from ..estimate.judge import ABOVE, TAILS
from ..estimate.judgement import LOOK_FURTHER
from ..estimate.result import Estimate, Fit
from ..logs import LogSet
from ..model_file import write_model
from ..robots.effect import in_words
from ..robots.robot import Robot
from .display import displays
from .left.coloured import OnlyColour
from .left.heldout import HeldOut
from .named_effect import NamedEffect
from .next_experiment import NextExperiment
from .policy import current_policy
from .search.steps import Search

Verdict = Literal["named", "adequate", "ambiguous", "unexplained"]


_TOLD = 3
"""Logs that are named one by one."""


@dataclass(frozen=True, repr=False)
class Explanation:
    """The whole explanation. `model` is an ordinary robot: fit it, simulate it, save it, extend it.

    `before` and `after` are the held-out states of the `baseline` and the `final` fit; `localisation` says where the gap
    is; `next_experiment` what to record to settle what this data leaves open; `doubts` why names that were found are no
    answer; `between_logs` which parameter differs between which logs where every log alone is explained (`between_logs.py`);
    `notes` what else to know; `colour` is that of the noise if nothing but coloured noise is left. `held_out` are
    the logs it was judged on. Where `after` is that with prescribed wheels' angles (`smoothed_angles.py`),
    `after.simulated_freely` is the state without. In a
    notebook it shows itself.
    """

    verdict: Verdict
    effects: tuple[NamedEffect, ...]
    baseline: Fit
    final: Fit
    before: HeldOut
    after: HeldOut
    search: Search = field(repr=False)
    held_out: LogSet = field(repr=False)
    localisation: Any = None
    next_experiment: NextExperiment | None = None
    doubts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    colour: OnlyColour | None = None
    between_logs: str = ""
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def model(self) -> Robot:
        """The robot with what was added."""
        return self.final.robot

    @property
    def gap_closed(self) -> float:
        """Share of the held-out gap that the added effects closed; NaN where there was none."""
        gap = self.before.normalised_rms - self.noise_floor
        if gap <= 0:
            return math.nan
        return (self.before.normalised_rms - self.after.normalised_rms) / gap

    @property
    def noise_floor(self) -> float:
        """The error that chance alone leaves, in units of the noise's white part: one, more where the noise is coloured or
        delays scatter."""
        coloured = self.colour is not None and self.colour.only_noise
        chance = self.after.by_chance or (self.after.within_errors and bool(self.after.hung_on_it))
        return max(self.after.normalised_rms, 1.0) if coloured or chance else 1.0

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        before, after = self.before.normalised_rms, self.after.normalised_rms
        names = " and ".join(effect.title for effect in self.effects)
        if self.verdict == "adequate" and self.colour is not None:
            coloured = f"the noise of {self.colour.phrase} is coloured."
            if self.colour.of_inputs is not None:
                return (
                    f"Nothing is missing that these logs show: what is left is {self._by_inputs}. The held-out error is "
                    f"{before:.2f} times the noise that neighbouring samples show, and follows nothing that drove the robot."
                )
            if self.colour.at_rest:
                coloured = (
                    f"what is left in {self.colour.phrase} is slow noise of the sensor, which is there while the robot stands, "
                    "too."
                )
            elif not self.colour.faster:
                coloured = (
                    f"what is left in {self.colour.phrase} is coloured noise of the sensor, or a disturbance of the motion "
                    "that is as slow (a log of the robot at rest tells them apart)."
                )
            return (
                f"Nothing is missing that these logs show: {coloured} The held-out error is {before:.2f} times the noise "
                "that neighbouring samples show, follows nothing that drove the robot, and no effect explains it."
            )
        if self.between_logs:
            return f"{self.between_logs} Together the held-out error is {before:.4g} times the noise."
        if self.verdict == "unexplained" and self.colour is not None and not self.effects:
            follows = "" if self.colour.fed_back else ", and it follows nothing that drove the robot"
            return f"No effect explains what is left{follows}: the held-out error of {before:.4g} times the noise {self._slow}"
        if self.verdict == "adequate" or (self.baseline.failed and not self.effects and self.after.adequate):
            return self._nothing_found
        if self.verdict == "unexplained":
            explain = "explain" if len(self.effects) > 1 else "explains"
            base = "Something is missing that has no name here"
            if self.baseline.failed:
                base = "The fit that was to be explained failed, and nothing named here mends it"
            if names and self.doubts and self.after.adequate:
                # Nothing is left: what is wanting is not an effect, but certainty about its name.
                base = "The fit that was to be explained failed" if self.baseline.failed else "Something is missing"
                return (
                    f"{base}: the held-out error is {before:.4g} times the noise, and {after:.2f} with {names}. Yet no name is "
                    f"given, since {'; '.join(self.doubts)}."
                )
            with_others = " and ".join(map(_or_another, self.effects))
            part = f"{with_others} {explain} part of it (to {after:.2f}), the rest" if names else "it"
            if names and not after < before:
                part = f"{with_others} {explain} part of it on the fitted logs, but none here (then {after:.4g}), and the rest"
            if names and self.colour is not None and not self.doubts:
                return (
                    f"{base}: the held-out error is {before:.4g} times the noise; {part} follows nothing that drove the robot "
                    f"and {self._slow}"
                )
            why = f" No name is given, since {'; '.join(self.doubts)}." if names and self.doubts else ""
            few = ""
            if self.after.usual < ABOVE and after > TAILS * self.after.usual and not self.after.diverged:
                few = (
                    f" A few samples make it that large (the usual error is {self.after.usual:.2f} times the noise): outliers "
                    "of a sensor, or something brief that disturbed the motion."
                )
            return f"{base}: the held-out error is {before:.4g} times the noise; {part} fits no known effect.{why}{few}"
        closed = f"the held-out error falls from {before:.2f} to {after:.2f} times the noise"
        if f"{before:.2f}" == f"{after:.2f}":
            closed = f"the held-out error, {before:.2f} times the noise, hardly falls by it"
        freely = self.after.simulated_freely
        if freely is not None:
            closed += (
                f" when the wheels' angles are prescribed from measurements (simulated freely {freely.normalised_rms:.2f}: "
                "which notch a wheel comes to rest in hangs on less than the noise)"
            )
        if self.verdict == "ambiguous":
            sets = "; ".join(map(_or_another, self.effects))
            return f"Missing was {sets}: {closed}, but this data does not tell these names apart.{self._chance}{self._more}"
        left = (
            f" What is left is {self._by_inputs or f'coloured noise of {self.colour.phrase}'}." if self.colour else ""
        )
        return f"Missing was {names}: {closed}.{left}{self._chance}{self._more}"

    @property
    def _by_inputs(self) -> str:
        """Noise of the inputs, in words; empty where it is none."""
        own = self.colour.of_inputs if self.colour is not None else None
        if own is None:
            return ""
        noise = (
            f"what noise of the inputs makes of the motion ({own.phrase}, by chance in every sample: as they were measured, or "
            "as they acted)"
        )
        # A law that is near nature's leaves as little of a gap, and as shapeless.
        near = self.after.gap < current_policy().coarse_share * self.before.gap
        return f"{noise}, or what is wrong with the form of the law that was added" if self.effects and near else noise

    @property
    def _slow(self) -> str:
        """What noise as slow as the motion may be."""
        colour = self.colour
        if colour is None:
            return ""
        if colour.fed_back:
            return (
                f"looks like coloured noise of {colour.phrase}, of which a controller makes commands, so that the motion "
                "follows it; but something that is missing may look like that. With the controller given (`controller=`) the "
                "loop itself is simulated, which tells."
            )
        if colour.at_rest is False:
            return (
                f"is a disturbance of the motion, in {colour.phrase}: while the robot stands, held by dry friction, it is not "
                "there (floor, slip, gears, noise of the measured inputs, or of a sensor that is noisier in motion)."
            )
        return (
            f"looks like slow noise of {colour.phrase} or a disturbance of the motion. A log of the robot at rest tells them "
            "apart."
        )

    @property
    def _chance(self) -> str:
        if self.after.within_errors or self.after.hung_on_it:
            return f" {self._let_expect(self.after)}"
        if not self.after.by_chance:
            return ""
        found = [effect.parameters["scatter"] for effect in self.effects if "scatter" in effect.parameters]
        about = " or ".join(f"{scatter.value:.2g} s about their mean" for scatter in found if scatter.value > 0)
        so = f"by up to {about}" if about else "so"
        return f" What is left is what delays that scatter {so} leave, each of them by chance: no model foretells it."

    @property
    def _more(self) -> str:
        """That names which close most of the gap are not all that is missing, where the fit with them is poor."""
        judgement = self.final.judgement
        if judgement is None or not judgement.doubt or self.after.by_chance:
            return ""
        if self.noise_floor > 1.0 or self.after.adequate:
            return " The fit with it is poor all the same: more may be missing."
        follows = f", and follows the motion in {', '.join(judgement.follows)}" if judgement.follows else ""
        return f" More is missing that has no name here: what is left is more than noise{follows}."

    def _let_expect(self, held: HeldOut) -> str:
        """What of the held-out error the standard errors of the parameters let expect."""
        hung = held.hung_on_it
        if not hung:
            return "What is left is what the standard errors of the parameters let expect."
        more = f" and {len(hung) - _TOLD} more logs" if len(hung) > _TOLD else ""
        where = f"on {', '.join(hung[:_TOLD])}{more}"
        if not held.within_errors:
            return (
                f"Part of what is left hangs on very little: {where} another motion follows from a change of the parameters by "
                "a few standard errors, such as an axis that just breaks away or just does not; with that motion "
                f"{held.foretold:.2f} times the noise is left."
            )
        return (
            f"What is left is what the standard errors of the parameters let expect: {where} "
            "another motion follows from a change of the parameters that is within them, such as an axis that just breaks "
            "away or just does not."
        )

    @property
    def _nothing_found(self) -> str:
        """The sentence where the held-out error is noise, or too small beside it to be looked into."""
        again = self.final is not self.baseline
        held, judgement = self.after if again else self.before, self.baseline.judgement
        error = f"on held-out logs the model's error is {held.normalised_rms:.2f} times the noise"
        if again:
            error += f" once it is fitted again with their weights (before: {self.before.normalised_rms:.2f})"
        doubted = judgement is not None and not judgement.trustworthy
        though = ""
        if judgement is not None and self.baseline.failed:
            return (
                "The fit that was to be explained failed, so that none of its parameters is known, though held-out logs show "
                f"nothing that is missing: {error}. {judgement.sentence.removesuffix(LOOK_FURTHER).strip()}"
            )
        if judgement is not None and doubted:
            though = f" The fit, though, is not beyond doubt. {judgement.sentence.removesuffix(LOOK_FURTHER).strip()}"
            if judgement.better == LOOK_FURTHER:
                though += (
                    " These held-out logs do not show it: hold out more, or livelier ones, to see whether it is there."
                )
        white = f" and has no structure left (p = {held.p_white:.2g})"
        if held.p_white > held.false_alarm / 2:
            return f"Nothing is missing{' that held-out logs show' if doubted else ''}: {error}{white}.{though}"
        if held.within_errors:
            return (
                f"Nothing is missing that these logs show: {error}, with a structure left (p = {held.p_white:.2g}). "
                f"{self._let_expect(held)}{though}"
            )
        if held.rounded:
            return (
                f"Nothing is missing that these logs show: {error}, with the structure that rounding to the sensors' steps "
                f"makes of slow signals.{though}"
            )
        if held.inputs_rounded:
            return (
                f"Nothing is missing that these logs show: {error}, with the structure that may be that of inputs which are "
                f"logged in coarse steps; log them finer, or as they act, to see more.{though}"
            )
        return (
            f"Nothing is missing that stands out from the noise: {error}. That error is not white (p = {held.p_white:.2g}): "
            f"the sensors' noise is coloured, or something smaller than the noise is missing.{though}"
        )

    @property
    def moved(self) -> dict[str, tuple[Estimate, Estimate]]:
        """Parameters of the robot itself before and after: the bias that the missing effect had caused."""
        return {
            name: (self.baseline.parameters[name], self.final.parameters[name])
            for name in self.baseline.free_names
            if name in self.final.parameters
        }

    def to_dict(self) -> dict[str, Any]:
        """What `explanation.json` holds; what is not a finite number is None."""
        return plain(
            {
                "robot": self.model.name,
                "verdict": self.verdict,
                "false_alarm": self.before.false_alarm,
                "sentence": self.sentence,
                "doubts": list(self.doubts),
                "between_logs": self.between_logs,
                "notes": list(self.notes),
                "judgement": {
                    "before": self.baseline.judgement.to_dict() if self.baseline.judgement else None,
                    "after": self.final.judgement.to_dict() if self.final.judgement else None,
                },
                "effects": [effect.to_dict() for effect in self.effects],
                "gap": {
                    "before": _number(self.before),
                    "after": _number(self.after),
                    "noise_floor": self.noise_floor,
                    "closed": self.gap_closed,
                    "after_simulated_freely": _number(self.after.simulated_freely or self.after),
                    "by_channel": {
                        name: {"before": self.before.by_channel[name], "after": self.after.by_channel[name]}
                        for name in self.before.by_channel
                    },
                    "noise": self.before.noise,
                },
                "localisation": self.localisation.to_dict() if self.localisation is not None else {},
                "colour": self.colour.to_dict() if self.colour is not None else {},
                "first_look": [{"id": c.effect.id, "share": c.share} for c in self.search.first_look],
                "next_experiment": self.next_experiment.to_dict() if self.next_experiment else {},
            }
        )

    @property
    def _remark(self) -> str:
        """Why the model is to be doubted; empty where it is not."""
        judged = self.final.judgement
        unexplained = self.sentence if self.verdict == "unexplained" else ""
        return f"{unexplained} {judged.doubt if judged is not None else ''}".strip()

    def save(self, folder: str | Path) -> list[Path]:
        """Write the explanation into `folder` (made if missing) and return the paths of its files.

        `explanation.json`, `model.toml` (the model with its effects; above it, as a comment, why it is to be doubted),
        `next_experiment.csv` where one is proposed, `report.html` and its pictures. Raises `OSError` if the folder cannot be
        written.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        written = [folder / "explanation.json", folder / "model.toml"]
        write_json(written[0], self.to_dict())
        errors = {name: estimate.std_error for name, estimate in self.final.parameters.items()}
        write_model(written[1], self.model, errors, self.final.method, self._remark)
        if self.next_experiment:
            written.append(folder / "next_experiment.csv")
            self.next_experiment.save(written[-1])
        else:
            # One of an earlier explanation would pass for this one's.
            (folder / "next_experiment.csv").unlink(missing_ok=True)
        for display in displays():
            written += display.save(self, folder)
        return written

    def __repr__(self) -> str:
        return displays()[0].text(self)

    def _repr_html_(self) -> str:
        return displays()[0].body(self)


def _or_another(effect: NamedEffect) -> str:
    """An effect's name, with those that the data cannot tell from it."""
    others = f" (or {', '.join(map(in_words, effect.equivalent_to))})" if effect.equivalent_to else ""
    return f"{effect.title}{others}"


def _number(state: HeldOut) -> float | None:
    """The normalised RMS, as fit.json has it: none where the simulation diverges on a log."""
    return None if state.diverged else state.normalised_rms

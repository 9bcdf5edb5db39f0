"""What a search found: the effects one by one, each with the trials it was chosen from."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from ...robots.robot import Robot
from ..left.coloured import OnlyColour
from ..left.heldout import HeldOut
from ..refits.refit import Trial
from ..screening.screen import Candidate


def laws_in(robot: Robot, but: str) -> set[tuple[str, str]]:
    """The effects that a model has but one of them, each by its law."""
    return {(effect.id, effect.law) for effect in robot.effects if effect.id != but}


@dataclass(frozen=True)
class Step:
    """One effect added: the trials, one of every mechanism by its best law, best first, and the ids that the data cannot tell
    from the best. Those of the ids `refused` come last, however well they were fitted: they did not hold on the held-out logs.
    `laws` are the trials of that one's laws, best first, of which the data cannot tell the first from
    `laws_alike`.

    `before` and `after` are the model without it and with it at the time it was added; where it has got another law since that
    had been tried then, `as_it_was` is that trial, and where it has got another name, `instead` is the model without what is
    named and with it, beside all else that was there when that was found. `finer` are scores by the ids of those
    that were compared on logs with rows between (`between_rows.py`).
    """

    trials: tuple[Trial, ...]
    equivalent: tuple[str, ...]
    screened: tuple[Candidate, ...] = field(repr=False)
    before: Trial = field(repr=False)
    after: Trial = field(repr=False)
    laws: tuple[Trial, ...] = ()
    laws_alike: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()
    finer: Mapping[str, float] = field(default_factory=dict)
    as_it_was: Trial | None = field(default=None, repr=False)
    instead: tuple[Trial, Trial] | None = field(default=None, repr=False)

    @property
    def chosen(self) -> Trial:
        """The trial that was added."""
        return self.trials[0]

    @property
    def evidence(self) -> tuple[Trial, Trial]:
        """The model without what is named and with it."""
        return self.instead or (self.before, self.after)

    @property
    def compared(self) -> tuple[Trial, ...]:
        """The trials beside the same effects as what is named: without those refitted before other effects were there,
        where another name has been found since."""
        beside = {effect.id for effect in self.evidence[0].robot.effects}
        return tuple(t for t in self.trials if beside <= {effect.id for effect in t.robot.effects} or t is self.chosen)

    def lead_over(self, trial: Trial) -> float:
        """By how much another trial is less likely than the chosen one (chi-squared, parameters counted)."""
        best = self.chosen
        finer = best.id in self.finer and trial.id in self.finer
        return self.finer[trial.id] - self.finer[best.id] if finer else trial.score - best.score


@dataclass(frozen=True)
class Search:
    """What naming found: how the fit and the `final` model (None where nothing is missing) do on the held-out logs, the
    effects in the order in which they were added, and the candidates of the first look. `colour` where all that is left is
    coloured noise; `needed` are the ids of effects whose errors do not exclude that there is none, and without which the fit
    leaves clearly more."""

    before: HeldOut
    after: HeldOut
    final: Trial | None
    steps: tuple[Step, ...]
    first_look: tuple[Candidate, ...]
    colour: OnlyColour | None = None
    needed: tuple[str, ...] = ()

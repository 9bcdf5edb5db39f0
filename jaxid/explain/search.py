"""Naming: refit the shortlist, choose by held-out logs, go on until nothing but noise is left or nothing helps."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from ..effects import catalogue
from ..estimate.output_error import output_error
from ..estimate.result import Fit
from ..logs import LogSet
from ..robots.effect import Effect
from .heldout import HeldOut, held_out
from .screen import Candidate, screen

SHORTLIST = 5
"""Candidates that are refitted in full."""
MOST_EFFECTS = 3
LEAST_GAIN = 0.05
"""Share of the held-out gap below which an effect explains nothing."""
_SEPARATED = 3.0
"""Standard errors of the held-out log-likelihood difference beyond which two names are told apart (Vuong 1989)."""

Report = Callable[[str], None]


@dataclass(frozen=True)
class Trial:
    """A refit of the model with one more effect."""

    candidate: Candidate
    fit: Fit
    check: HeldOut
    information: float
    """Bayesian information criterion on the fit logs, in units of 2 log-likelihood (smaller is better)."""


@dataclass(frozen=True)
class Step:
    """One effect added: the trials tried, best first, and the ids that the data cannot tell from the best."""

    trials: tuple[Trial, ...]
    equivalent: tuple[str, ...]
    screened: tuple[Candidate, ...] = field(repr=False)

    @property
    def chosen(self) -> Trial:
        """The trial that was added."""
        return self.trials[0]


def _information(fit: Fit, logs: LogSet, noise: dict[str, float]) -> float:
    here = held_out(fit.robot, logs, noise)
    return here.squares + len(fit.free_names) * float(np.log(here.samples))


def refit(fit: Fit, candidate: Candidate, fit_logs: LogSet, check: LogSet, noise: dict[str, float]) -> Trial:
    """All free parameters and the candidate's own, from the baseline and the candidate's first estimate."""
    robot = fit.robot + candidate.effect
    start = {**{n: fit.robot.parameters[n].value for n in fit.free_names}, **candidate.start}
    found = output_error(robot, fit_logs, start=start, max_steps=60)
    return Trial(candidate, found, held_out(found.robot, check, noise), _information(found, fit_logs, noise))


def _told_apart(one: HeldOut, other: HeldOut) -> float:
    """Vuong's statistic: how many standard errors `one` predicts the held-out logs better than `other`.

    Differences of squared residuals are summed over blocks of half a second or so, since neighbours are correlated.
    """
    blocks = []
    for a, b in zip(one.residuals, other.residuals, strict=True):
        difference = np.nansum(b**2 - a**2, axis=1)
        size = 25
        n = len(difference) // size
        blocks.append(difference[: n * size].reshape(n, size).sum(axis=1))
    values = np.concatenate(blocks)
    spread = float(np.std(values)) * np.sqrt(values.size)
    return float(values.sum()) / spread if spread > 0 else 0.0


def name_next(
    fit: Fit, baseline: HeldOut, fit_logs: LogSet, check: LogSet, effects: Sequence[Effect], report: Report
) -> Step | None:
    """The best effect to add to `fit`, or None if none closes enough of the gap."""
    screened = screen(fit, fit_logs, effects)
    shortlist = [c for c in screened if c.gain > 0][:SHORTLIST]
    report("first look: " + ", ".join(f"{c.effect.id} {100 * c.share:.0f} %" for c in shortlist))
    if not shortlist:
        return None
    # Two threads: one program compiles while another runs.
    with ThreadPoolExecutor(2) as pool:
        trials = list(pool.map(lambda c: refit(fit, c, fit_logs, check, baseline.noise), shortlist))
    trials.sort(key=lambda trial: trial.check.squares)
    best = trials[0]
    for trial in trials:
        report(f"refitted with {trial.candidate.effect.id}: held-out {trial.check.normalised_rms:.3f} x noise")
    gap = max(baseline.normalised_rms - 1.0, 1e-9)
    if (baseline.normalised_rms - best.check.normalised_rms) / gap < LEAST_GAIN:
        return None
    equivalent = []
    for trial in trials[1:]:
        near = trial.check.normalised_rms - best.check.normalised_rms < 0.1 * gap + 0.005
        if near and _told_apart(best.check, trial.check) < _SEPARATED:
            equivalent.append(trial.candidate.effect.id)
    return Step(tuple(trials), tuple(equivalent), tuple(screened))


def search(
    fit: Fit, fit_logs: LogSet, check: LogSet, *, effects: Sequence[Effect] = (), report: Report = lambda m: None
) -> tuple[HeldOut, list[Step]]:
    """Held-out state of the baseline, and the effects added one after the other."""
    baseline = held_out(fit.robot, check)
    steps: list[Step] = []
    current, state = fit, baseline
    while not state.adequate and len(steps) < MOST_EFFECTS:
        remaining = [*catalogue(current.robot), *(e for e in effects if e.id not in _present(current))]
        step = name_next(current, state, fit_logs, check, remaining, report)
        if step is None:
            break
        steps.append(step)
        current, state = step.chosen.fit, step.chosen.check
        report(f"added {step.chosen.candidate.effect.id}: held-out {state.normalised_rms:.3f} x noise")
    return baseline, steps


def _present(fit: Fit) -> set[str]:
    return {effect.id for effect in fit.robot.effects}

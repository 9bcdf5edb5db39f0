"""Refits of a model with each of several candidates."""

from collections.abc import Callable, Sequence

import numpy as np

from ...logs import LogSet
from ...robots.robot import Robot
from ..screening.screen import Candidate
from .refit import FEW_STEPS, Trial, compile_refits, refit
from .short_windows import starts_from, windows_to_look_in

Report = Callable[[str], None]

_NEAR = 0.01
"""Share of an effect's first guess with which it is hardly there."""


def with_candidate(robot: Robot, candidate: Candidate) -> Robot:
    """The robot with the candidate's effect, what that does not let vary at what the first look found."""
    robot = robot + candidate.effect
    for name in candidate.held:
        robot = robot.change(name, free=False)
    fixed = {n: v for n, v in candidate.starts[0].items() if not robot.parameters[n].free}
    return robot.with_values(**fixed)


def all_added(
    base: Trial,
    candidates: Sequence[Candidate],
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
    before: Sequence[Trial] = (),
) -> list[Trial]:
    """A few steps of the refit with each of the candidates; last those that are dear to follow up, which are not where they
    explain less than one of those, or of the trials `before`."""
    candidates = sorted(candidates, key=lambda candidate: candidate.effect.repeats)
    robots = [with_candidate(base.robot, candidate) for candidate in candidates]
    if robots:
        say(f"compiling the refits with {', '.join(candidate.effect.title for candidate in candidates)}")
    compile_refits(robots, logs, base.angles)
    windows = windows_to_look_in(base, logs)
    trials: list[Trial] = []
    for number, (robot, candidate) in enumerate(zip(robots, candidates, strict=True), start=1):
        say(f"refitting with {candidate.effect.title}, {number} of {len(robots)}")
        rival = min((trial.squares for trial in (*before, *trials)), default=np.inf)
        states = base.initial_states
        starts = starts_from(robot, candidate.starts, windows, noise)
        trial = refit(robot, starts, logs, held_out, noise, states, FEW_STEPS, rival, base.angles)
        if not (trial.squares < base.squares or candidate.effect.repeats):
            # Worse than without the effect: where the logs do not tell its parameters one by one, a first guess may be far off.
            own = f"{candidate.effect.id}."
            table = robot.parameters
            near = {n: table[n].inside(_NEAR * x) for n, x in candidate.starts[0].items() if n.startswith(own)}
            again = refit(robot, [near], logs, held_out, noise, states, FEW_STEPS, rival, base.angles)
            trial = again if again.score < trial.score else trial
        trials.append(trial)
    return trials

"""What candidates may ask of the logs in a first look, and how the laws of a mechanism stand in one model."""

from collections.abc import Iterable, Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ...robots.effect import Effect
from ...robots.probe import Seen
from ...robots.robot import Robot
from ..where.conditions import motions
from .ripple_periods import NO_RIPPLES, Periods, Ripples, ripple_periods


def seen_in(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float],
    known_states: Mapping[str, Mapping[str, float]],
    repeating: Effect | None,
) -> Seen:
    """What effects ask of the logs. `robot` is the model without the candidates; `repeating` one of them that repeats with the
    wheels, if any does."""

    @cache
    def path() -> NDArray[np.float64] | None:
        paths = [motion.path for motion in motions(robot, logs) if motion.path is not None]
        return np.concatenate(paths) if paths else None

    @cache
    def ripples() -> Ripples:
        return ripple_periods(robot + repeating, logs, noise, known_states) if repeating is not None else NO_RIPPLES

    def periods(by_torque: bool) -> Periods:
        return ripples().by_torque if by_torque else ripples().steady

    duration = max(float(log.time[-1] - log.time[0]) for log in logs)
    largest = max(float(np.max(np.abs(log.inputs))) for log in logs)
    # Where all commands are zero, any size is one that none of them reaches.
    return Seen(largest if largest > 0 else robot.scales.input, duration, path, periods)


def standing_together(effects: Iterable[Effect]) -> list[tuple[Effect, Effect]]:
    """Each effect, and the same under a name of its own, so that all laws of a mechanism can stand in one model."""
    return [(effect, effect.standing_as(f"{effect.id}:{effect.law}") if effect.law else effect) for effect in effects]

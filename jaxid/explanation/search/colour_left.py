"""Whether all that a model leaves is coloured noise, and candidates ranked where it is."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..._distributions import chi_squared_beyond
from ...estimate.output_error.estimated_start import estimated_start
from ...estimate.output_error.feedback import closed
from ...logs import LogSet
from ...robots.effect import Effect
from ...simulation.scaled import scales_of
from ..left.at_rest import held_rates, in_motion, shown_at_rest, standing
from ..left.coloured import GATES, OnlyColour, colours_of, mostly_rounding, only_colour
from ..left.heldout import HeldOut, held_out_state
from ..left.noisy_inputs import noise_of_inputs
from ..level import current_level
from ..policy import current_policy
from ..refits.refit import Trial
from ..screening.absorbed import less_absorbed
from ..screening.screen import Candidate, screen
from .in_colour import generalised, in_colour
from .telling_apart import not_told_apart
from .worth import matters, worth_in_colour

_COUNTED = 2.0
"""By how much more chance explains where rounding makes most of what a channel leaves (8 where 7.6 is the most expected, of a
complete model whose speed is counted in steps of three standard deviations)."""
_QUIET = 0.02
"""Share of a noise's variance below which a sensor at rest says nothing of it."""
_MOST_LEADING = 4
"""Trials of which it is asked whether all that they leave is coloured noise."""


def _states(trial: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> list[tuple[HeldOut, LogSet]]:
    """What a model leaves, on the held-out and on the fitted logs."""
    return [(trial.held_out, held_out), (held_out_state(trial.robot, logs, noise, trial.angles), logs)]


def colour_left(trial: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> OnlyColour | None:
    """The coloured noise that is all that `trial` leaves, as far as what drove the robot tells; None where it is not."""
    scales = scales_of(trial.robot, logs)
    states = _states(trial, logs, held_out, noise)
    states = states if trial.angles else less_absorbed(trial.robot, states)
    memory = scales.time / scales.interval
    found = only_colour(states, memory)
    if found is None and not trial.angles and _closed(states):
        found = only_colour(states, memory, fed_back=True)
        found = None if found is None or found.fed_back else found
    if trial.angles or any(state.diverged for state, _ in states) or not held_rates(trial.robot).any():
        return found
    still = standing(trial.robot, states)
    if found is not None and found.simple:
        # A sensor whose noise grows with the speed has no noise at rest, as a counter; what shows less of it is another.
        less = shown_at_rest(trial.robot, states, still, found.colours, scales, quiet=_QUIET) is False
        return replace(found, simple=False, at_rest=False) if less else found
    if found is not None:
        return replace(found, at_rest=shown_at_rest(trial.robot, states, still, found.colours, scales))
    # A disturbance that dry friction holds is not as large at rest as in motion.
    found = only_colour(in_motion(states, still), memory)
    if found is None or found.simple or shown_at_rest(trial.robot, states, still, found.colours, scales) is not False:
        return None
    return replace(found, at_rest=False)


def _closed(states: Sequence[tuple[HeldOut, LogSet]]) -> bool:
    """Whether a controller makes commands of what is left."""
    if any(state.diverged for state, _ in states):
        return False
    residuals = [own for state, _ in states for own in state.residuals]
    return closed([log for _, own in states for log in own], residuals, states[0][1].channels.inputs)


def noise_fed_back(trial: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> OnlyColour | None:
    """What `trial` leaves if by its shape it is coloured noise, and a controller makes commands of it; else None."""
    if trial.angles or trial.held_out.diverged or trial.fitted.diverged:
        return None
    states = _states(trial, logs, held_out, noise)
    if not _closed(states):
        return None
    scales = scales_of(trial.robot, logs)
    return only_colour(states, scales.time / scales.interval, fed_back=True)


def inputs_left(trial: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> OnlyColour | None:
    """What `trial` leaves if noise of the inputs makes all of it; else None."""
    if trial.angles or trial.held_out.diverged or trial.fitted.diverged:
        return None
    states = _states(trial, logs, held_out, noise)
    level = trial.held_out.false_alarm / GATES
    inputs = noise_of_inputs(trial.robot, states, noise, scales_of(trial.robot, logs), level)
    if inputs is None:
        return None
    colours = {name: own for name, own in colours_of([state for state, _ in states]).items() if own.order}
    return OnlyColour(colours, simple=False, faster=False, p_value=inputs.p_value, of_inputs=inputs)


def generalised_trial(trial: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> Trial:
    """The trial's model estimated anew for coloured noise such as it leaves, to be screened."""
    colours = colours_of([state for state, _ in _states(trial, logs, held_out, noise)])
    return replace(trial, robot=generalised(trial.robot, logs, noise, colours, trial.angles))


def ranked_in_colour(
    base: Trial,
    trials: Sequence[Trial],
    first: Trial,
    tried: int,
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
) -> tuple[list[Trial], tuple[str, ...], bool] | None:
    """The trials ranked anew, those that cannot be told from the best, and whether that one is worth its price, where all that
    the best leaves is coloured noise: samples of it are related, so that chi-squared promises too much. Else None. Where the
    best explains next to nothing, it may follow that noise, and one of the next be right that leaves it."""
    if trials[0].held_out.adequate:
        return None
    follows = trials[0].fitted.gap > (1.0 - current_policy().least_gain) * base.fitted.gap
    leading = trials[: _MOST_LEADING if follows else 1]
    only = next((trial for trial in leading if colour_left(trial, logs, held_out, noise) is not None), None)
    if only is None:
        return None
    colours = colours_of([state for state, _ in _states(only, logs, held_out, noise)])
    white = {trial.id: in_colour(trial, colours, logs, held_out, noise) for trial in trials}
    ranked = sorted(trials, key=lambda trial: white[trial.id].score)
    ranked = [replace(trial, in_colour=white[trial.id].score) for trial in ranked]
    before, after = in_colour(base, colours, logs, held_out, noise), white[ranked[0].id]
    worth = matters(base, ranked[0], first) and worth_in_colour(before, after, tried)
    return ranked, not_told_apart([white[trial.id] for trial in ranked]), worth


def leaves_only_colour(
    before: Trial, after: Trial, tried: int, logs: LogSet, held_out: LogSet, noise: dict[str, float]
) -> bool:
    """Whether all that `after` leaves is coloured noise of the sensors, and its effect worth its price in whitened samples."""
    only = colour_left(after, logs, held_out, noise)
    if only is None or not only.of_sensors:
        return False
    colours = colours_of([state for state, _ in _states(after, logs, held_out, noise)])
    one, other = (in_colour(trial, colours, logs, held_out, noise) for trial in (before, after))
    return worth_in_colour(one, other, tried)


def explaining(screened: Sequence[Candidate], counted: bool = False) -> list[Candidate]:
    """The candidates that explain more than chance of a coloured residual, best first; their number is accounted for, and
    whether a channel is `counted` coarsely: rounding errors stay as long as the motion, and chance follows more of them."""
    count = max(len(screened), 1)
    price = 2.0 * float(np.log(count))
    if screened:
        # On short logs the usual price of a parameter, log samples, lets more pass by chance than the level has room for.
        chance = current_level() / (2 * GATES * count)
        price = max(price, float(chi_squared_beyond(chance, 1)) - float(np.log(screened[0].direction.size)))
    price *= _COUNTED if counted else 1.0
    return sorted((c for c in screened if c.in_colour > price), key=lambda c: -c.in_colour)


def explained_somewhere(
    base: Trial,
    effects: Sequence[Effect],
    screened: Sequence[Candidate],
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
) -> bool:
    """Whether a candidate explains part of the whitened residual, on the fitted logs or on these and the held-out ones."""
    states = _states(base, logs, held_out, noise)
    colours = colours_of([state for state, _ in states])
    counted = any(mostly_rounding(states, *own) for own in colours.items())
    if not base.angles and _closed(states):
        # What looks ahead finds there what the controller has made of the noise.
        causal = [effect for effect in effects if not effect.ahead]
        again = screen(base.robot, logs, causal, noise, base.initial_states, colours=colours)
        return bool(explaining(again, counted))
    if explaining(screened, counted) or base.angles:
        return bool(explaining(screened, counted))
    begun = estimated_start(base.robot, held_out, noise)
    starts = {log.name: {name: float(begun[name][e]) for name in begun} for e, log in enumerate(held_out)}
    every = screen(base.robot, LogSet([*logs, *held_out]), effects, noise, {**base.initial_states, **starts})
    return bool(explaining(every, counted))

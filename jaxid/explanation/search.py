"""Naming: refit the shortlist, rank by likelihood on the fitted logs, go on until nothing but noise is left or nothing helps.

Which names compare with which, and which is best, the fitted logs say alone. The held-out logs judge: whether anything is
missing, and whether what ranked first is believed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .._distributions import chi_squared_beyond
from ..effects import catalogue, laws_of
from ..effects.curve import SHAPE
from ..effects.table_constants import TableConstants
from ..estimate.output_error.estimated_start import estimated_start
from ..estimate.result import Fit
from ..logs import LogSet, noise_scale
from ..robots.effect import Effect
from ..robots.robot import Robot
from ..simulation.scaled import scaled_to, scales_of
from .absorbed import less_absorbed
from .coloured import GATES, OnlyColour, colours_of, only_colour
from .denser import densest
from .heldout import HeldOut, held_out_state
from .in_colour import generalised, in_colour
from .laws import best_first, by_law, by_where_they_bend, with_the_same_curves
from .level import current_level
from .policy import current_policy
from .refit import FEW_STEPS, Trial, compile_refits, continued, refit
from .screen import Candidate, screen
from .table_constants import constants_instead
from .telling_apart import alike, not_told_apart, simplest_first, supersets
from .within_errors import within_errors
from .worth import coarseness, could_matter, least_gain, matters, worth_in_colour, worth_it

_MOST_ALIKE = 4
_FIRST_TRIALS = 2
MOST_EFFECTS = 3
_FROM_COLOUR = 2
"""Most candidates that are refitted only because they explain the whitened residual."""

Report = Callable[[str], None]


@dataclass(frozen=True)
class Step:
    """One effect added: the trials, one of every mechanism by its best law, best first, and the ids that the data cannot tell
    from the best. `laws` are the trials of that one's laws, best first, of which the data cannot tell the first from
    `laws_alike`.

    `before` and `after` are the model without it and with it at the time it was added.
    """

    trials: tuple[Trial, ...]
    equivalent: tuple[str, ...]
    screened: tuple[Candidate, ...] = field(repr=False)
    before: Trial = field(repr=False)
    after: Trial = field(repr=False)
    laws: tuple[Trial, ...] = ()
    laws_alike: tuple[str, ...] = ()

    @property
    def chosen(self) -> Trial:
        """The trial that was added."""
        return self.trials[0]


@dataclass(frozen=True)
class Search:
    """What naming found: how the fit and the `final` model (None where nothing is missing) do on the held-out logs, the
    effects in the order in which they were added, and the candidates of the first look. `colour` where all that is left is
    coloured noise."""

    before: HeldOut
    after: HeldOut
    final: Trial | None
    steps: tuple[Step, ...]
    first_look: tuple[Candidate, ...]
    colour: OnlyColour | None = None


def _different(likely: Sequence[Candidate]) -> list[Candidate]:
    """The most promising candidates, one of each that explain alike.

    Those with prescribed wheels' angles promise more than the others can; they come on top and displace none.
    """
    prescribed = [candidate for candidate in likely if candidate.effect.repeats]
    others = [candidate for candidate in likely if candidate not in prescribed]
    chosen: list[Candidate] = []
    policy = current_policy()
    for candidate in others:
        enough = len(chosen) >= policy.first_refits and candidate.gain < policy.promising * others[0].gain
        if enough or len(chosen) == policy.most_refits:
            break
        if not any(candidate.like(other) for other in chosen):
            chosen.append(candidate)
    return chosen + [candidate for candidate in prescribed if candidate.gain >= policy.promising * likely[0].gain]


def _with_candidate(robot: Robot, candidate: Candidate) -> Robot:
    """The robot with the candidate's effect, what that does not let vary at what the first look found."""
    robot = robot + candidate.effect
    for name in candidate.held:
        robot = robot.change(name, free=False)
    fixed = {n: v for n, v in candidate.starts[0].items() if not robot.parameters[n].free}
    return robot.with_values(**fixed)


def _all_added(
    base: Trial, candidates: Sequence[Candidate], logs: LogSet, held_out: LogSet, noise: dict[str, float], say: Report
) -> list[Trial]:
    """A few steps of the refit with each of the candidates; last those that are dear to follow up."""
    candidates = sorted(candidates, key=lambda candidate: candidate.effect.repeats)
    robots = [_with_candidate(base.robot, candidate) for candidate in candidates]
    if robots:
        say(f"compiling the refits with {', '.join(candidate.effect.title for candidate in candidates)}")
    compile_refits(robots, logs, base.angles)
    trials: list[Trial] = []
    for number, (robot, candidate) in enumerate(zip(robots, candidates, strict=True), start=1):
        say(f"refitting with {candidate.effect.title}, {number} of {len(robots)}")
        rival = min((trial.squares for trial in trials), default=np.inf)
        states = base.initial_states
        trials.append(refit(robot, candidate.starts, logs, held_out, noise, states, FEW_STEPS, rival, base.angles))
    return trials


def _best(candidates: Sequence[Candidate], trials: Sequence[Trial]) -> tuple[Candidate, Trial]:
    """The candidate that did best, and its trial."""
    best = min(trials, key=lambda trial: trial.score)
    return next(candidate for candidate in candidates if candidate.effect.id == best.id), best


def _states(trial: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> list[tuple[HeldOut, LogSet]]:
    """What a model leaves, on the held-out and on the fitted logs."""
    return [(trial.held_out, held_out), (held_out_state(trial.robot, logs, noise, trial.angles), logs)]


def _colour(trial: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> OnlyColour | None:
    """The coloured noise that is all that `trial` leaves, as far as what drove the robot tells; None where it is not."""
    scales = scales_of(trial.robot, logs)
    states = _states(trial, logs, held_out, noise)
    states = states if trial.angles else less_absorbed(trial.robot, states)
    return only_colour(states, scales.time / scales.interval)


def _generalised(trial: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> Trial:
    """The trial's model estimated anew for coloured noise such as it leaves, to be screened."""
    colours = colours_of([state for state, _ in _states(trial, logs, held_out, noise)])
    return replace(trial, robot=generalised(trial.robot, logs, noise, colours, trial.angles))


def _ranked_in_colour(
    base: Trial,
    trials: Sequence[Trial],
    first: Trial,
    tried: int,
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
) -> tuple[list[Trial], tuple[str, ...], bool] | None:
    """The trials ranked anew, those that cannot be told from the best, and whether that one is worth its price, where all that
    the best leaves is coloured noise: samples of it are related, so that chi-squared promises too much. Else None."""
    best = trials[0]
    if best.held_out.adequate or _colour(best, logs, held_out, noise) is None:
        return None
    colours = colours_of([state for state, _ in _states(best, logs, held_out, noise)])
    white = {trial.id: in_colour(trial, colours, logs, held_out, noise) for trial in trials}
    ranked = sorted(trials, key=lambda trial: white[trial.id].score)
    ranked = [replace(trial, in_colour=white[trial.id].score) for trial in ranked]
    before, after = in_colour(base, colours, logs, held_out, noise), white[ranked[0].id]
    worth = matters(base, ranked[0], first) and worth_in_colour(before, after, tried)
    return ranked, not_told_apart([white[trial.id] for trial in ranked]), worth


def _explaining(screened: Sequence[Candidate]) -> list[Candidate]:
    """The candidates that explain more than chance of a coloured residual, best first; their number is accounted for."""
    count = max(len(screened), 1)
    price = 2.0 * float(np.log(count))
    if screened:
        # On short logs the usual price of a parameter, log samples, lets more pass by chance than the level has room for.
        chance = current_level() / (2 * GATES * count)
        price = max(price, float(chi_squared_beyond(chance, 1)) - float(np.log(screened[0].direction.size)))
    return sorted((c for c in screened if c.in_colour > price), key=lambda c: -c.in_colour)


def _explained_somewhere(
    base: Trial,
    effects: Sequence[Effect],
    screened: Sequence[Candidate],
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
) -> bool:
    """Whether a candidate explains part of the whitened residual, on the fitted logs or on these and the held-out ones."""
    if _explaining(screened) or base.angles:
        return bool(_explaining(screened))
    begun = estimated_start(base.robot, held_out, noise)
    states = {log.name: {name: float(begun[name][e]) for name in begun} for e, log in enumerate(held_out)}
    every = screen(base.robot, LogSet([*logs, *held_out]), effects, noise, {**base.initial_states, **states})
    return bool(_explaining(every))


def name_next(
    base: Trial,
    first: Trial,
    screened: Sequence[Candidate],
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> Step | None:
    """The best effect to add to `base` of those `screened`, None if none explains enough."""
    likely = [c for c in screened if c.gain > 0]
    say("first look: " + (", ".join(f"{c.effect.id} {100 * c.share:.0f} %" for c in likely[:6]) or "no candidate"))
    if not likely:
        return None
    shortlist = _different(likely)
    # What coloured noise has hidden from the first order.
    shortlist += [c for c in _explaining(screened)[:_FROM_COLOUR] if c not in shortlist]
    trials = _all_added(base, shortlist[:_FIRST_TRIALS], logs, held_out, noise, say)
    leader, best = _best(shortlist, trials)
    policy = current_policy()
    least = policy.rival * leader.gain if best.fitted.adequate else -np.inf
    shortlist = [c for c in shortlist if c.gain >= least or c in shortlist[:_FIRST_TRIALS]]
    trials += _all_added(base, shortlist[_FIRST_TRIALS:], logs, held_out, noise, say)
    leader, _ = _best(shortlist, trials)
    alike_to_it = [c for c in likely if c.like(leader) and c not in shortlist][:_MOST_ALIKE]
    trials += _all_added(base, alike_to_it, logs, held_out, noise, say)
    best = min(trials, key=lambda t: t.score)
    near = best.score + max(100.0, policy.in_the_running * (base.score - best.score))
    promising = base.held_out.normalised_rms - best.held_out.normalised_rms > 0.5 * least_gain(base, first)

    def to_the_end(tried: Sequence[Trial]) -> list[Trial]:
        running = [t for t in tried if promising and t.score < near]
        ended = {}
        for number, trial in enumerate(running, start=1):
            say(f"refitting to the end with {trial.title}, {number} of {len(running)}")
            ended[id(trial)] = continued(trial, logs, held_out, noise)
        return [ended.get(id(t), t) for t in tried]

    def added(further: Sequence[Candidate]) -> list[Trial]:
        return to_the_end(_all_added(base, further, logs, held_out, noise, say))

    def again(robot: Robot, like: Trial) -> Trial:
        start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
        return refit(robot, [start], logs, held_out, noise, like.initial_states, angles=like.angles)

    mechanisms = by_law([*shortlist, *alike_to_it], to_the_end(trials), near, added, base.score)
    mechanisms = with_the_same_curves(mechanisms, screened, added)
    if not mechanisms[0][0].fitted.adequate:
        leading, others = mechanisms[:_FIRST_TRIALS], mechanisms[_FIRST_TRIALS:]
        leading = [[densest(trial, again) for trial in own] for own in leading]
        mechanisms = sorted((best_first(own) for own in [*leading, *others]), key=lambda own: own[0].score)
    mechanisms = by_where_they_bend(mechanisms, base)
    trials = [own[0] for own in mechanisms]
    tried = _looked_at(screened, trials[0])
    in_colour = _ranked_in_colour(base, trials, first, tried, logs, held_out, noise)
    if in_colour is None:
        trials = simplest_first(trials)
        # Where a curve is the answer, its few points are no evidence against another mechanism's.
        closed = trials[0].fitted.gap < policy.unexplained * base.fitted.gap
        slack = coarseness(True, base.fitted) if closed and trials[0].law == SHAPE else 0.0
        equivalent = tuple(name for name in not_told_apart(trials, slack) if name not in supersets(trials))
        worth = worth_it(base, trials[0], first, tried)
    else:
        trials, equivalent, worth = in_colour
    for trial in trials:
        say(
            f"refitted with {trial.title}: held-out {trial.held_out.normalised_rms:.3f} x noise, score {trial.score:.0f}"
        )
    if not worth:
        return None
    laws = next(own for own in mechanisms if own[0].id == trials[0].id)
    same = tuple(trial.law for trial in alike(laws))
    return Step(tuple(trials), equivalent, tuple(screened), base, trials[0], tuple(laws), same)


def _or_constants(
    found: Step | None,
    base: Trial,
    first: Trial,
    screened: Sequence[Candidate],
    logs: LogSet,
    held_out: LogSet,
    say: Report,
) -> Step | None:
    """The step as it was found, or that to right values of the table where no formula reaches the noise and they do better."""
    best = found.chosen if found is not None else None
    settled = best is not None and best.fitted.adequate and best.law != SHAPE
    if settled or (best is not None and best.in_colour is not None):
        return found
    if any(effect.id == TableConstants.id for effect in base.robot.effects):
        return found
    say("looking whether constants of the table explain more")
    trial = constants_instead(base, best, logs, held_out)
    if trial is None or not worth_it(base, trial, first, max(len(screened), 1)):
        return found
    say(f"refitted with other constants of the table: held-out {trial.held_out.normalised_rms:.3f} x noise")
    trials = (trial, *(found.trials if found is not None else ()))
    equivalent = tuple(name for name in not_told_apart(trials) if name not in supersets(trials))
    return Step(trials, equivalent, tuple(screened), base, trial, (trial,))


def _looked_at(screened: Sequence[Candidate], trial: Trial) -> int:
    """How many candidates were looked at: laws, and the shapes of the one that was chosen."""
    laws = [law for candidate in screened for law in (candidate, *candidate.laws)]
    return len(laws) * next((c.out_of for c in laws if (c.effect.id, c.effect.law) == (trial.id, trial.law)), 1)


def _with_effects(base: Robot, owners: Mapping[str, Robot]) -> Robot:
    """`base` with the effects that `owners` names and it has not got, each as its owner has it: the values of its parameters,
    and which of them vary (a curve's reach and some of its heights do not)."""
    robot = base
    present = {effect.id for effect in base.effects}
    for identifier, owner in owners.items():
        if identifier in present:
            continue
        robot = robot + next(effect for effect in owner.effects if effect.id == identifier)
        for name in [name for name in robot.parameters if name.startswith(f"{identifier}.")]:
            known = owner.parameters[name]
            robot = robot.change(name, free=known.free).with_values(**{name: known.value})
    return robot


def _refitted(robot: Robot, like: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> Trial:
    """`robot` refitted from the numbers that it shares with the trial `like`, and from its own where it shares none."""
    known = like.robot.parameters
    own = {effect.id for effect in robot.effects} - {effect.id for effect in like.robot.effects}
    start = {n: p.value for n, p in robot.parameters.items() if p.free}
    start |= {n: known[n].value for n in start if n in known and n.split(".")[0] not in own}
    angles = like.angles if robot.needs("wheel_angles") else None
    return refit(robot, [start], logs, held_out, noise, like.initial_states, angles=angles)


def _pruned(current: Trial, base: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float], say: Report) -> Trial:
    """Drop effects that later ones made superfluous."""
    given = {effect.id for effect in base.robot.effects}
    own = [effect.id for effect in current.robot.effects if effect.id not in given]
    for identifier in own[:-1]:
        say(f"refitting without {identifier}")
        kept = {effect.id: current.robot for effect in current.robot.effects if effect.id != identifier}
        trial = _refitted(_with_effects(base.robot, kept), current, logs, held_out, noise)
        if trial.score < current.score + 10.0:
            say(f"{identifier} is not needed any more")
            current = trial
    return current


def _reconsidered(
    steps: list[Step], final: Trial, base: Trial, logs, held_out, noise, say: Report
) -> tuple[list[Step], Trial]:
    """Look again at the rivals of each of several effects, now that the others are there.

    A name that came first while another effect was still missing may have won, or lost, by that effect's doing.
    """
    if len(steps) < 2:
        return steps, final
    revised = []
    for step in steps:
        present = {effect.id for effect in final.robot.effects}
        if step.chosen.id not in present:
            revised.append(step)
            continue
        gain = max(t.score for t in step.trials) - step.chosen.score
        rivals = [t for t in step.trials[1:] if t.score - step.chosen.score < 0.2 * gain and t.id not in present][:3]
        trials = [replace(final, id=step.chosen.id)]
        for number, rival in enumerate(rivals, start=1):
            say(f"refitting with {rival.title} instead of {step.chosen.title}, {number} of {len(rivals)}")
            owners = {effect.id: final.robot for effect in final.robot.effects}
            owners = {
                rival.id if i == step.chosen.id else i: rival.robot if i == step.chosen.id else r
                for i, r in owners.items()
            }
            swapped = _refitted(_with_effects(base.robot, owners), final, logs, held_out, noise)
            trials.append(replace(swapped, id=rival.id))
            say(f"{rival.id} instead of {step.chosen.id}: held-out {swapped.held_out.normalised_rms:.3f} x noise")
        if TableConstants.id not in present:
            owners = {effect.id: final.robot for effect in final.robot.effects if effect.id != step.chosen.id}
            bare = _refitted(_with_effects(base.robot, owners), final, logs, held_out, noise)
            right = constants_instead(bare, min(trials, key=lambda t: t.score), logs, held_out)
            if right is not None:
                say(f"other constants instead of {step.chosen.id}: held-out {right.held_out.normalised_rms:.3f} x noise")
                trials.append(right)
        trials.sort(key=lambda t: t.score)
        final = trials[0]
        if len(trials) > 1:
            others = tuple(t for t in step.trials if t.id not in {trial.id for trial in trials})
            step = replace(step, trials=(*trials, *others), equivalent=not_told_apart(trials))
        revised.append(step)
    return revised, final


def search(
    fit: Fit,
    logs: LogSet,
    held_out: LogSet,
    *,
    effects: Sequence[Effect] = (),
    most: int = MOST_EFFECTS,
    report: Report = lambda message: None,
) -> Search:
    """Add effects to a fitted model as long as they explain something. `effects` are further candidates."""
    noise = noise_scale(held_out, otherwise=logs)
    fit = replace(fit, robot=scaled_to(fit.robot, logs))
    state = held_out_state(fit.robot, held_out, noise)
    if not state.adequate:
        state = within_errors(fit, held_out, state)
    if state.adequate:
        return Search(state, state, None, (), ())
    report(f"held-out error {state.normalised_rms:.3f} x noise; fitting again with the held-out logs' noise")
    # With the same weights as the refits, so that likelihoods compare.
    start = {name: fit.robot.parameters[name].value for name in fit.free_names}
    baseline = current = refit(fit.robot, [start], logs, held_out, noise, fit.initial_states)
    first_look: tuple[Candidate, ...] = ()
    steps: list[Step] = []
    colour = None
    while not current.held_out.adequate:
        colour = _colour(current, logs, held_out, noise)
        if not could_matter(current, baseline):
            colour = None  # too little to be looked at any further
            break
        if colour is None and len(steps) >= most:
            break
        present = {effect.id for effect in current.robot.effects}
        own = [law for effect in catalogue(current.robot) for law in laws_of(current.robot, effect.id)]
        remaining = [effect.blurred for effect in (*own, *effects) if effect.id not in present]
        count = len({effect.id for effect in remaining})
        report(f"first look at {count} candidates by {len(remaining)} laws")
        shown = current if colour is None else _generalised(current, logs, held_out, noise)
        screened = screen(shown.robot, logs, remaining, noise, shown.initial_states, shown.angles)
        first_look = first_look or tuple(screened)
        if colour is not None and _explained_somewhere(shown, remaining, screened, logs, held_out, noise):
            colour = None
        if len(steps) >= most or colour is not None:
            break
        found = name_next(current, baseline, screened, logs, held_out, noise, report)
        found = _or_constants(found, current, baseline, screened, logs, held_out, report)
        if found is None:
            break
        steps.append(found)
        current = replace(found.chosen, in_colour=None)
        if len(steps) > 1:
            current = _pruned(current, baseline, logs, held_out, noise, report)
        report(f"added {found.chosen.id}: held-out {current.held_out.normalised_rms:.3f} x noise")
    if colour is not None:
        report(f"what is left is coloured noise: {colour.phrase}")
    steps, current = _reconsidered(steps, current, baseline, logs, held_out, noise, report)
    return Search(state, current.held_out, current, tuple(steps), first_look, colour)

"""Design of experiments: the drivable input from which output error will learn most.

Candidates of one family (steps, staircases, binary sequences, random levels, sweeps, multisines, in every direction the
robot can be driven) are simulated as lanes of one compiled program and judged by the log determinant of the Fisher
information (D-optimality: Fedorov, Theory of Optimal Experiments, 1972; Goodwin & Payne, Dynamic System Identification,
1977, chapter 6). The best are then improved by random exchanges of stretches and spectral lines, a batch at a time.

The information is a linearisation, and a sharp search finds where that is worth nothing: inputs that balance a caster on
the verge of flipping have enormous sensitivities and teach nothing. So every candidate is also simulated with parameters
that are off, up and down: the least information counts, and where the outputs do not go where the sensitivities say, the
candidate is out.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .._origin import with_origin
from ..estimate.confidence.agreement import agreement, errors_of
from ..estimate.judge import POOR, drivers
from ..estimate.noise_colour import colour_of
from ..estimate.residual_tests import relation
from ..estimate.result import Fit
from ..logs import LogSet, noise_level, noise_scale
from ..robots.given import check_free
from ..robots.meanings import meanings_of
from ..robots.robot import Robot
from ..robots.scales import time_constant
from ..simulation.excitation import Drive, binary, combined_modes, plain_shapes, shifted, single_modes, tuned_shapes
from ..simulation.simulate import simulate
from .candidates import Candidates, Judge
from .designed import Design, PlannedRun
from .exchange import changed
from .information import LANES, Laboratory, criterion, known, std_errors
from .limits import DesignError, Limits, binding, limit_in_words, make_limits, path

Array = NDArray[np.float64]
_LEVELS = (0.15, 0.3, 0.6, 1.0)
"""Sizes of the family's inputs, in units of the limit."""
_SMALLER = ((1.0, 1.0), (1.0, 0.2), (0.5, 0.5), (0.25, 0.2))
"""Shares of these sizes, and of the robot's rise time, that are tried one after the other, until something keeps to the limits
of the motion: a robot that turns round sooner stays nearer."""
_MOVES = 0.05
"""Share of a limit of the motion that inputs need which move the robot."""
_ELITE = 8
_LOOKED_AT = 3 * LANES
"""Candidates of the family, best first, that are looked at with all three sets of parameters."""
_CHILDREN = 2 * LANES
_FEWEST_SAMPLES = 20
_TIME_CONSTANTS, _A_TIME_CONSTANT = 100, 10
"""Length of an experiment in time constants of the robot, and samples in each."""
_FOLLOWS = 0.01
"""p value below which what a model leaves follows what drove the robot, and is no noise."""
_LEAST_GAIN = 1.0
"""Gain in log det below which an experiment teaches nothing."""


def _motions(robot: Robot) -> list[Array]:
    """Directions in which the inputs drive one output each (the channels' `mixing`), the largest entry one."""
    gains = [np.asarray(g, float) for g in robot.channels.mixing.values()]
    return [g / np.max(np.abs(g)) for g in gains]


def _directions(robot: Robot) -> Array:
    """Directions of driving [m, nu]: single motions and single inputs."""
    count = len(robot.channels.inputs)
    return np.array([*(_motions(robot) if count > 1 else []), *np.eye(count)])


def _rise_time(laboratory: Laboratory, limits: Limits) -> float:
    """Median time [s] in which the speed of each of the robot's motions reaches 63 % of its last value after a step."""
    directions = _motions(laboratory.robot) or list(np.eye(len(limits.inputs)))
    samples = len(laboratory.time)
    steps = np.stack([np.tile(limits.inputs * d, (samples, 1)) for d in directions])
    outputs = laboratory.run(steps).outputs[:, :, : len(laboratory.robot.channels.outputs)]
    times = []
    for y in outputs:
        main = y[:, int(np.argmax(np.abs(y[-1])))]
        if np.all(np.isfinite(main)) and main[-1] != 0:
            times.append(float(laboratory.time[int(np.argmax(main / main[-1] >= 0.63))]))
    usual = float(np.median(times)) if times else float(laboratory.time[-1]) / 80
    return float(np.clip(usual, 2 * laboratory.interval, laboratory.time[-1] / 8))


def _family(robot: Robot, limits: Limits, duration: float, interval: float, rise: float) -> list[Drive]:
    """All candidates of the family, every input within its own limit."""
    shapes = plain_shapes(duration, interval) | tuned_shapes(duration, interval, rise)
    combined = combined_modes(robot.channels, shapes, _LEVELS, limits.inputs)
    return single_modes(robot, shapes, _LEVELS, limits.inputs) + combined


def _drivable(
    judge: Judge, robot: Robot, limits: Limits, seconds: float, interval: float, rise: float, base: Array
) -> tuple[list[Drive], Array, Candidates]:
    """The family, its inputs [m, T, nu], and those that are worth driving: as large as the inputs' own limits allow, or smaller
    where all of those break the limits of the motion. Raises `DesignError` where the smallest do, too."""
    pools, least = [], float(np.min(criterion(base))) + _LEAST_GAIN
    for share, sooner in _SMALLER:
        quick = max(sooner * rise, 2.0 * interval)
        family = _family(robot, replace(limits, inputs=share * limits.inputs), seconds, interval, quick)
        pools.append(np.stack([drive.inputs for drive in family]))
        found = judge(pools[-1], [drive.description for drive in family], base, least, _LOOKED_AT)
        if len(found.inputs):
            return family, pools[-1], found
    raise _impossible(limits, robot, [judge.shares(pool) for pool in pools])


def _kept(shares: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Which inputs [m] keep to all limits though they move the robot, by the shares of the limits that they need."""
    needed = np.max([*shares.values()], axis=0)
    return (needed > _MOVES) & (needed <= 1.0)


def _impossible(limits: Limits, robot: Robot, each: Sequence[Mapping[str, Array]]) -> DesignError:
    """Why nothing of families can be driven or teaches anything, by the shares of the limits that `each` of them needs, and
    what to change."""
    shares = each[0]
    if not shares:
        volts = ", ".join(f"{v:.4g}" for v in limits.inputs)
        return DesignError(
            f"With inputs of at most {volts} the robot hardly moves, or leaps with every change of its parameters; raise "
            "limit, or lower doubt."
        )
    # What inputs large enough to move the robot break most often.
    broken = {name: float(np.mean(share > 1.0)) for name, share in shares.items()}
    tightest = max(broken, key=lambda name: broken[name])
    if any(_kept(own).any() for own in each[1:]):
        return DesignError(
            f"What keeps to {limit_in_words(limits, robot.channels, tightest)} leaps with every change of the parameters, as "
            "where dry friction decides whether the robot moves at all; lower doubt, raise that limit, or shorten the "
            "experiment."
        )
    return DesignError(
        f"No input moves the robot and keeps to all limits: {limit_in_words(limits, robot.channels, tightest)} is broken by "
        f"{broken[tightest]:.0%} of those tried; raise it, or shorten the experiment."
    )


def _improved(judge: Judge, elite: Candidates, pool: Array, base: Array, rise: int, rounds: int, random, report):
    """The elite after `rounds` batches of random exchanges, with one another and with the pool's inputs [m, T, nu]."""
    directions = _directions(judge.laboratory.robot)
    for number in range(rounds):
        parents = random.integers(len(elite.inputs), size=_CHILDREN)
        others = [pool[random.integers(len(pool))] if random.random() < 0.5 else elite.inputs[i]
                  for i in random.integers(len(elite.inputs), size=_CHILDREN)]  # fmt: skip
        children = np.stack([
            changed(elite.inputs[p], other, judge.limits.inputs, directions, rise, random)
            for p, other in zip(parents, others, strict=True)
        ])  # fmt: skip
        floor = float(elite.scores[-1]) if len(elite.inputs) == _ELITE else -np.inf
        born = judge(children, [elite.titles[p] for p in parents], base, floor, LANES)
        elite = elite.with_others(born).best(_ELITE)
        report(f"{number + 1} of {rounds} rounds of exchanges, log det {elite.scores[0]:.2f}")
    return elite


def _prbs(robot: Robot, energy: float, laboratory: Laboratory, clock: float, number: int) -> Array:
    """What an engineer would take: a PRBS on every input, all different, of the given energy [unit² s]: [T, nu]."""
    samples, count = len(laboratory.time), len(robot.channels.inputs)
    signal = np.roll(binary(samples * laboratory.interval, laboratory.interval, clock), number * samples // 7)
    inputs = shifted(signal, count)
    return inputs * np.sqrt(energy / (np.sum(inputs**2) * laboratory.interval))


def _run(judge: Judge, name: str, title: str, inputs: Array) -> PlannedRun:
    laboratory, channels = judge.laboratory, judge.laboratory.robot.channels
    outputs = laboratory.run(inputs[None]).outputs[0]
    shares = {limit: float(share[0]) for limit, share in judge.shares(inputs[None]).items()}
    where = path(laboratory.robot, outputs, laboratory.interval)
    return PlannedRun(
        name, title, laboratory.time, inputs, outputs, where, channels, binding(judge.limits, channels, inputs, shares)
    )


@dataclass(frozen=True)
class _Left:
    """What the robot leaves of the logs so far: in units of the noise that neighbouring samples show, whether it diverges, and
    what channels have in the long run, where that is more than these show and what is left follows nothing that drove it."""

    normalised_rms: float
    diverged: bool
    long_run: Mapping[str, float]


def _left(robot: Robot, logs: LogSet) -> _Left:
    simulated = [np.asarray(y) for y in simulate(robot, logs)]
    found, noise = agreement(logs, simulated, noise_scale(logs)), noise_level(logs)
    if found.diverged:
        return _Left(found.normalised_rms, True, {})
    driving, long_run = drivers(logs, simulated), {}
    every = [errors_of(log, y) for log, y in zip(logs, simulated, strict=True)]
    for name in {name for own in every for name in own}:
        parts = [own.get(name, np.full(len(log), np.nan)) for own, log in zip(every, logs, strict=True)]
        colour = colour_of(parts)
        if colour.in_the_long_run > noise.get(name, np.inf) and relation(parts, driving)[0] > _FOLLOWS:
            long_run[name] = colour.in_the_long_run
    return _Left(found.normalised_rms, False, long_run)


def _noise(
    robot: Robot, noise: Mapping[str, float] | None, already: Fit | LogSet | None, left: _Left | None
) -> dict[str, float]:
    """Standard deviation of each output, of white noise that would tell as little. Raises `DesignError`."""
    found = dict(already.noise) if isinstance(already, Fit) else {}
    if isinstance(already, LogSet):
        found = {name: level for name, level in noise_level(already).items() if np.isfinite(level) and level > 0}
        found |= {name: level for name, level in (left.long_run if left else {}).items() if name in found}
    found |= dict(noise or {})
    channels = robot.channels
    for name, level in found.items():
        if name not in channels.measured or not (np.isfinite(level) and level > 0):
            raise DesignError(
                f"noise has {name!r} = {level}; give standard deviations above zero for {', '.join(channels.measured)}."
            )
    missing = [name for name in channels.outputs if name not in found]
    if missing and not all(channels.stood_in(name, found) for name in missing):
        raise DesignError(
            f"The noise of {', '.join(missing)} is not known; give noise = {{{missing[0]!r}: standard deviation}} "
            f"(--noise {missing[0]}=...), or a fit or logs as already (--already)."
        )
    # Optional channels count only where output error would use them: where they are states of the robot.
    return {name: float(level) for name, level in found.items() if name in (*channels.outputs, *robot.states)}


def _doubt(already: Fit | LogSet | None, left: _Left | None) -> str:
    """Why the model may not be that of the robot whose logs or fit are there, in a sentence; empty if nothing says so."""
    if isinstance(already, Fit):
        doubted = already.judgement is not None and not already.trustworthy
        return (
            f"The fit is doubtful, and so is this. {already.judgement.sentence}"
            if doubted and already.judgement
            else ""
        )
    if left is None or (not left.diverged and left.normalised_rms <= POOR):
        return ""
    how = "diverges" if left.diverged else f"leaves {left.normalised_rms:.3g} times the noise"
    if left.long_run:
        return (
            f"The model {how} that neighbouring samples show on the logs recorded so far, and it follows nothing that drove "
            "the robot: noise that is related from sample to sample, for which the standard errors allow, or something that "
            "the model lacks (`jaxid explain`)."
        )
    return (
        f"But the model {how} on the logs recorded so far, so that all this is for another robot than theirs: fit it to them "
        "first (`jaxid fit` writes model.toml) and design for that; where it was, it lacks something (`jaxid explain`)."
    )


def _usual_times(robot: Robot, already: Fit | LogSet | None) -> tuple[float, float]:
    """Length and sampling interval of an experiment like the logs so far, else by the robot's own time constant."""
    if isinstance(already, LogSet):
        median = float(np.median([log.duration for log in already]))
        return median, float(np.median([log.sampling_interval for log in already]))
    constant = time_constant(robot)
    if not (np.isfinite(constant) and constant > 0):
        raise DesignError("The robot has no time constant to go by; give seconds and interval.")
    # Two digits: somebody has to set them.
    interval = float(f"{constant / _A_TIME_CONSTANT:.1e}")
    return _TIME_CONSTANTS * _A_TIME_CONSTANT * interval, interval


@with_origin
def design_experiment(
    robot: Robot,
    *,
    limit: float | Sequence[float] | Mapping[str, float],
    seconds: float | None = None,
    interval: float | None = None,
    noise: Mapping[str, float] | None = None,
    already: Fit | LogSet | None = None,
    speeds: Mapping[str, float] | None = None,
    rectangle: tuple[float, float] | None = None,
    radius: float | None = None,
    experiments: int = 1,
    doubt: float = 0.1,
    rounds: int = 60,
    seed: int = 0,
    report: Callable[[str], None] = lambda message: None,
) -> Design:
    """Inputs that tell most about the free parameters of `robot`, driven from rest within its limits.

    **Arguments:**

    - `limit`: largest absolute input, one for all or one each, in the inputs' unit (usually volts).
    - `seconds`, `interval`: length and sampling interval of each experiment [s]. By default those of the logs recorded so
      far (`already`), else a hundred time constants of the robot at its parameters and a tenth of one.
    - `noise`: standard deviation by channel. `already`: a `Fit` or the logs recorded so far, to whose information the
      experiments shall add, and from which the noise is taken if it is not given. A fit also gives the parameters.
    - `speeds`: largest absolute value by output channel. `rectangle` (x, y) [m]: the path stays on a floor of this size,
      wherever on it the start is; `radius` [m]: within this distance of the start.
    - `experiments`: how many to choose, one after another, each knowing what the ones before tell.
    - `doubt`: how far the parameters may be off, as a share of their magnitude. Limits hold for these parameters too.
    - `rounds` of improvement, 64 inputs each; 0 takes the family's best as it is. `seed` of the random exchanges.
    - `report`: called with a sentence as the work goes on.

    Returns a `Design`. Raises `DesignError` for limits that nothing worth driving keeps to, and for numbers that make no
    sense; `ParameterError` if no parameter is free.
    """
    if isinstance(already, Fit):
        shared = {n: already.robot.parameters[n].value for n in already.free_names if n in robot.parameters}
        robot = robot.with_values(**shared)
    check_free(robot)
    usual = _usual_times(robot, already)
    seconds, interval = seconds or usual[0], interval or usual[1]
    if not (interval > 0 and np.isfinite(seconds) and seconds >= _FEWEST_SAMPLES * interval):
        raise DesignError(
            f"An experiment of {seconds} s at {interval} s is too short; give at least {_FEWEST_SAMPLES} sampling intervals."
        )
    if experiments < 1 or rounds < 0 or not 0 < doubt < 1:
        raise DesignError(
            f"experiments = {experiments}, rounds = {rounds}, doubt = {doubt}; give at least one experiment, no negative "
            "number of rounds, and a doubt between 0 and 1."
        )
    limits = make_limits(robot, limit, speeds, rectangle, radius)
    left = _left(robot, already) if isinstance(already, LogSet) else None
    levels = _noise(robot, noise, already, left)
    count = len(robot.parameters.free_names)
    laboratory = Laboratory(robot, levels, round(seconds / interval), interval, doubt, seed, report)
    judge, random = Judge(laboratory, limits), np.random.default_rng([seed, 2])
    report("what is known already, and what the robot's rise time is")
    before = known(robot, already, levels, laboratory.magnitude)

    rise = _rise_time(laboratory, limits)
    base = np.broadcast_to(before, (3, count, count))
    family, pool, candidates = _drivable(judge, robot, limits, seconds, interval, rise, base)
    report(f"{len(family)} inputs of the family; the robot's rise time is {rise:.2g} s")
    runs: list[PlannedRun] = []
    for number in range(1, experiments + 1):
        if number > 1:
            least = float(np.min(criterion(base))) + _LEAST_GAIN
            candidates = judge(pool, [d.description for d in family], base, least, _LOOKED_AT)
        if not len(candidates.inputs):
            raise _impossible(limits, robot, [judge.shares(pool)])
        elite = candidates.best(_ELITE)
        report(f"experiment {number}: best of the family {elite.titles[0]}, log det {elite.scores[0]:.2f}")
        elite = _improved(judge, elite, candidates.inputs, base, max(1, round(rise / interval)), rounds, random, report)
        title = elite.titles[0] + (f", improved by {rounds} rounds of exchanges" if rounds else "")
        runs.append(_run(judge, f"experiment_{number}", title, elite.inputs[0]))
        base = base + elite.information[0]
    information = base[0]

    report("comparing with a PRBS")
    clock = max(round(rise / interval), 1) * interval
    driven = [_prbs(robot, run.energy, laboratory, clock, i) for i, run in enumerate(runs)]
    reference = [_run(judge, f"prbs_{i}", f"a PRBS with a clock of {clock:.2g} s", u) for i, u in enumerate(driven, 1)]
    other = before + laboratory.run(np.stack(driven)).information.sum(axis=0)
    names, magnitude = laboratory.names, laboratory.magnitude

    def by_name(values: Array) -> dict[str, float]:
        return {name: float(value) for name, value in zip(names, values, strict=True)}

    return Design(
        robot=robot.name,
        runs=tuple(runs),
        values={name: robot.parameters[name].value for name in names},
        units={name: robot.parameters[name].unit for name in names},
        magnitudes=by_name(magnitude),
        std_errors=by_name(std_errors(information) * magnitude),
        reference=f"a PRBS of the same length and energy with a clock of {clock:.2g} s"
        + (" on every input" if len(robot.channels.inputs) > 1 else ""),
        reference_runs=tuple(reference),
        reference_std_errors=by_name(std_errors(other) * magnitude),
        before=by_name(std_errors(before) * magnitude),
        tried=judge.tried,
        doubt=_doubt(already, left),
        meanings={name: meaning for name, meaning in meanings_of(robot).items() if name in names},
    )

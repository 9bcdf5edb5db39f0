"""What each named effect does, as curves of what it depends on: the model without it, the model with it, and its 95 % band.

The band is that of the whole curve by the fit's covariance, linearised in the parameters. Where a missing force shows the same
quantity, the measured motion stands beside the curves: what the last model without the effect has, and what it misses then. The
first model's numbers will not do: its mass took up part of what was missing, and points by it lie beside the right curve; how
fast its missing force wanders will.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...estimate.result import Fit
from ...logs import LogSet
from ...robots.effect import Effect
from ...robots.robot import Robot
from ...robots.scales import Scales
from ...simulation.scaled import axis_map, scales_of
from .conditions import Motion, motions
from .missing_force import ForceHistory, missing_force
from .stage_sweeps import SIDE, Grid, Sweep, sweeps

_SHOWS = 1e-3
"""Share of a quantity's largest value below which an effect is said not to change it."""
_VARIES = 0.1
"""Share of an effect's largest change by which it must vary to be drawn against a variable."""
_ALIKE = 1e-6
_MOST = 4
"""Curves of one effect."""
_STEP = 0.05
"""Largest step of a parameter, in shares of its value, by which curves are linearised."""
_BY_FORCE = ("friction", "force")
"""Kinds of curves beside which a missing force can be drawn."""
_KNOWN = 2.0
"""Times the median standard deviation up to which a sample of the missing force is shown."""


@dataclass(frozen=True)
class LawCurve:
    """`quantity` [`unit`] of `part` against `variable` [`of`]: `before` and `after` at `values`, all [N].

    `change` is what the effect alone does in the last model and `std` the standard deviation of `after` (NaN where the fit does
    not determine what it hangs on). `samples` are measured values and what they ask for (x, y), where the data shows it. On a
    map (`place`) `values` are [N, 2] and `path` [M, 2] is where the robot drove. `shared` counts parts with the same curve.
    """

    effect: str
    quantity: str
    part: str
    unit: str
    variable: str
    of: str
    values: Grid
    before: Grid
    after: Grid
    change: Grid
    std: Grid
    samples: tuple[Grid, Grid] | None = field(default=None, repr=False)
    path: Grid | None = field(default=None, repr=False)
    shared: int = 1

    @property
    def place(self) -> bool:
        """Whether it is a map of the floor."""
        return self.values.ndim == 2

    @property
    def title(self) -> str:
        """What is drawn, of which part."""
        every = "both" if self.shared == 2 else f"all {self.shared}"
        part = f"({every} alike)" if self.shared > 1 else self.part
        return f"{self.quantity} {part}".strip()


@dataclass(frozen=True)
class _Seen:
    """What the logs show: their scales, motions and places and, where points are to be drawn, what the first model misses and
    the noise by channel."""

    scales: Scales
    motions: tuple[Motion, ...]
    floor: Grid
    path: Grid | None
    forces: Sequence[ForceHistory]
    noise: Mapping[str, float] | None


def _floor(seen: Sequence[Motion]) -> tuple[Grid, Grid | None]:
    """A grid [N, 2] over where the robot drove in the plane, and its path [M, 2]; none where it is not known."""
    paths = [m.path for m in seen if m.path is not None and m.path.shape[1] == 2]
    if not paths:
        return np.zeros((0, 2)), None
    path = np.concatenate([*paths])
    low, high = path.min(axis=0), path.max(axis=0)
    wide = 0.05 * float(np.max(high - low)) or 0.5
    flat = high - low < 1e-3 * wide  # it drove along a line
    low, high = np.where(flat, low - wide, low), np.where(flat, high + wide, high)
    x, y = (np.linspace(a, b, SIDE) for a, b in zip(low, high, strict=True))
    return np.stack([c.ravel() for c in np.meshgrid(x, y)], axis=1), path


def _reached(effect: Effect, robot: Robot, logs: LogSet, seen: Sequence[Motion]) -> dict[str, float]:
    """About the largest values of the effect's own states on the logs: their rates integrated along the measured motion."""
    names = effect.states_on(robot)
    if not names:
        return {}
    p, largest = robot.parameters.numbers, dict.fromkeys(names, 0.0)
    for log in list(logs)[:2]:
        rest: dict[str, Any] = dict.fromkeys(robot.states, 0.0) | robot.initial_state()
        rest |= {v: np.nan_to_num(log.output(v))[::20] for v in robot.velocities if v in log.measured}
        inputs = tuple(log.inputs[::20].T)
        step = 20 * log.sampling_interval
        # With the states at zero: no state of an effect hangs on itself but to decay.
        rates = effect.rates(rest, robot.currents(rest, inputs, p), p, robot)
        for name in names:
            whole = np.abs(np.cumsum(np.broadcast_to(np.asarray(rates[name], float), inputs[0].shape)) * step)
            largest[name] = max(largest[name], float(whole.max()))
    return largest


def _steps(final: Fit) -> tuple[list[str], NDArray, NDArray]:
    """Free parameters whose errors are known, the steps by which curves are linearised, and their covariance."""
    covariance = np.asarray(final.covariance, float)
    determined = [math.isfinite(final.parameters[name].std_error) for name in final.free_names]
    places = [i for i, known in enumerate(determined) if known and covariance[i, i] > 0]
    names = [final.free_names[i] for i in places]
    known = np.nan_to_num(covariance[np.ix_(places, places)])
    values = np.array([abs(final.robot.parameters[name].value) for name in names])
    errors = np.sqrt(np.diag(known)) if names else np.zeros(0)
    return names, np.minimum(errors, np.where(values > 0, _STEP * values, errors)), known


def _with_errors(sweep: Sweep, final: Fit, bare: Robot) -> tuple[Grid, Grid, Grid]:
    """After, what it has beyond `bare`, and the standard deviation of after, all [n, N]."""
    names, steps, covariance = _steps(final)
    p = dict(final.robot.parameters.numbers)
    moved = [{}, *({n: p[n] + h} for n, h in zip(names, steps, strict=True))]
    if sweep.family == "step":  # a recursion over the samples, which is compiled anew whenever it is asked
        varied = {name: jnp.asarray([q.get(name, p[name]) for q in moved]) for name in names}
        every = np.asarray(jax.vmap(lambda q: sweep.response(final.robot, p | q))(varied) if names else
                           [sweep.response(final.robot, p)], float)  # fmt: skip
    else:
        every = np.stack([np.asarray(sweep.response(final.robot, p | q), float) for q in moved])
    after = every[0]
    slopes = (every[1:] - after) / np.maximum(steps, 1e-300)[:, None, None]
    variance = np.einsum("ipn,ij,jpn->pn", slopes, covariance, slopes) if names else np.full(after.shape, np.nan)
    change = after - np.asarray(sweep.response(bare, p), float)
    std = np.sqrt(np.maximum(variance, 0.0))
    unknown = set(final.free_names) - set(names)
    if sweep.family == "step":  # not asked once more: a lag's or a delay's own parameters decide
        own = {name for effect in final.robot.effects for name in effect.parameters(final.robot)}
        return after, change, np.full_like(std, np.nan) if unknown & own else std
    # A part that hangs on what the fit could not determine has no band: that of the rest would be too narrow.
    for name in unknown:
        step = _STEP * (abs(p[name]) or final.robot.parameters[name].typical or 1.0)
        away = np.abs(np.asarray(sweep.response(final.robot, p | {name: p[name] + step}), float) - after).max(axis=1)
        std[away > _ALIKE * np.abs(after).max()] = np.nan
    return after, change, std


def _moved(sweep: Sweep, final: Fit, bare: Robot) -> tuple[Grid, Grid]:
    """After and what the effect alone changes, [n, N] each."""
    p = final.robot.parameters.numbers
    after = np.asarray(sweep.response(final.robot, p), float)
    return after, after - np.asarray(sweep.response(bare, p), float)


def _chosen(group: list[Sweep], final: Fit, bare: Robot) -> list[tuple[Sweep, list[int]]]:
    """The sweeps along which the effect's change varies, of the most particular family alone, and the parts it changes."""
    varying: list[tuple[Sweep, list[int]]] = []
    level: list[tuple[Sweep, list[int]]] = []
    for sweep in group:
        if varying and sweep.family != varying[0][0].family:
            break
        after, change = _moved(sweep, final, bare)
        size = np.abs(change).max(axis=1)
        if not np.isfinite(after).all() or not size.max() > _SHOWS * np.abs(after).max():
            continue
        ranges = np.ptp(change, axis=1)
        parts = [k for k in range(len(sweep.parts)) if ranges[k] > _VARIES * max(size.max(), ranges.max())]
        if ranges.max() > _VARIES * size.max():
            varying.append((sweep, parts))
        elif not level:
            level.append((sweep, [k for k in range(len(sweep.parts)) if size[k] > _VARIES * size.max()]))
    return varying or level


# -- what the data says --------------------------------------------------------------------------------------------
def _samples(
    sweep: Sweep, part: int, without: Grid, robot: Robot, seen: _Seen, forces: Sequence[ForceHistory]
) -> tuple[Grid, Grid] | None:
    """The swept variable as measured, and what the motion asks for: the curve of the `robot` `without` the effect, and what it
    misses."""
    if not forces or sweep.kind not in _BY_FORCE:
        return None
    missing, spread = np.concatenate([f.force for f in forces]), np.concatenate([f.std for f in forces])
    names = list(forces[0].names)
    if sweep.kind == "friction":
        to_axes = axis_map(robot, names)
        if to_axes.shape[0] != to_axes.shape[1] or np.linalg.cond(to_axes) > 1e6:
            return None
        lever = float(np.asarray(robot.rim_levers(robot.parameters.numbers)[robot.drive_axes[part]]))
        back = -lever * np.linalg.inv(to_axes).T
        x, y = np.concatenate([m.axes for m in seen.motions])[:, part], missing @ back[:, part]
        error = np.sqrt(spread**2 @ back[:, part] ** 2)
    else:
        y, error = missing[:, part], spread[:, part]
        if sweep.family == "heading":
            if any(m.heading is None for m in seen.motions):
                return None
            x = np.concatenate([np.angle(np.exp(1j * np.asarray(m.heading))) for m in seen.motions])
        else:
            ahead = [m.turning if sweep.moved == robot.turning else m.ahead for m in seen.motions]
            if sweep.moved not in (names[0], robot.turning) or any(a is None for a in ahead):
                return None
            x = np.concatenate([np.asarray(a) for a in ahead])
    known = np.isfinite(x) & np.isfinite(y) & (error <= _KNOWN * np.median(error))
    known &= (x >= sweep.values[0]) & (x <= sweep.values[-1])
    if sweep.family == "speed":
        known &= np.abs(x) > 0.01 * np.abs(sweep.values).max()  # at standstill friction is whatever holds
    return x[known], y[known] + np.interp(x[known], sweep.values, without)


def _forces(bare: Robot, final: Fit, logs: LogSet, seen: _Seen) -> Sequence[ForceHistory]:
    """What the `bare` robot misses; nothing where points are not asked for, or would be accelerations."""
    if not seen.forces or "force" not in bare.traits:
        return ()
    return missing_force(bare, logs, seen.noise, final.initial_states, seen.forces[0].intensity)


def _curves(effect: Effect, baseline: Fit, final: Fit, logs: LogSet, seen: _Seen) -> list[LawCurve]:
    bare = replace(final.robot, effects=tuple(own for own in final.robot.effects if own.id != effect.id))
    groups = sweeps(effect, final.robot, seen.scales, seen.floor, _reached(effect, final.robot, logs, seen.motions))
    chosen = [drawn for group in groups for drawn in _chosen(group, final, bare)]
    forces = _forces(bare, final, logs, seen) if any(sweep.kind in _BY_FORCE for sweep, _ in chosen) else ()
    found: list[LawCurve] = []
    for sweep, parts in chosen:
        after, change, std = _with_errors(sweep, final, bare)
        before = np.asarray(sweep.response(baseline.robot, baseline.robot.parameters.numbers), float)
        for k in parts:
            drawn = LawCurve(
                effect.id, sweep.quantity, sweep.parts[k], sweep.units[k], sweep.variable, sweep.of, sweep.values,
                before[k], after[k], change[k], std[k],
                _samples(sweep, k, after[k] - change[k], bare, seen, forces), seen.path if sweep.kind == "place" else None,
            )  # fmt: skip
            found = _joined(found, drawn)
    return found[:_MOST]


def _joined(found: list[LawCurve], drawn: LawCurve) -> list[LawCurve]:
    """With one more curve; counted only where an earlier one is the same."""
    for k, other in enumerate(found):
        same = other.quantity == drawn.quantity and other.variable == drawn.variable and other.unit == drawn.unit
        pairs = ((other.after, drawn.after), (other.before, drawn.before))
        if same and all(np.allclose(a, b, atol=_ALIKE * np.abs(a).max()) for a, b in pairs):
            both = [s for s in (other.samples, drawn.samples) if s is not None]
            samples = (np.concatenate([s[0] for s in both]), np.concatenate([s[1] for s in both])) if both else None
            return [*found[:k], replace(other, shared=other.shared + 1, samples=samples), *found[k + 1 :]]
    return [*found, drawn]


@in_float64
def law_curves(
    ids: Sequence[str],
    baseline: Fit,
    final: Fit,
    logs: LogSet,
    forces: Sequence[ForceHistory] = (),
    noise: Mapping[str, float] | None = None,
) -> dict[str, tuple[LawCurve, ...]]:
    """The curves of the effects `ids` of the `final` fit, by id; none for an effect without a stage that can be asked alone.

    With the missing `forces` of the `baseline` on the same `logs`, and their `noise` by channel (default: what the data say),
    what their motion asks for stands beside curves of friction and force.
    """
    present: Mapping[str, Effect] = {effect.id: effect for effect in final.robot.effects}
    if final.robot.controlled or not any(name in present for name in ids):
        return {}
    moved = motions(baseline.robot, logs)
    seen = _Seen(scales_of(baseline.robot, logs), moved, *_floor(moved), forces, noise)
    return {name: _asked(present[name], baseline, final, logs, seen) for name in ids if name in present}


def _asked(effect: Effect, baseline: Fit, final: Fit, logs: LogSet, seen: _Seen) -> tuple[LawCurve, ...]:
    """The effect's curves; none of a user's own effect that cannot be asked for a row of values alone."""
    try:
        return tuple(_curves(effect, baseline, final, logs, seen))
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        return ()

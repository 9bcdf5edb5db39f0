"""Pre-flight checks of the sensors against the experiment: did the robot move, does each sensor know about it, and was
it at rest when the log began?
"""

from collections.abc import Iterable, Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .._filters import lagged
from ..logs.finding import Finding
from ..logs.log import Log
from ..logs.noise import white_level
from ..logs.rates import unwrapped
from .motion import is_position, response, speed
from .samples import finding
from .windows import Windows, excited, speed_windows

Array = NDArray[np.float64]

_PUSHED = 0.1
"""Share of the largest that the inputs could drive an output by, from which they drove it."""
_FEW, _MOVED = 24, 0.3
"""Readings from which, and share of their variance from which, they follow the commands, so that the robot moved."""
_LOUD, _LEAKS = 10.0, 0.7
"""Times its noise by which a motion is one that something drives, and share of it that follows both inputs where it is a leak
of what these drive."""
_RELATED = 0.1
"""Share of a sensor's variance from which it is taken to follow what predicts it."""
_PAIRED, _MOSTLY = 6, 0.3
"""Columns up to which their products are looked at, and the share of a sensor's variance that one of them has to explain."""
_RADIANS = {"rad": 1.0, "deg": np.pi / 180.0}
"""Units of angles, and of turning once `/s` is added."""
UNRELATED = "is unrelated to every input and every other sensor"
"""What is said of a sensor that moves, but not with the robot."""


def _smooth(values: Array, width: int) -> Array:
    """Block means over `width` samples, NaN left out; `[N]` or `[N, columns]`."""
    rows = len(values) // width * width
    blocks = values[:rows].reshape(-1, width, *values.shape[1:])
    there = np.isfinite(blocks)
    return np.where(there, blocks, 0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)


def _lagged(log: Log, signals: Array) -> Array:
    """`signals [T, n]` and two first-order lags of each (a third of the response time and once it), side by side."""
    columns = [signals]
    for samples in (response(log) / 3, 1.0 * response(log)):
        decay = np.exp(-1 / samples)
        columns.append(lagged(signals, float(decay)))
    return np.concatenate(columns, axis=1)


def _predicted(target: Array, regressors: Array) -> float:
    """Share of the variance of `target [N]` that a linear regression predicts on the quarters it was not fitted to."""
    spread = regressors.std(axis=0)
    if np.var(target) == 0:
        return 0.0
    regressors = ((regressors - regressors.mean(axis=0)) / np.maximum(spread, 1e-300))[:, spread > 0]
    regressors = np.concatenate([regressors, np.ones((len(target), 1))], axis=1)
    left = np.empty_like(target)
    for quarter in range(4):
        part = np.arange(len(target)) * 4 // len(target) == quarter
        rest = ~part
        # A ridge keeps columns that say the same (two inputs always equal) from cancelling each other.
        gram = regressors[rest].T @ regressors[rest] + 1e-3 * rest.sum() * np.eye(regressors.shape[1])
        left[part] = target[part] - regressors[part] @ np.linalg.solve(gram, regressors[rest].T @ target[rest])
    return float(1 - np.var(left) / np.var(target))


def _followed(targets: Iterable[Array], regressors: Array) -> float:
    """The largest share predicted of any of the `targets [N]`, or of its change: a position or heading follows the inputs by
    that."""
    changes = ((_predicted(own, regressors), _predicted(np.diff(own), regressors[1:])) for own in targets)
    return max(share for both in changes for share in both)


def _beyond_its_past(target: Array, regressors: Array) -> float:
    """Share predicted of what two samples before do not foretell of the `target [N]`: of what swings by itself, such as a
    pendulum, inputs push the swing and do not make what it is."""
    past = np.stack([target[1:-1], target[:-2], np.ones(len(target) - 2)], axis=-1)
    new = target[2:] - past @ np.linalg.lstsq(past, target[2:], rcond=None)[0]
    return _predicted(new, np.concatenate([regressors[2:], regressors[1:-1]], axis=1))


def _answer(target: Array, regressors: Array) -> float:
    """Largest t statistic of `target [N]` against a single column: finds the answer to one step, which has no "
    "repeat."""
    regressors = regressors[:, np.ptp(regressors, axis=0) > 0]
    centred = regressors - regressors.mean(axis=0)
    target = target - target.mean()
    size = np.linalg.norm(centred, axis=0) * np.linalg.norm(target)
    correlation = np.max(np.abs(target @ centred) / np.maximum(size, 1e-300), initial=0.0)
    return float(correlation * np.sqrt((len(target) - 2) / max(1 - correlation**2, 1e-12)))


def _turned(log: Log, others: Array, names: list[str]) -> list[Array]:
    """What the inputs make in a frame that does not turn, seen in the one that does, for every yaw rate among the `others
    [T, n]`: of a body that spins while its motors push, its own speeds follow nothing else."""
    found = []
    scales = [_RADIANS.get(log.channels.units.get(name, "").removesuffix("/s")) for name in names]
    rates = [log.channels.units.get(name, "").endswith("/s") and name in log.measured for name in names]
    for k, scale in [(k, scale) for k, scale in enumerate(scales) if scale is not None and rates[k]]:
        turn = np.exp(1j * scale * np.cumsum(others[:, k]) * log.sampling_interval)[:, None]
        pushed = others[:, : log.inputs.shape[1]] * turn
        for samples in (response(log) / 3, 1.0 * response(log), 3.0 * response(log)):
            decay = float(np.exp(-1 / samples))
            late = (lagged(pushed.real, decay) + 1j * lagged(pushed.imag, decay)) / turn
            found += [late.real, late.imag]
    return found


def _mixed(log: Log, others: Array, columns: list[str], name: str) -> Iterator[Array]:
    """Regressors `[T, m]` of what follows others while the robot turns: lagged products of every two of the `others [T, n]`
    (the inputs and the `columns` but `name`) and of each with the sine and cosine of every angle among them; and the inputs
    `_turned`."""
    names = [*log.channels.inputs, *(key for key in columns if key != name)]
    angles = [(k, _RADIANS.get(log.channels.units.get(key, ""))) for k, key in enumerate(names)]
    waves = [wave(scale * others[:, k]) for k, scale in angles if scale is not None for wave in (np.cos, np.sin)]
    pairs = [others[:, a] * others[:, b] for a, b in combinations(range(others.shape[1]), 2)]
    products = [*(others[:, k] * wave for k in range(others.shape[1]) for wave in waves), *pairs]
    if products:
        yield _lagged(log, np.stack(products, axis=-1))
    if turned := _turned(log, others, names):
        yield np.concatenate([others, *turned], axis=1)


def _filled(values: Array, unit: str) -> tuple[Array, NDArray[np.bool_]]:
    """A column `[T]` between its samples, turns put together, and the rows that lie between two of them at their usual
    distance: of a sensor slower than its log all, of one that broke off those before."""
    there = np.flatnonzero(np.isfinite(values))
    if not len(there):
        return np.zeros_like(values), np.zeros(len(values), bool)
    rows = np.arange(len(values))
    after = np.minimum(np.searchsorted(there, rows), len(there) - 1)
    before = np.maximum(np.searchsorted(there, rows, side="right") - 1, 0)
    apart = np.maximum(there[after] - there[before], np.abs(rows - there[after]))
    usual = np.median(np.diff(there)) if len(there) > 1 else 1
    seen = values[there]
    # In degrees only where the unit says so: whatever else has such numbers is no heading, nor is what has another unit.
    if unit in _RADIANS or (not unit and np.ptp(seen) <= 2 * np.pi):
        seen = unwrapped(seen)
    return np.interp(rows, there, seen), apart <= 2 * usual


def _pushed(log: Log, name: str) -> bool:
    """Whether the inputs drove this output, by themselves: where nothing changes there are no windows to see it in."""
    push = log.inputs @ np.asarray(log.channels.mixing[name])
    most = np.abs(log.inputs) @ np.abs(log.channels.mixing[name])
    return bool(np.std(push) > _PUSHED * np.sqrt(np.mean(most**2)) > 0)


def _dead(log: Log, outputs: list[Windows], also: tuple[str, ...]) -> Iterator[Finding]:
    """Sensors that answer neither to the inputs nor to any other sensor although the robot was driven."""
    driven, units = {windows.name for windows in outputs if excited(windows)}, log.channels.units
    columns = {name: log.output(name) for name in log.measured}
    columns |= {name: np.asarray(log.extra[name], dtype=float) for name in also}
    # Rows that repeat the row before say nothing about an answer, and their mean differs for many a broken sensor.
    rows = np.concatenate([log.inputs, np.nan_to_num(log.outputs)], axis=1)
    active = np.concatenate([[True], np.any(np.diff(rows, axis=0) != 0, axis=1)])
    least = max(1, min(response(log) // 2, int(active.sum()) // 48))
    if active.sum() < 60 or not np.ptp(log.inputs, axis=0).any():
        return
    for name, values in columns.items():
        there = np.isfinite(values)
        constant = np.ptp(values[there]) == 0
        if name in log.channels.mixing and name not in driven and not (constant and _pushed(log, name)):
            continue
        if constant:
            text = (
                "never changes although the robot was driven, so the sensor is dead; repair it or leave the column out"
            )
            yield finding(log, name, None, "warning", "dead_sensor", text)
            continue
        sensors = [_filled(other, units.get(key, ""))[0] for key, other in columns.items() if key != name]
        others = np.stack([*log.inputs.T, *sensors], axis=-1)
        share = _share_related(log, name, values, others, columns, active, least)
        if share < _RELATED and is_position(log, name):
            # What drives a servo says how fast it goes, and not where it is.
            share = max(share, _share_related(log, name, speed(log, name), others, columns, active, least))
        if share < _RELATED:
            text = (
                f"{UNRELATED} ({max(share, 0):.0%} predicted), so the sensor "
                "looks dead or the column is another one; repair it or leave the column out (unless the robot hardly moved "
                "that way)"
            )
            yield finding(log, name, None, "warning", "dead_sensor", text)


def _share_related(
    log: Log,
    name: str,
    values: Array,
    others: Array,
    columns: dict[str, Array],
    active: NDArray[np.bool_],
    least: int,
) -> float:
    """The share of what a sensor shows that the inputs and all other sensors, `others` [T, n], predict; one where the log is
    too short to say, and where it answers to them however little they predict."""
    there = np.isfinite(values)
    values, near = _filled(values, log.channels.units.get(name, ""))
    looked, width = active & near, max(least, int(np.median(np.diff(np.flatnonzero(there)))))
    if looked.sum() < 24 * width:
        return 1.0
    middle, spread = np.median(values[there]), 1.4826 * np.median(np.abs(values[there] - np.median(values[there])))
    calm = np.clip(values, middle - 4 * spread, middle + 4 * spread) if spread > 0 else values
    smooth = _smooth(calm[looked], width)
    # Of a robot that mostly drives straight on, what is far from the usual are its curves, and no outliers.
    whole = _smooth(values[looked], width)
    if name in log.channels.mixing:
        # What drives it together, one after the other may hardly show.
        others = np.column_stack([others, log.inputs @ np.asarray(log.channels.mixing[name])])
    regressors = _smooth(_lagged(log, others)[looked], width)
    share = _followed((smooth, whole), regressors)
    if not (share < _RELATED and _answer(smooth, regressors) < 4.5):
        return 1.0
    share = max(share, _beyond_its_past(smooth, regressors))
    # While the robot turns, axes mix, and nothing that is linear in the others follows them; heat follows squares.
    for other in (*_mixed(log, others, list(columns), name), _lagged(log, others**2)):
        share = max(share, _followed((smooth, whole), _smooth(other[looked], width)))
    # A steered robot turns by the product of its speed and of what steers: by most of it, where several are tried.
    for a, b in combinations(others.T, 2) if others.shape[1] <= _PAIRED else ():
        product = _followed((smooth, whole), _smooth((a * b)[looked, None], width))
        share = max(share, product if product > _MOSTLY else share)
    return share


def _moved(log: Log, names: list[str]) -> Iterator[Finding]:
    """Whether any speed rose above its noise."""
    width = max(1, response(log) // 3)
    if not names or len(log) < 3 * width:
        return
    for name in names:
        values = log.output(name)
        if is_position(log, name):
            values = values - np.nanmedian(values)  # at rest anywhere is at rest
        there = np.isfinite(values)
        values, pushed = values[there], _lagged(log, log.inputs)[there]
        # What follows the commands moves, however slow a sensor's readings come, which may then be as far apart as noise is.
        if len(values) > _FEW and np.ptp(values) > 0 and _predicted(values, pushed) > _MOVED:
            return
        width = max(1, round(width * np.mean(there)))
        smooth = _smooth(values, width)
        loud = np.sqrt(np.mean(smooth**2)) > 3 * white_level(values) / np.sqrt(width)
        # Whatever its spectrum within a window, noise does not carry from one window to the next; motion does.
        carried = abs(smooth[:-1] @ smooth[1:]) > 4 / np.sqrt(len(smooth)) * (smooth @ smooth)
        if np.ptp(values[np.isfinite(values)]) > 0 and (loud or carried):
            return
    listed = ", ".join(map(repr, names))
    what = f"{listed} never rises above its" if len(names) == 1 else f"{listed} never rise above their"
    text = f"{what} noise, so the robot did not move; drive it harder or leave this log out"
    yield finding(log, names[0], None, "error", "never_moved", text)


def _copied(log: Log, names: list[str]) -> Iterator[Finding]:
    """Whether an input is another's copy: what only their difference drives moves, and not as wheels that differ make it move,
    which is as both drive them."""
    for one, other in combinations(log.channels.inputs, 2):
        if not np.ptp(log.input(one)) or not np.array_equal(log.input(one), log.input(other)):
            continue
        width = max(1, response(log) // 3)
        for name in names:
            mixing, values = np.asarray(log.channels.mixing[name]), log.output(name)
            there = np.isfinite(values)
            if not mixing.any() or np.std(log.inputs @ mixing) > 1e-9 * np.std(log.inputs) or there.sum() < 24 * width:
                continue
            smooth = _smooth(values - float(np.nanmean(values)), width)
            loud = np.sqrt(np.mean(smooth**2)) > _LOUD * white_level(values) / np.sqrt(width)
            if loud and _predicted(values[there], _lagged(log, log.inputs)[there]) < _LEAKS:
                text = (
                    f"is the same as {one!r} throughout, and {name!r} moves all the same, as only a difference of the two "
                    "makes it: one column was recorded for both; map each input to its own"
                )
                yield finding(log, other, None, "warning", "copied_input", text)
                return


def _start(log: Log, names: list[str]) -> Iterator[Finding]:
    """Whether the log begins in motion, where a run is taken to begin at rest."""
    for name in names:
        # Without a unit it may be a position, which rests anywhere.
        if not log.channels.units.get(name):
            continue
        values = speed(log, name)
        there = np.flatnonzero(np.isfinite(values))[:3]
        peak = np.nanmax(np.abs(values))
        if np.min(np.abs(values[there])) > max(0.1 * peak, 6 * white_level(values)):
            text = (
                f"the log starts in motion ({values[there[0]]:.3g} of at most {peak:.3g}): its initial state is estimated as "
                "well; cut it to a standstill if it has one, or look for a sensor's offset if the robot stood still"
            )
            yield finding(log, name, int(there[0]), "warning", "moving_start", text)


def check_sensors(log: Log, also: tuple[str, ...]) -> Iterator[Finding]:
    """Findings about the outputs (and `also`, extra columns) as sensors of the robot's motion."""
    names = [name for name in log.channels.mixing if name in log.measured]
    # Of channels of a user's own nothing says how inputs mix into them: where none of these moves, nothing does.
    yield from _moved(log, names or list(log.measured))
    yield from _dead(log, speed_windows(log), also)
    yield from _start(log, names)
    yield from _copied(log, names)

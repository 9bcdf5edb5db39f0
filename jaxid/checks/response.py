"""Pre-flight checks between columns: do outputs follow inputs, is each output sampled fast enough, does it always answer the
inputs in the same way, and with accelerations and turning terms that a robot on a floor can have?
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..logs.finding import Finding
from ..logs.log import Log
from ..logs.noise import white_level
from .early import check_early
from .exchanged import check_exchanged
from .motion import is_planar, is_position, response, speed
from .samples import finding
from .signs import check_signs
from .windows import FRICTION, Windows, excited, integral, speed_windows

Array = NDArray[np.float64]

_GRAVITY = 9.81  # m/s^2


def _coarse(log: Log, windows: Windows) -> Iterator[Finding]:
    """Sampling against the time constant: y[k+1] = a y[k] + g m[k] + c, a = exp(-dt / tau), by instrumental variables
    (earlier inputs), which measurement noise does not bias.
    """
    values = log.output(windows.name)
    push = log.inputs @ windows.mixing
    if is_position(log, windows.name) or np.isnan(values).any() or len(values) < 60 or not excited(windows):
        return
    k = np.arange(4, len(values) - 1)
    sign = np.sign(push)
    regressors = np.stack([values[k], push[k], sign[k], np.ones(len(k))], axis=-1)
    instruments = np.stack(
        [push[k - 1], push[k - 2], push[k - 3], push[k - 4], push[k], sign[k], np.ones(len(k))], axis=-1
    )
    q, s, _ = np.linalg.svd(instruments, full_matrices=False)
    projected = q[:, s > 1e-8 * s[0]].T @ regressors
    if np.linalg.matrix_rank(projected) < 3:
        return
    target = q[:, s > 1e-8 * s[0]].T @ values[k + 1]
    solution, *_ = np.linalg.lstsq(projected, target, rcond=None)
    left = values[k + 1] - regressors @ solution
    spread = np.sqrt(np.linalg.pinv(projected.T @ projected)[0, 0] * np.mean(left**2))
    change = np.diff(values)[k]
    if np.mean(left**2) >= 0.3 * min(np.mean(change**2), np.var(values)) or solution[0] + 3 * spread > np.exp(-0.5):
        return
    constant = log.sampling_interval / -np.log(max(solution[0], 0.05))
    text = (
        f"the time constant is about {constant:.2g} s, so a sampling interval of {log.sampling_interval:.3g} s hardly "
        "resolves it; record at least five samples a time constant"
    )
    yield finding(log, windows.name, None, "warning", "coarse_sampling", text)


def _acceleration(log: Log, name: str) -> Iterator[Finding]:
    """Accelerations that tyres cannot give: the clock, the scale or the ground contact is not what it seems."""
    if not is_planar(log) or log.channels.units.get(name) != "m/s":
        return
    values = log.output(name)
    width = max(2, round(0.03 / log.sampling_interval))
    if len(values) <= 2 * width:
        return
    mean = np.convolve(values, np.ones(width) / width, mode="valid")
    middle = np.convolve(log.time, np.ones(width) / width, mode="valid")
    rate = np.abs(mean[width:] - mean[:-width]) / (middle[width:] - middle[:-width])
    uncertain = 5 * white_level(values) * np.sqrt(2 / width) / (width * log.sampling_interval)
    rate = np.where(np.isfinite(rate), rate, 0)
    absurd = rate > 1.2 * _GRAVITY + uncertain
    if absurd.mean() > 0.002:
        first = int(np.argmax(absurd))
        text = (
            f"implies {np.quantile(rate[absurd], 0.9):.0f} m/s^2 here and at {absurd.mean():.1%} of the samples, more "
            "than wheels on a floor can give (1.2 g); check the clock, the speed's scale, dropped rows, and whether "
            "the wheels were lifted or slipped"
        )
        yield finding(log, name, first, "warning", "doubtful_clock", text)


def _disturbed(log: Log, windows: Windows) -> Iterator[Finding]:
    """Stretches of five response times that the model of the rest of the log does not explain (slip, contact, a push)."""
    held = np.roll(windows.drive, 1, axis=0)  # the window before, for delays and lags
    held[0] = 0
    regressors = np.concatenate([windows.drive, held, windows.nuisance], axis=1)
    solution, *_ = np.linalg.lstsq(regressors, windows.change, rcond=1e-9)
    left = windows.change - regressors @ solution
    # Where the speed is lost in its noise, dry friction acts either way or holds: what it could do there is no disturbance.
    friction = np.abs(solution[2 * windows.drive.shape[1] + FRICTION])
    unexplained = np.maximum(np.abs(left) - friction * windows.undirected, 0.0)
    span = 5
    blocks = len(left) // span
    if blocks < 5 or 1 - left.var() / max(windows.change.var(), 1e-300) < 0.5:
        return
    rms = np.sqrt(np.mean(left[: blocks * span].reshape(blocks, span) ** 2, axis=1))
    beyond = np.sqrt(np.mean(unexplained[: blocks * span].reshape(blocks, span) ** 2, axis=1))
    moved = np.sqrt(np.mean(windows.change[: blocks * span].reshape(blocks, span) ** 2, axis=1))
    active = moved > 0.3 * np.sqrt(np.mean(windows.change**2))  # standing still is no measure of the usual
    if active.sum() < 5:
        return
    odd = np.flatnonzero(
        active
        & (beyond > 0.5 * moved)
        & (beyond > 3 * np.median(rms[active]) + 3 * white_level(speed(log, windows.name)))
    )
    if len(odd):
        seconds = span * float(np.median(np.diff(log.time[windows.starts])))
        times = ", ".join(f"{log.time[windows.starts[b * span]]:.3g}" for b in odd[:6])
        text = (
            f"the {seconds:.2g} s from t = {times} s respond unlike the rest (residual "
            f"{rms[odd].max() / np.median(rms[active]):.1f} times the usual): slip, contact or a push; compare a fit "
            "without them"
        )
        yield finding(log, windows.name, int(windows.starts[odd[0] * span]), "warning", "disturbed", text)


_FLIPPED = -2.0
"""Least of the turning frame's own term, which is -1 in a frame that is flipped, that may be one."""


def _turning_frame(log: Log) -> Iterator[Finding]:
    """Handedness of a planar body frame: for speeds ahead and to the left, dV/dt = W Vn + ..., dVn/dt = -W V + ... hold
    only in a consistent one. Such a frame is known by its units and by three outputs that the inputs drive independently.

    A frame with wrong signs on all wheels answers the inputs correctly and shows only here.
    """
    names = [name for name in log.channels.mixing if name in log.measured]
    units = [log.channels.units.get(name) for name in names]
    mixing = np.array([log.channels.mixing[name] for name in names])
    if sorted(map(str, units)) != ["m/s", "m/s", "rad/s"] or np.linalg.matrix_rank(mixing) < 3:
        return
    ahead, left = (name for name, unit in zip(names, units, strict=True) if unit == "m/s")
    (turn,) = (name for name, unit in zip(names, units, strict=True) if unit == "rad/s")
    body = {name: np.nan_to_num(log.output(name)) for name in names}
    width = max(1, response(log) // 3)
    starts = np.arange(0, len(log) - width, width)
    stops = starts + width
    if len(starts) < 30:
        return
    # A slope pulls in a direction of the floor, which turns in the body's frame as it turns.
    steps = np.diff(log.time, prepend=log.time[0])
    heading = np.cumsum(body[turn] * steps)
    top = bottom = spread = 0.0
    for name, coupling in ((ahead, body[turn] * body[left]), (left, -body[turn] * body[ahead])):
        own = body[name]
        still = np.ones(len(log)), np.sign(body[turn]), np.cos(heading), np.sin(heading)
        nuisance = np.stack([*log.inputs.T, own, np.sign(own), *still], axis=-1)
        q, _ = np.linalg.qr(integral(log, nuisance, starts, stops))
        change, turned = own[stops] - own[starts], integral(log, coupling, starts, stops)
        change, turned = change - q @ (q.T @ change), turned - q @ (q.T @ turned)
        kappa = turned @ change / max(turned @ turned, 1e-300)
        top, bottom = top + turned @ change, bottom + turned @ turned
        spread += np.mean((change - kappa * turned) ** 2) * (turned @ turned)
    if bottom <= 0:
        return
    kappa, error = top / bottom, np.sqrt(spread) / bottom
    # It is -1 in a frame that is flipped; what is far from that comes of something else.
    if _FLIPPED < kappa < -0.3 and kappa + 4 * error < 0:
        text = (
            f"the turning frame's own term comes out at {kappa:.2f} instead of +1 (d{ahead}/dt = {turn} {left}), so the signs "
            f"of all wheels, or the handedness of {ahead}, {left} and {turn}, are opposite to the documented ones; flip "
            f"{turn}'s sign with its inputs, or exchange or flip {ahead} or {left}"
        )
        yield finding(log, turn, None, "warning", "frame_flipped", text)


def check_response(log: Log) -> Iterator[Finding]:
    """Findings about how the outputs answer the inputs, against what `Channels.mixing` says."""
    if exchanged := list(check_exchanged(log)):
        yield from exchanged  # whatever else looks odd follows from it
        return
    outputs = speed_windows(log)
    yield from (early := list(check_early(log)))
    # Rows that hold a command and what came of it: over short windows the motion runs ahead of its cause.
    yield from check_signs(log, over_windows=not early)
    yield from _turning_frame(log)
    for name in log.channels.mixing:
        yield from _acceleration(log, name)
    for windows in () if early else outputs:
        yield from _coarse(log, windows)
    for windows in speed_windows(log, 1.0):
        yield from _disturbed(log, windows)

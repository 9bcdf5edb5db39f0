"""Pre-flight checks between columns: does each output answer the inputs, with the right sign, fast enough to be seen?

All of them use one small model, whatever the robot: over windows of about 0.1 s, the change of a speed is linear in the
integrals of the inputs, of the speed itself and of its sign (dry friction) - the regression behind integral least
squares (Innocenti et al., section 4). It is good enough to tell a sign or a silent sensor, and no estimate comes of it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..logs.finding import Finding
from ..logs.log import Log
from .samples import finding, noise

Array = NDArray[np.float64]

WINDOW = 0.1  # s
_GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True)
class Windows:
    """One output over N windows: what its change is left with, and the inputs, once friction is projected out."""

    name: str
    mixing: Array  # [nu]
    starts: NDArray[np.int_]  # [N] sample at which each window starts
    change: Array  # [N]
    drive: Array  # [N, nu] integrals of the inputs
    nuisance: Array  # [N, m] integrals of the speed, of its sign, of 1, and of products of speeds

    def projected(self) -> tuple[Array, Array]:
        """`(change [N], drive [N, nu])` without what the nuisance regressors explain."""
        q, _ = np.linalg.qr(self.nuisance)
        return self.change - q @ (q.T @ self.change), self.drive - q @ (q.T @ self.drive)


def _integral(log: Log, rates: Array, starts: NDArray[np.int_], stops: NDArray[np.int_]) -> Array:
    """Integral of `rates[k]`, held over interval k, from sample `starts` to sample `stops`."""
    steps = np.diff(log.time).reshape(-1, *[1] * (rates.ndim - 1))
    total = np.concatenate([np.zeros((1, *rates.shape[1:])), np.cumsum(rates[:-1] * steps, axis=0)])
    return total[stops] - total[starts]


def speed_windows(log: Log) -> list[Windows]:
    width = max(1, round(WINDOW / log.sampling_interval))
    starts = np.arange(0, len(log) - width, width)
    found = []
    speeds = [np.nan_to_num(log.output(name)) for name in log.channels.mixing if name in log.measured]
    # Turning frames and inertia that varies couple the speeds by products (the papers' coupled equations).
    products = [a * b for k, a in enumerate(speeds) for b in speeds[k:]] if len(speeds) > 1 else []
    for name, gains in log.channels.mixing.items():
        if name not in log.measured:
            continue
        values = log.output(name)
        stops = starts + width
        missing = np.concatenate([[0], np.cumsum(np.isnan(values))])
        good = missing[stops + 1] == missing[starts]
        first, last = starts[good], stops[good]
        if len(first) < 20 + 3 * len(gains) + len(products):
            continue
        speed = np.where(np.isfinite(values), values, 0.0)
        middle = speed.copy()
        middle[:-1] = (speed[:-1] + speed[1:]) / 2
        direction = np.where(np.abs(middle) > 3 * noise(values), np.sign(middle), 0.0)
        nuisance = np.stack([middle, direction, np.ones(len(log)), *products], axis=-1)
        found.append(
            Windows(
                name,
                np.asarray(gains),
                first,
                speed[last] - speed[first],
                _integral(log, log.inputs, first, last),
                _integral(log, nuisance, first, last),
            )
        )
    return found


def _share(change: Array, drive: Array, mixing: Array) -> float:
    """Share of the change's variance that the drive explains with this mixing and a positive gain (else negative)."""
    push = drive @ mixing
    energy = float(push @ push) * float(change @ change)
    product = float(push @ change)
    return 0.0 if energy <= 0 else float(np.sign(product)) * product**2 / energy


def excited(windows: Windows) -> bool:
    """Whether the inputs drove this output at all: its combination against the largest that the inputs could form."""
    push = windows.drive @ windows.mixing
    most = np.abs(windows.drive) @ np.abs(windows.mixing)
    return bool(np.std(push) > 0.05 * np.sqrt(np.mean(most**2)) > 0)


def _signs(log: Log, outputs: list[Windows]) -> Iterator[Finding]:
    """Swapped and sign-flipped channels: the one or two changes of the wiring that make the data fit its mixing."""
    outputs = [windows for windows in outputs if excited(windows)]
    if not outputs:
        return
    data = [windows.projected() for windows in outputs]
    names, inputs = [windows.name for windows in outputs], log.channels.inputs
    table = np.stack([windows.mixing for windows in outputs])  # [ny, nu]
    driven = [k for k in range(len(inputs)) if np.ptp(log.inputs[:, k]) > 0]

    def shares(mixing: Array) -> Array:
        return np.array([_share(*pair, row) for pair, row in zip(data, mixing, strict=True)])

    def changes(mixing: Array) -> Iterator[tuple[str, str, Array]]:
        for j, name in enumerate(names):
            flip = np.ones((len(names), 1))
            flip[j] = -1
            yield f"output {name!r} has the opposite sign", name, mixing * flip
        for k in driven:
            flip = np.ones(len(inputs))
            flip[k] = -1
            yield f"input {inputs[k]!r} has the opposite sign", inputs[k], mixing * flip
        for a, b in combinations(range(len(inputs)), 2):
            order = np.arange(len(inputs))
            order[[a, b]] = b, a
            yield f"inputs {inputs[a]!r} and {inputs[b]!r} are swapped", inputs[a], mixing[:, order]
        for a, b in combinations(range(len(names)), 2):
            order = np.arange(len(names))
            order[[a, b]] = b, a
            yield f"outputs {names[a]!r} and {names[b]!r} are swapped", names[a], mixing[order]

    mixing, now = table, shares(table).sum()
    for _ in range(4):
        tried = [(shares(changed).sum(), text, name, changed) for text, name, changed in changes(mixing)]
        best = max(score for score, *_ in tried)
        # Chance alone moves a share by a few over the number of windows.
        if best - now < max(0.15, 12 / min(len(windows.starts) for windows in outputs)):
            return
        equal = [entry for entry in tried if entry[0] > best - 0.02 * abs(best)]
        text = (
            f"the response fits only if {' or '.join(text for _, text, *_ in equal)} (the inputs then explain "
            f"{best / len(names):.0%} of the speed changes, else {max(now, 0) / len(names):.0%}); check the wiring, "
            "then map the column with scale = -1 or the other column's name"
        )
        check = "sign_flipped" if "sign" in equal[0][1] else "swapped"
        yield finding(log, equal[0][2], None, "warning", check, text)
        now, mixing = equal[0][0], equal[0][3]


def _coarse(log: Log, windows: Windows) -> Iterator[Finding]:
    """Sampling against the time constant: y[k+1] = a y[k] + g m[k] + c, a = exp(-dt / tau), by instrumental variables
    (earlier inputs), which measurement noise does not bias.
    """
    values = log.output(windows.name)
    push = log.inputs @ windows.mixing
    if np.isnan(values).any() or len(values) < 60 or not excited(windows):
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
    if np.mean(left**2) > 0.3 * min(np.mean(change**2), np.var(values)) or solution[0] + 3 * spread > np.exp(-0.5):
        return
    constant = log.sampling_interval / -np.log(max(solution[0], 0.05))
    text = (
        f"the time constant is about {constant:.2g} s, so a sampling interval of {log.sampling_interval:.3g} s hardly "
        "resolves it; record at least five samples a time constant"
    )
    yield finding(log, windows.name, None, "warning", "coarse_sampling", text)


def _acceleration(log: Log, name: str) -> Iterator[Finding]:
    """Accelerations that tyres cannot give: the clock, the scale or the ground contact is not what it seems."""
    if log.channels.units.get(name) != "m/s":
        return
    values = log.output(name)
    width = max(2, round(0.03 / log.sampling_interval))
    if len(values) <= 2 * width:
        return
    mean = np.convolve(values, np.ones(width) / width, mode="valid")
    middle = np.convolve(log.time, np.ones(width) / width, mode="valid")
    rate = np.abs(mean[width:] - mean[:-width]) / (middle[width:] - middle[:-width])
    uncertain = 5 * noise(values) * np.sqrt(2 / width) / (width * log.sampling_interval)
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
    """Stretches of a second that the model of the rest of the log does not explain (slip, contact, a push)."""
    held = np.roll(windows.drive, 1, axis=0)  # the window before, for delays and lags
    held[0] = 0
    regressors = np.concatenate([windows.drive, held, windows.nuisance], axis=1)
    solution, *_ = np.linalg.lstsq(regressors, windows.change, rcond=1e-9)
    left = windows.change - regressors @ solution
    span = max(1, round(1.0 / WINDOW))
    blocks = len(left) // span
    if blocks < 5 or 1 - left.var() / max(windows.change.var(), 1e-300) < 0.5:
        return
    rms = np.sqrt(np.mean(left[: blocks * span].reshape(blocks, span) ** 2, axis=1))
    moved = np.sqrt(np.mean(windows.change[: blocks * span].reshape(blocks, span) ** 2, axis=1))
    active = moved > 0.3 * np.sqrt(np.mean(windows.change**2))  # standing still is no measure of the usual
    if active.sum() < 5:
        return
    odd = np.flatnonzero(
        active & (rms > 0.5 * moved) & (rms > 3 * np.median(rms[active]) + 3 * noise(log.output(windows.name)))
    )
    if len(odd):
        times = ", ".join(f"{log.time[windows.starts[b * span]]:.3g}" for b in odd[:6])
        text = (
            f"the second(s) from t = {times} s respond unlike the rest (residual "
            f"{rms[odd].max() / np.median(rms[active]):.1f} times the usual): slip, contact or a push; compare a fit "
            "without them"
        )
        yield finding(log, windows.name, int(windows.starts[odd[0] * span]), "warning", "disturbed", text)


def _turning_frame(log: Log) -> Iterator[Finding]:
    """Handedness of a planar body frame: dV/dt = W Vn + ..., dVn/dt = -W V + ... hold only in a consistent one.

    A frame with wrong signs on all wheels answers the inputs correctly and shows only here.
    """
    if not {"V", "Vn", "W"} <= set(log.measured):
        return
    speed = {name: np.nan_to_num(log.output(name)) for name in ("V", "Vn", "W")}
    width = max(1, round(WINDOW / log.sampling_interval))
    starts = np.arange(0, len(log) - width, width)
    stops = starts + width
    if len(starts) < 30:
        return
    top = bottom = spread = 0.0
    for name, coupling in (("V", speed["W"] * speed["Vn"]), ("Vn", -speed["W"] * speed["V"])):
        own = speed[name]
        nuisance = np.stack([*log.inputs.T, own, np.sign(own), np.ones(len(log)), np.sign(speed["W"])], axis=-1)
        q, _ = np.linalg.qr(_integral(log, nuisance, starts, stops))
        change, turn = own[stops] - own[starts], _integral(log, coupling, starts, stops)
        change, turn = change - q @ (q.T @ change), turn - q @ (q.T @ turn)
        kappa = turn @ change / max(turn @ turn, 1e-300)
        top, bottom = top + turn @ change, bottom + turn @ turn
        spread += np.mean((change - kappa * turn) ** 2) * (turn @ turn)
    if bottom <= 0:
        return
    kappa, error = top / bottom, np.sqrt(spread) / bottom
    if kappa < -0.3 and kappa + 4 * error < 0:
        text = (
            f"the turning frame's own term comes out at {kappa:.2f} instead of +1 (dV/dt = W Vn), so the signs of all "
            "wheels, or the handedness of V, Vn and W, are opposite to the documented ones; flip W's sign with its "
            "inputs, or exchange or flip V or Vn"
        )
        yield finding(log, "W", None, "warning", "frame_flipped", text)


def check_response(log: Log) -> Iterator[Finding]:
    """Findings about how the outputs answer the inputs, against what `Channels.mixing` says."""
    outputs = speed_windows(log)
    yield from _signs(log, outputs)
    yield from _turning_frame(log)
    for name in log.channels.mixing:
        yield from _acceleration(log, name)
    for windows in outputs:
        yield from _coarse(log, windows)
        yield from _disturbed(log, windows)

"""Pre-flight checks of the wiring: does each output answer the inputs with the sign that the robot's mixing says, and do
sensors of one motion agree?

The changes of an output over short windows are compared with the inputs (`windows`), and where they show nothing, the output
itself with the inputs after a first-order lag and a short delay, the lag that suits it best: what any robot does that
friction or a motor holds back, which tells a sign at steady speed as well. No estimate comes of either.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from .._filters import lagged
from ..logs.finding import Finding
from ..logs.log import Log
from .motion import Even, even, is_position, response, speed
from .samples import finding
from .windows import excited, speed_windows

Array = NDArray[np.float64]

_CLAIM = 0.15
"""Share of the variance, summed over the outputs, by which another wiring has to explain more."""
_DRIVEN, _WELL_DRIVEN = 0.1, 0.3
"""An output's combination of the inputs against the most that they could form: below, wheels that differ drive it too."""
_CLEARLY = 0.5
"""Share of the outputs' variance that a wiring, claimed by their changes, may explain less of than the one that was meant."""
_DELAYS = (1, 2, 4)  # samples; the input held from one sample shows at the next


@dataclass(frozen=True)
class Answer:
    """One output against the lagged inputs: all that is needed to judge any mixing, for each lag and delay."""

    name: str
    mixing: Array  # [nu]
    gram: Array  # [lags, nu, nu] of the lagged inputs
    product: Array  # [lags, nu] of the lagged inputs with the output
    energy: Array  # [lags] of the output
    independent: float  # samples' worth of evidence: how often the output changed
    weight: float  # 1 where the inputs drove this output well, less where its motion may be the leak of another's

    def share(self, mixing: Array) -> float:
        """Share of the output's variance that the inputs explain with this mixing and a positive gain, at the lag where
        that is largest; negative where only a negative gain explains any."""
        push = np.einsum("i,lij,j->l", mixing, self.gram, mixing)
        product = self.product @ mixing
        usable = push > 1e-9 * np.trace(self.gram, axis1=1, axis2=2) * (mixing @ mixing)
        shares = np.sign(product) * product**2 / np.where(usable, push * self.energy, np.inf)
        return float(shares.max(initial=-1.0))


def _lagged(inputs: Array, lag: float) -> Array:
    """First-order lag of `lag` samples."""
    decay = np.exp(-1 / lag) if lag > 0 else 0.0
    return lagged(inputs, float(decay))


def _late(signals: Array, delay: int) -> Array:
    """`delay` samples late, zero before."""
    return np.concatenate([np.zeros((delay, signals.shape[1])), signals[:-delay]])


def _left(moments: Array, kept: Sequence[int], products: Sequence[int], mixing: Array) -> Array:
    """Moments [lags, nu + 1, nu + 1] of the inputs and the output at `kept` without what the `products` explain; those as they
    are where little of the inputs would be left."""

    def block(rows: Sequence[int], columns: Sequence[int]) -> Array:
        return moments[:, rows][:, :, columns]

    plain, nu = block(kept, kept), len(mixing)
    if not products:
        return plain
    own = block(products, products)
    size = np.sqrt(np.maximum(np.diagonal(own, axis1=1, axis2=2), 1e-300))
    coupled = block(products, kept) / size[:, :, None]
    inverse = np.linalg.pinv(own / (size[:, :, None] * size[:, None]), rcond=1e-10, hermitian=True)
    left = plain - np.swapaxes(coupled, 1, 2) @ inverse @ coupled
    pushed, push = (np.einsum("i,lij,j->l", mixing, part[:, :nu, :nu], mixing) for part in (left, plain))
    return np.where((pushed > 0.3 * push)[:, None, None], left, plain)


def _moments(signals: Array, outputs: Array, there: NDArray[np.bool_]) -> Array:
    """Products of the signals, at every lag and delay, and the outputs with one another where these were measured, a
    constant taken out [lags, signals + outputs, signals + outputs]."""
    found = []
    for lag in [0.0, *np.geomspace(1, max(2, len(signals) / 4), 14)]:
        slow = _lagged(signals, lag)
        for delay in _DELAYS:
            both = np.concatenate([_late(slow, delay), outputs], axis=1)[there]
            both -= both.mean(axis=0)
            found.append(both.T @ both)
    return np.array(found)


def _answers(log: Log, rows: Even, speeds: dict[str, Array]) -> list[Answer]:
    """Every output that the inputs drive, against all of them at every lag and delay.

    Turning frames and inertia that varies couple the speeds by products (the papers' coupled equations); where the robot
    only drives straight, they cannot be told from the drive itself and are left alone.
    """
    nu = rows.inputs.shape[1]
    moved = rows.inputs - rows.inputs.mean(axis=0)
    masks: dict[bytes, list[tuple[str, Array, float]]] = {}  # outputs that were measured at the same samples
    for name, values in speeds.items():
        there = np.isfinite(values)
        if there.sum() < 40 or np.ptp(values[there]) == 0:
            continue
        mixing = np.asarray(log.channels.mixing[name])
        excitation = float(np.std(moved @ mixing) / max(np.std(moved, axis=0) @ np.abs(mixing), 1e-300))
        if excitation >= _DRIVEN:
            masks.setdefault(there.tobytes(), []).append((name, mixing, excitation))
    pairs = list(combinations_with_replacement(speeds, 2)) if len(speeds) > 1 else []
    whole = {name: np.nan_to_num(values) for name, values in speeds.items()}
    signals = np.stack([*rows.inputs.T, *(whole[a] * whole[b] for a, b in pairs)], axis=-1)
    found = []
    for mask, driven in masks.items():
        outputs = np.stack([whole[name] for name, _, _ in driven], axis=-1)
        moments = _moments(signals, outputs, np.frombuffer(mask, bool))
        for k, (name, mixing, excitation) in enumerate(driven):
            products = [nu + i for i, pair in enumerate(pairs) if pair != (name, name)]
            left = _left(moments, [*range(nu), signals.shape[1] + k], products, mixing)
            energy = np.maximum(left[:, nu, nu], 1e-300)
            evidence = len(signals) / response(log), min(1.0, excitation / _WELL_DRIVEN)
            found.append(Answer(name, mixing, left[:, :nu, :nu], left[:, :nu, nu], energy, *evidence))
    return found


@dataclass(frozen=True)
class Change:
    """The same for the changes of one output over short windows, once friction and coupling are projected out."""

    name: str
    mixing: Array  # [nu]
    change: Array  # [N]
    drive: Array  # [N, nu]
    weight: float = 1.0

    @property
    def independent(self) -> float:
        """Windows, of which twice as many are needed as of response times."""
        return len(self.change) / 2

    def share(self, mixing: Array) -> float:
        """Share of the change's variance that the drive explains with this mixing and a positive gain (else negative)."""
        push = self.drive @ mixing
        energy = float(push @ push) * float(self.change @ self.change)
        product = float(push @ self.change)
        return 0.0 if energy <= 0 else float(np.sign(product)) * product**2 / energy


def _gained(answers: "Sequence[Answer | Change]", claimed: dict[str, Array]) -> float:
    """Share of the variance, summed over the outputs, that the `claimed` mixing explains beyond the one that was meant."""
    mixing = [(answer, claimed.get(answer.name, answer.mixing)) for answer in answers]
    return sum(answer.weight * (answer.share(other) - answer.share(answer.mixing)) for answer, other in mixing)


def _contradicted(
    answers: Sequence[Answer], changes: "Sequence[Change]", found: Sequence[tuple[Finding, dict[str, Array]]]
) -> bool:
    """Whether the speeds themselves say that the wiring is as it should be, and not as their changes have it: clearly, as of
    changes that run ahead of their cause; of wires that are swapped, which leaves most of what many wheels do as it is, by more
    than these say, or at all where these say little of each output."""
    claimed = found[-1][1]
    lost, gained = -_gained(answers, claimed), _gained(changes, claimed)
    clearly = lost > _CLEARLY * sum(answer.weight for answer in answers)
    if any(finding.check != "swapped" for finding, _ in found):
        return clearly
    little = gained < _CLAIM * sum(change.weight for change in changes)
    return clearly or lost > gained or (little and lost > 0.0)


def _changes(log: Log) -> list[Change]:
    return [
        Change(windows.name, windows.mixing, *windows.projected())
        for windows in speed_windows(log)
        if excited(windows, 0.05)
    ]


def _wiring(log: Log, answers: Sequence[Answer | Change]) -> Iterator[tuple[Finding, dict[str, Array]]]:
    """Swapped and sign-flipped channels: the few changes of the wiring that make the data fit its mixing, each with the mixing
    [nu] of every output that it leads to."""
    names, inputs = [answer.name for answer in answers], log.channels.inputs
    driven = [k for k in range(len(inputs)) if np.ptp(log.inputs[:, k]) > 0]

    def score(mixing: Array) -> float:
        return sum(answer.weight * answer.share(row) for answer, row in zip(answers, mixing, strict=True))

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

    mixing = np.stack([answer.mixing for answer in answers])
    total = sum(answer.weight for answer in answers)
    now = score(mixing)
    # Chance alone moves a share by a few over the number of independent samples.
    claim = max(_CLAIM, 6 / min(answer.independent for answer in answers))
    # All at once come first, which one by one would be found in part, or as something else.
    whole = score(-mixing)
    if len(names) > 1 and whole - now >= claim and whole >= max(score(changed) for *_, changed in changes(mixing)):
        text = (
            "the response fits only if all inputs, or all outputs, have the opposite sign (the inputs then explain "
            f"{whole / total:.0%} of the speeds, else {max(now, 0) / total:.0%}); check which way is forwards, then map either "
            "columns with scale = -1"
        )
        yield (
            finding(log, inputs[driven[0]], None, "warning", "sign_flipped", text),
            dict(zip(names, -mixing, strict=True)),
        )
        now, mixing = whole, -mixing
    for _ in range(4):
        tried = [(score(changed), text, name, changed) for text, name, changed in changes(mixing)]
        best = max(entry[0] for entry in tried)
        if best - now < claim:
            return
        equal = [entry for entry in tried if entry[0] > best - 0.02 * abs(best)]
        text = (
            f"the response fits only if {' or '.join(text for _, text, *_ in equal)} (the inputs then explain "
            f"{best / total:.0%} of the speeds, else {max(now, 0) / total:.0%}); check the wiring, "
            "then map the column with scale = -1 or the other column's name"
        )
        check = "sign_flipped" if "sign" in equal[0][1] else "swapped"
        now, mixing = equal[0][0], equal[0][3]
        yield finding(log, equal[0][2], None, "warning", check, text), dict(zip(names, mixing, strict=True))


def _same_motion(log: Log, speeds: dict[str, Array], named: set[str | None]) -> Iterator[Finding]:
    """Outputs whose mixing is a combination of others' in the same unit, such as a gyro beside the wheels' encoders."""
    for name, values in speeds.items():
        unit = log.channels.units.get(name)
        others = [other for other in speeds if other != name and log.channels.units.get(other) == unit]
        if not others or name in named or is_position(log, name):
            continue
        rows = np.array([log.channels.mixing[other] for other in others])
        own = np.asarray(log.channels.mixing[name])
        gains, *_ = np.linalg.lstsq(rows.T, own, rcond=None)
        parts = [other for other, gain in zip(others, gains, strict=True) if abs(gain) > 1e-9]
        if np.abs(gains @ rows - own).max() > 1e-9 or len(parts) < 2 or named & set(parts):
            continue
        signals = np.stack([speeds[part] for part in parts], axis=-1)
        both = np.isfinite(signals).all(axis=1) & np.isfinite(values)
        if both.sum() < 40:
            continue
        # The columns' scales are not known: a regression finds them, and only its signs count.
        signals, own_values = signals[both] - signals[both].mean(axis=0), values[both] - values[both].mean()
        found, *_ = np.linalg.lstsq(signals, own_values, rcond=None)
        left = own_values - signals @ found
        expected = np.sign([gain for gain in gains if abs(gain) > 1e-9])
        weight = np.abs(found) * signals.std(axis=0)
        if np.var(left) < 0.3 * np.var(own_values) and np.all(-expected * np.sign(found) * weight > 0.2 * weight.max()):
            text = (
                f"runs opposite to what {' and '.join(map(repr, parts))} say of the same motion; map the column with "
                "scale = -1, or check which of those columns is which"
            )
            yield finding(log, name, None, "warning", "sign_flipped", text)


def check_signs(log: Log, over_windows: bool = True) -> Iterator[Finding]:
    """Findings about signs and exchanged columns, against what `Channels.mixing` says; without `over_windows` by the outputs
    themselves alone, not by their changes."""
    names = [name for name in log.channels.mixing if name in log.measured]
    if len(log) < 60 or not names:
        return
    rows = even(log)
    speeds = {name: speed(log, name)[rows.rows] for name in names}
    # Changes over short windows tell columns apart best; where noise hides them, the speeds themselves tell signs.
    changes = _changes(log) if over_windows else []
    found, answers = list(_wiring(log, changes)) if changes else [], _answers(log, rows, speeds)
    if answers and (not found or _contradicted(answers, changes, found)):
        found = list(_wiring(log, answers))
    named = [one for one, _ in found]
    yield from named
    yield from _same_motion(log, speeds, {entry.column for entry in named})

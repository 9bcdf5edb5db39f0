"""Excitation: input sequences for experiments, as NumPy arrays sampled at an interval given in seconds.

Every function returns values to be held from one sample to the next (zero-order hold), `[T]`, in the unit of its
amplitude (usually volts). `differential_drive` turns a common and a differential sequence into V2 and V3.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Exponents of primitive polynomials over GF(2), x^n + x^k + ... + 1: the shift register then runs through all 2^n - 1
# non-zero states (Golomb, Shift Register Sequences). The tests count the period of each.
_PRIMITIVE = {
    2: (2, 1),
    3: (3, 2),
    4: (4, 3),
    5: (5, 3),
    6: (6, 5),
    7: (7, 6),
    8: (8, 6, 5, 4),
    9: (9, 5),
    10: (10, 7),
    11: (11, 9),
    12: (12, 11, 10, 4),
    13: (13, 12, 11, 8),
    14: (14, 13, 12, 2),
    15: (15, 14),
    16: (16, 15, 13, 4),
}


def _samples(duration: float, sampling_interval: float) -> int:
    """Number of samples, at least one, in `duration`; raises `ValueError` for times that are not positive."""
    if not sampling_interval > 0 or not duration > 0:
        raise ValueError(
            f"A signal needs a positive duration and sampling interval; got {duration} s and {sampling_interval} s."
        )
    return max(1, round(duration / sampling_interval))


def step(amplitude: float, start: float, duration: float, sampling_interval: float) -> Array:
    """0 until `start` [s], then `amplitude` until `duration` [s]."""
    time = sampling_interval * np.arange(_samples(duration, sampling_interval))
    # Half a sample of tolerance: 0.3 s is sample 15 of 0.02 s although 15 * 0.02 rounds above it.
    return np.where(time >= start - 0.5 * sampling_interval, float(amplitude), 0.0)


def step_forward_and_back(
    amplitude: float, start: float, forward: float, back: float, rest: float, sampling_interval: float
) -> Array:
    """Standstill for `start`, `amplitude` for `forward`, `-amplitude` for `back`, and standstill for `rest` [s each].

    The robot passes through zero speed once, which tells dry from viscous friction, and ends near where it began.
    """
    levels = (0.0, amplitude, -amplitude, 0.0)
    parts = zip(levels, (start, forward, back, rest), strict=True)
    return np.concatenate([np.full(_samples(time, sampling_interval), level) for level, time in parts if time != 0])


def prbs(order: int, amplitude: float, hold: float, sampling_interval: float, periods: int = 1, seed: int = 1) -> Array:
    """Pseudo-random binary sequence of maximum length: ±`amplitude`, chips of `hold` [s], period 2^order - 1 chips.

    `order` is 2 to 16; `seed` (1 to 2^order - 1) is the register's first state and only shifts the sequence. One
    period has one chip more of +amplitude than of -amplitude, and the autocorrelation -1/(2^order - 1) off zero lag.
    Raises `ValueError` outside these ranges.
    """
    if order not in _PRIMITIVE:
        raise ValueError(f"A PRBS of order {order} is not provided; use 2 to 16.")
    length = 2**order - 1
    if not 1 <= seed <= length:
        raise ValueError(f"The register cannot start from {seed}; use 1 to {length}.")
    if periods < 1:
        raise ValueError(f"A PRBS of {periods} periods is empty; use 1 or more.")
    register = [(seed >> bit) & 1 for bit in range(order)]  # stage 1 first
    chips = np.empty(length)
    for chip in range(length):
        chips[chip] = register[-1]
        feedback = sum(register[tap - 1] for tap in _PRIMITIVE[order]) % 2
        register = [feedback, *register[:-1]]
    levels = amplitude * (2 * chips - 1)
    return np.repeat(np.tile(levels, periods), _samples(hold, sampling_interval))


def multilevel(levels: Sequence[float], hold: float, duration: float, sampling_interval: float, seed: int) -> Array:
    """Random sequence of `levels`, each held for `hold` [s], no level twice in a row and all used equally often (to
    within one): it separates dry from viscous friction, which two levels cannot.
    """
    levels = list(dict.fromkeys(float(level) for level in levels))
    if len(levels) < 2:
        raise ValueError(f"A multilevel sequence needs two or more different levels; got {levels}.")
    samples, held = _samples(duration, sampling_interval), _samples(hold, sampling_interval)
    random = np.random.default_rng(seed)
    order: list[float] = []
    while len(order) * held < samples:
        deck = random.permutation(levels)
        if order and deck[0] == order[-1]:
            deck = np.roll(deck, 1)
        order.extend(deck)
    return np.repeat(order, held)[:samples]


def multisine(
    amplitude: float, frequencies: ArrayLike, duration: float, sampling_interval: float, decay: float = 0.0
) -> Array:
    """Sum of cosines at `frequencies` [Hz] with Schroeder's phases (low crest factor), scaled to peak at `amplitude`.

    Component i has power proportional to f^(-2 decay) (0: flat). Choose multiples of 1/duration for whole periods.
    Phases: phi_i = -2 pi sum_{j<i} (i - j) p_j with p_j the share of power (Schroeder, Synthesis of low-peak-factor
    signals, IEEE Trans. Information Theory 16, 1970, eq. 11). Raises `ValueError` for a frequency of zero, or at or
    above half the sampling frequency.
    """
    f = np.asarray(frequencies, dtype=float)
    if f.ndim != 1 or not len(f) or np.any(f <= 0) or np.any(f >= 0.5 / sampling_interval):
        raise ValueError(
            f"Multisine frequencies must lie between 0 and {0.5 / sampling_interval:.4g} Hz; got {list(f)}."
        )
    time = sampling_interval * np.arange(_samples(duration, sampling_interval))
    power = f ** (-2 * decay)
    power = power / power.sum()
    phase = -2 * np.pi * np.concatenate([[0.0], np.cumsum(np.cumsum(power))[:-1]])
    signal = np.sqrt(2 * power) @ np.cos(2 * np.pi * np.outer(f, time) + phase[:, None])
    return amplitude * signal / np.max(np.abs(signal))


def chirp(amplitude: float, first: float, last: float, duration: float, sampling_interval: float) -> Array:
    """Sine that sweeps linearly from `first` to `last` [Hz] over `duration` [s], starting at zero."""
    if not 0 <= min(first, last) <= max(first, last) < 0.5 / sampling_interval:
        raise ValueError(f"A chirp must stay below {0.5 / sampling_interval:.4g} Hz; got {first} to {last} Hz.")
    time = sampling_interval * np.arange(_samples(duration, sampling_interval))
    return amplitude * np.sin(2 * np.pi * (first * time + (last - first) * time**2 / (2 * duration)))


def differential_drive(common: ArrayLike, differential: ArrayLike, limit: float | None = None) -> Array:
    """`[T, 2]`, columns V2 (right) and V3 (left): common + differential and common - differential.

    The common mode drives forward, a positive differential turns left (positive yaw rate). Raises `ValueError` for
    sequences of different length, and where a voltage would exceed `limit` [V] (a clipped sequence is another one).
    """
    common, differential = np.asarray(common, dtype=float), np.asarray(differential, dtype=float)
    if common.shape != differential.shape or common.ndim != 1:
        raise ValueError(f"Both modes need one length; got shapes {common.shape} and {differential.shape}.")
    volts = np.stack([common + differential, common - differential], axis=-1)
    if limit is not None and np.max(np.abs(volts)) > limit * (1 + 1e-12):
        peak = np.max(np.abs(volts))
        raise ValueError(f"The two modes add up to {peak:.4g} V, above {limit:.4g} V; lower one of the amplitudes.")
    return volts

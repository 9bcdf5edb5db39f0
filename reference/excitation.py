"""Input signals of realistic experiments, seeded. Voltages are rounded to 0.01 V so that a log file holds them exactly.

A signal is an array (N,). `wheels` and `omni_wheels` turn motions into wheel voltages, `experiment` puts whole
experiments together.
"""

from collections.abc import Sequence

import numpy as np
from scipy.signal import max_len_seq


def prbs(n: int, hold: int, low: float, high: float, rng: np.random.Generator) -> np.ndarray:
    """Pseudo-random binary sequence (maximum length, random phase) of two levels, each bit held for `hold` samples."""
    bits = max_len_seq(9)[0]
    bits = np.roll(bits, int(rng.integers(bits.size)))
    return np.where(np.resize(np.repeat(bits, hold), n) > 0, high, low).round(2)


def multilevel(n: int, hold: tuple[int, int], low: float, high: float, rng: np.random.Generator) -> np.ndarray:
    """Random levels, uniform in [low, high], each held for a random number of samples in [hold[0], hold[1]]."""
    out = np.empty(0)
    while out.size < n:
        out = np.append(out, np.full(rng.integers(hold[0], hold[1] + 1), rng.uniform(low, high)))
    return out[:n].round(2)


def steps(n: int, levels: Sequence[float] | np.ndarray) -> np.ndarray:
    """The levels one after the other, in equal parts of the record."""
    return np.asarray(levels, float)[np.arange(n) * len(levels) // n].round(2)


def crawl(n: int, hold: tuple[int, int], breakaway: float, rng: np.random.Generator) -> np.ndarray:
    """Levels of either sign from 0.5 to 2.2 times the break-away voltage: creeping, stopping, starting."""
    size = multilevel(n, hold, 0.5 * breakaway, 2.2 * breakaway, rng)
    sign = prbs(n, 2 * hold[1], -1, 1, rng)
    return (size * sign).round(2)


def forward_back(n: int, level: float) -> np.ndarray:
    """Rest, a step forwards, rest, the same step backwards, rest."""
    return steps(n, [0, level, level, level, 0, -level, -level, -level, 0])


def wheels(common: np.ndarray, differential: np.ndarray) -> np.ndarray:
    """Pioneer voltages (N, 2): V2 = common + differential (right), V3 = common - differential (left)."""
    return np.stack((common + differential, common - differential), 1).round(2)


def omni_wheels(ahead: np.ndarray, sideways: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Omni voltages (N, 4) that drive V, Vn and W."""
    return np.stack((sideways + turn, -ahead + turn, -sideways + turn, ahead + turn), 1).round(2)


KINDS = ("prbs_forward", "prbs_reversing", "multilevel", "steps", "turning", "crawl", "arcs")


def _motion(
    kind: str, n: int, level: float, breakaway: float, share: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Main and secondary signal of an experiment; `share` scales the secondary one."""
    if kind == "prbs_forward":
        return prbs(n, 15, 0.45 * level, level, rng), prbs(n, 22, -share * level, share * level, rng)
    if kind == "prbs_reversing":
        return prbs(n, 35, -level, level, rng), prbs(n, 24, -share * level, share * level, rng)
    if kind == "multilevel":
        return multilevel(n, (15, 60), -level, level, rng), multilevel(n, (20, 70), -share * level, share * level, rng)
    if kind == "steps":
        sizes = level * np.array([0.4, 1.0, 0.6, 0.0, -0.5, -0.9, 0.0, 0.8])
        return steps(n, sizes), multilevel(n, (60, 120), -share * level, share * level, rng)
    if kind == "turning":
        return prbs(n, 60, -0.3 * level, 0.5 * level, rng), multilevel(n, (25, 80), -0.7 * level, 0.7 * level, rng)
    if kind == "crawl":
        return crawl(n, (15, 45), breakaway, rng), prbs(n, 40, -0.3 * breakaway, 0.3 * breakaway, rng)
    if kind == "arcs":
        return multilevel(n, (50, 110), 0.3 * level, level, rng), multilevel(
            n, (40, 90), -0.4 * level, 0.4 * level, rng
        )
    raise ValueError(f"Unknown experiment '{kind}'; choose from {', '.join(KINDS)}.")


def experiment(robot: str, kind: str, n: int, seed: int, level: float | None = None) -> np.ndarray:
    """Inputs (N, m) of one experiment of `KINDS` for `pioneer`, `omni` or `axis` at 50 Hz, at most about `level` volts.

    The Pioneer starts with 1.2 s straight ahead, so that its caster trails. The omni excites its three motions at
    once, except in `turning` (W mostly) and `crawl`. The axis takes the main signal.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind) if kind in KINDS else 99])
    if robot == "pioneer":
        straight = 60
        main, second = _motion(kind, n - straight, level or 8.0, 0.86, 0.25, rng)
        return wheels(np.append(np.full(straight, 4.0), main), np.append(np.zeros(straight), second))
    if robot == "omni":
        main, second = _motion(kind, n, level or 8.0, 1.48, 0.3, rng)
        sideways = _motion("multilevel" if kind != "crawl" else "crawl", n, 0.8 * (level or 8.0), 1.48, 0.3, rng)[0]
        return omni_wheels(main, sideways, 1.2 * second if kind != "turning" else second)
    if robot == "axis":
        return _motion(kind, n, level or 4.0, 0.5, 0.0, rng)[0][:, None]
    raise ValueError(f"Unknown robot '{robot}'; choose from pioneer, omni, axis.")

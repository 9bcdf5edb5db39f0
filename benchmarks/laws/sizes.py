"""How large the law of a case has to be, found on the case itself: a drawn curve differs from seed to seed, and so does what
the baseline absorbs.

A strength is the RMS on held-out logs, in units of the noise, of the baseline that has been fitted. The first guess is the
size that moves the speeds by a few times the noise; secant steps on the logarithm of the excess follow, each with a fit.
Sizes are kept in `sizes.json`, one a case, so that a study that is run again meets the same cases.
"""

import json
import math
from functools import cache
from pathlib import Path

import numpy as np

import jaxid
from benchmarks.hidden.cases import CHECK, FIT, MODEL, NOISE, SAMPLES, SAMPLING, STRENGTHS
from jaxid.explanation.left.heldout import held_out_state
from reference import excitation
from reference.law_table import LAWS
from reference.logs import simulate

from .cases import constants, make, model_of, parameters

PATH = Path(__file__).with_name("sizes.json")
EVALUATIONS = 4
CLOSE = 0.2
"""Difference of the excess's logarithm from the wanted one that is close enough."""
ANOTHER = 0.7
"""Change of a speed, as a share of its RMS, from which on the robot is another one: what a law may do at most."""
RAW = 3.0
"""Change of the speeds over the wanted RMS at the first guess: what a fit absorbs of it, about."""
LARGEST = {
    "mismatch": 0.5,
    "asymmetry": 0.9,
    "threshold": 3.0,
    "error": 0.5,
    "curvature": 20.0,
    "change": 4.0,
    "time_constant": 0.15,
    "delay": 0.12,
    "angle": 0.4,
    "inverse_limit": 1.0,
    "width": 3.0,
}
"""Of a strength by its parameter's name: beyond it, the robot is another one."""


def _largest(law: str) -> float:
    strength = next(iter(LAWS[law]))
    if strength == "share" and law != "stribeck_friction/relative":
        return 0.9  # of a torque, a width or a coefficient
    return LARGEST.get(strength, math.inf)


def _moved(robot: str, law: str, size: float, seed: int, place: int) -> tuple[float, float]:
    """RMS change of the speeds on the held-out inputs, in units of the nominal noise, and as a share of the plain speeds'.

    The share is the largest of any speed's.
    """
    true = constants(robot, seed)
    own = {law: parameters(robot, law, size, np.random.default_rng([seed, 22, place]))}
    squares, plain = [], []
    for number, kind in enumerate(CHECK):
        inputs = excitation.experiment(robot, kind, SAMPLES, 1000 * seed + len(FIT) + number)
        runs = [simulate(true, inputs, SAMPLING, laws=each, rtol=1e-6, atol=1e-8).speeds for each in (own, None)]
        squares.append(np.mean(((runs[0] - runs[1]) / NOISE[robot]) ** 2, axis=0))
        plain.append(np.mean((runs[1] / NOISE[robot]) ** 2, axis=0))
    moved = np.mean(squares, axis=0)
    return math.sqrt(float(moved.mean())), math.sqrt(float(np.max(moved / np.mean(plain, axis=0))))


def _first_guess(robot: str, law: str, wanted: float, seed: int, place: int) -> float:
    """A size that moves the speeds by `wanted` without making another robot of it, or the largest that is allowed."""
    largest = _largest(law)
    size, low, high = min(0.1, 0.3 * largest), 0.0, math.inf
    for _ in range(9):
        try:
            moved, share = _moved(robot, law, size, seed, place)
        except RuntimeError:  # the law is too strong for the equations
            moved, share = math.inf, math.inf
        if share < ANOTHER and (0.7 < moved / wanted < 1.4 or (moved < wanted and size >= largest)):
            break
        if share < ANOTHER and moved < wanted:
            low = size
        else:
            high = size
        if low > 0.0 and high < math.inf:
            size = math.sqrt(low * high)
        else:
            factor = min(wanted / max(moved, 1e-3), 0.8 * ANOTHER / max(share, 1e-3))
            size = min(size * min(max(factor, 0.05), 30.0), largest)
    return size


def _within(robot: str, law: str, size: float, seed: int, place: int) -> tuple[float, bool]:
    """The size, made smaller as long as it makes another robot of this one, and whether it was."""
    for count in range(8):
        try:
            if _moved(robot, law, size, seed, place)[1] < ANOTHER:
                return size, count > 0
        except RuntimeError:
            pass
        size *= 0.7
    return size, True


def held_out_rms(case) -> float:
    """RMS of the fitted baseline on the case's held-out logs in units of the true noise."""
    channels = MODEL[case.robot]().channels
    logs: dict[str, list] = {}
    for stem, table in case.tables.items():
        inputs = table[list(channels.inputs)].to_numpy()
        columns = [
            table[name].to_numpy() if name in table else np.full(len(table), np.nan) for name in channels.measured
        ]
        log = jaxid.Log.from_arrays(stem, table["t"].to_numpy(), inputs, np.column_stack(columns), channels)
        logs.setdefault(stem.split("_")[0], []).append(log)
    fit = jaxid.output_error(model_of(case), jaxid.LogSet(logs["fit"]), max_steps=25)
    noise = dict(zip(channels.outputs, case.noise, strict=True))
    return float(held_out_state(fit.robot, jaxid.LogSet(logs["check"]), noise).normalised_rms)


def find(robot: str, law: str, strength: str, seed: int, place: int = 0) -> tuple[float, float]:
    """The size of the law for a strength on this seed, and the RMS that it shows as."""
    wanted = math.log(math.sqrt(STRENGTHS[strength] ** 2 - 1))
    largest = _largest(law)
    size = _first_guess(robot, law, RAW * STRENGTHS[strength], seed, place)
    known: list[tuple[float, float, float]] = []
    for _ in range(EVALUATIONS):
        size, bounded = _within(robot, law, size, seed, place)
        try:
            rms = held_out_rms(make(robot, {law: size}, seed, first=place))
        except RuntimeError:
            size *= 0.5
            continue
        excess = math.log(max(math.sqrt(max(rms**2 - 1, 0.0)), 0.03))
        known.append((math.log(size), excess, rms))
        if abs(excess - wanted) < CLOSE or ((bounded or size >= largest) and excess < wanted):
            break
        below = max((k for k in known if k[1] < wanted), default=None)
        above = min((k for k in known if k[1] > wanted), default=None)
        if below and above and below[0] < above[0]:
            share = (wanted - below[1]) / (above[1] - below[1])
            size = math.exp(below[0] + min(max(share, 0.15), 0.85) * (above[0] - below[0]))
        else:
            size = math.exp(known[-1][0] + min(max(wanted - excess, -1.5), 1.2))
        size = min(size, largest)
    if not known:
        raise RuntimeError(f"No size of {law} on '{robot}' can be simulated.")
    best = min(known, key=lambda k: abs(k[1] - wanted))
    return math.exp(best[0]), best[2]


@cache
def _kept() -> dict[str, list[float]]:
    return json.loads(PATH.read_text(encoding="utf-8")) if PATH.is_file() else {}


def size_of(robot: str, law: str, strength: str, seed: int, place: int = 0) -> tuple[float, float]:
    """The size for a strength and the RMS that it shows as, from the file or found now and kept there."""
    key = f"{robot}/{law}/{strength}/{seed}"
    if key not in _kept():
        size, rms = find(robot, law, strength, seed, place)
        kept = json.loads(PATH.read_text(encoding="utf-8")) if PATH.is_file() else {}  # others may have written
        kept[key] = [float(f"{size:.4g}"), round(rms, 2)]
        lines = ",\n".join(f" {json.dumps(name)}: {json.dumps(kept[name])}" for name in sorted(kept))
        PATH.write_text("{\n" + lines + "\n}\n", encoding="utf-8")
        _kept()[key] = kept[key]
    size, rms = _kept()[key]
    return size, rms

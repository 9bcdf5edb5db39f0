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
from jaxid.explanation.heldout import held_out_state
from reference import excitation
from reference.law_table import LAWS
from reference.logs import simulate

from .cases import constants, make, model_of, parameters

PATH = Path(__file__).with_name("sizes.json")
EVALUATIONS = 4
CLOSE = 0.2
"""Difference of the excess's logarithm from the wanted one that is close enough."""
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


def _moved(robot: str, law: str, size: float, seed: int) -> float:
    """RMS change of the speeds on the held-out inputs, in units of the nominal noise."""
    true = constants(robot, seed)
    own = {law: parameters(robot, law, size, np.random.default_rng([seed, 22, 0]))}
    squares = []
    for number, kind in enumerate(CHECK):
        inputs = excitation.experiment(robot, kind, SAMPLES, 1000 * seed + len(FIT) + number)
        runs = [simulate(true, inputs, SAMPLING, laws=each, rtol=1e-6, atol=1e-8).speeds for each in (own, None)]
        squares.append(np.mean(((runs[0] - runs[1]) / NOISE[robot]) ** 2))
    return math.sqrt(float(np.mean(squares)))


def _first_guess(robot: str, law: str, wanted: float, seed: int) -> float:
    """A size that moves the speeds by `wanted`, in three steps from the largest that is allowed or 0.1."""
    largest = _largest(law)
    size = min(0.1, 0.3 * largest)
    for _ in range(5):
        try:
            moved = max(_moved(robot, law, size, seed), 1e-3)
        except RuntimeError:  # the law is too strong for the equations
            size *= 0.3
            continue
        if 0.7 < moved / wanted < 1.4:
            break
        size = min(size * min(max(wanted / moved, 0.05), 30.0), largest)
    return size


def held_out_rms(case) -> float:
    """RMS of the fitted baseline on the case's held-out logs in units of the true noise."""
    channels = MODEL[case.robot].channels
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


def find(robot: str, law: str, strength: str, seed: int) -> tuple[float, float]:
    """The size of the law for a strength on this seed, and the RMS that it shows as."""
    wanted = math.log(math.sqrt(STRENGTHS[strength] ** 2 - 1))
    largest = _largest(law)
    size = _first_guess(robot, law, RAW * STRENGTHS[strength], seed)
    known: list[tuple[float, float, float]] = []
    for _ in range(EVALUATIONS):
        try:
            rms = held_out_rms(make(robot, {law: size}, seed))
        except RuntimeError:
            size *= 0.5
            continue
        excess = math.log(max(math.sqrt(max(rms**2 - 1, 0.0)), 0.03))
        known.append((math.log(size), excess, rms))
        if abs(excess - wanted) < CLOSE or (size >= largest and excess < wanted):
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


def size_of(robot: str, law: str, strength: str, seed: int) -> tuple[float, float]:
    """The size for a strength and the RMS that it shows as, from the file or found now and kept there."""
    key = f"{robot}/{law}/{strength}/{seed}"
    if key not in _kept():
        size, rms = find(robot, law, strength, seed)
        kept = json.loads(PATH.read_text(encoding="utf-8")) if PATH.is_file() else {}  # others may have written
        kept[key] = [float(f"{size:.4g}"), round(rms, 2)]
        lines = ",\n".join(f" {json.dumps(name)}: {json.dumps(kept[name])}" for name in sorted(kept))
        PATH.write_text("{\n" + lines + "\n}\n", encoding="utf-8")
        _kept()[key] = kept[key]
    size, rms = _kept()[key]
    return size, rms

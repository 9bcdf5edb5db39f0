"""One case: six logs to fit and three held out, whose missing part is a law of `reference.law_table`, drawn from a seed.

Constants, excitation and files are those of `benchmarks.hidden.cases`; noise may be of any kind, and the constants that the
nominal model tells may be some per cent off.
"""

from collections.abc import Mapping

import numpy as np

from benchmarks.hidden.cases import (
    AXIS_NAMES,
    CHECK,
    FIT,
    KNOWN,
    LARGEST_INPUT,
    MODEL,
    NOISE,
    REFERENCE,
    SAMPLES,
    SAMPLING,
    UNKNOWN,
    Case,
)
from reference import excitation
from reference.law_table import LAWS
from reference.logs import simulate_log
from reference.robot import Robot

SPREAD = 0.15
"""Relative spread of the constants, drawn anew for every case."""
OFF = (0.01, 0.05)
"""Range of the relative errors of known constants, where they have any."""
TOLD = {
    "pioneer": (("R",), ("L",), ("M",), ("KT", "KE"), ("Ra",), ("tr",), ("mu",)),
    "omni": (("M",), ("b",), ("r",), ("Kt", "Kv"), ("Ra",)),
    "axis": (("k",),),
}
"""Known constants that may be off; those in one bracket are one constant of nature."""
_FULL = {
    "motor_gain_mismatch": LARGEST_INPUT,
    "motor_cross_talk": LARGEST_INPUT,
    "battery_sag": {"pioneer": 12.0, "omni": 40.0},
    "motor_heating": {"pioneer": 60.0, "omni": 300.0},
    "freewheeling_driver": {"pioneer": 4.0, "omni": 4.0},
    "load_dependent_friction": {"pioneer": 1.5, "omni": 60.0, "axis": 30.0},
}
"""Where a drawn curve is at its end: volts, amperes, joules, newton metres or newtons."""


def parameters(robot: str, law: str, size: float, rng: np.random.Generator) -> dict[str, float]:
    """The law's parameters at strength `size`; what is not strength is drawn from `rng`."""
    mechanism, word = law.split("/")
    motors, speeds = len(REFERENCE[robot].inputs), len(REFERENCE[robot].speeds)
    wheels = motors if mechanism == "traction_limit" or robot == "pioneer" else REFERENCE[robot].n_axes
    channel, other = rng.permutation(speeds)[:2] if speeds > 1 else (0, 0)
    drawn = {
        "speed": rng.uniform(0.03, 0.1),
        "distance": 0.001,
        "wheel": rng.integers(wheels) + 1,
        "motor": rng.integers(motors) + 1,
        "axis": rng.integers(speeds) + 1,
        "channel": channel + 1,
        "other": other + 1,
        "seed": rng.integers(10000),
        "ratio": rng.uniform(0.0, 0.5),
        "nominal": 12.0 if robot == "pioneer" else 24.0,
        "time": rng.uniform(3.0, 9.0),
        "damping": rng.uniform(0.6, 1.0),
        "x": rng.uniform(-0.5, 0.5),
        "y": rng.uniform(-0.5, 0.5),
        "radius": rng.uniform(0.2, 0.5),
        "angle": rng.uniform(-np.pi, np.pi),
        "direction": rng.uniform(-np.pi, np.pi),
        "offset": rng.uniform(0.1, 0.6),
        "width": rng.uniform(0.2, 0.5) if word == "gradual" else rng.uniform(1.0, 2.0),
        "turn": rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 2.5),
        "periods": rng.integers(3, 13),
        "share": rng.uniform(0.4, 0.9),
        "phase": rng.uniform(-np.pi, np.pi),
        "driven": rng.uniform(0.0, 0.5),
        "viscous": rng.uniform(0.1, 0.5),
        "full": _FULL.get(mechanism, {}).get(robot, 1.0),
    }
    sign = float(rng.choice([-1.0, 1.0]))
    strength = next(iter(LAWS[law]))
    either = strength in ("mismatch", "asymmetry", "error", "bias") or "cross_talk" in mechanism
    if mechanism == "motor_cross_talk":
        drawn["motor"], drawn["other"] = rng.permutation(motors)[:2] + 1
    if mechanism == "payload_change" and word != "in_some_logs":
        drawn["time"] = SAMPLING * SAMPLES
    if mechanism == "effective_track" or (mechanism, word) == ("ground_slope", "bowl"):
        either = True
    values = {name: float(drawn[name]) for name in list(LAWS[law])[1:]}
    return {strength: sign * size if either else size, **values}


def constants(robot: str, seed: int) -> Robot:
    """The robot with constants of its own, as `benchmarks.hidden.cases` draws them."""
    rng = np.random.default_rng([seed, 20])
    plain = REFERENCE[robot]
    if robot == "axis":
        plain = plain.with_parameters(J=20.0, k=10.0, Cv=30.0, Cs=8.0)
    names = (*UNKNOWN[robot], *KNOWN[robot])
    return plain.with_parameters(**{n: plain.parameters[n] * float(1 + rng.uniform(-SPREAD, SPREAD)) for n in names})


def _off(robot: Robot, seed: int) -> Robot:
    """The robot whose known constants are not quite what is told."""
    rng = np.random.default_rng([seed, 23])
    changed = {}
    for names in TOLD[robot.name]:
        factor = 1.0 + float(rng.choice([-1.0, 1.0]) * rng.uniform(*OFF))
        changed |= {name: robot.parameters[name] * factor for name in names}
    return robot.with_parameters(**changed)


def _there(hidden: dict[str, dict[str, float]], number: int) -> dict[str, dict[str, float]]:
    """The laws of log `number`: a payload of some logs is there in every second one."""
    return {law: values for law, values in hidden.items() if number % 2 or not law.endswith("/in_some_logs")}


def make(
    robot: str,
    laws: Mapping[str, float],
    seed: int,
    *,
    noise_kind: str = "white",
    constants_off: bool = False,
    first: int = 0,
) -> Case:
    """Simulate a case. `laws` are {"mechanism/law": size}; `effects` of the result are the laws with all parameters.

    `first` is the place of the first law among all of its case, on which hangs what is drawn of it.
    """
    told = constants(robot, seed)
    true = _off(told, seed) if constants_off else told
    level = float(np.random.default_rng([seed, 21]).uniform(0.6, 1.4))
    noise = tuple(level * sigma for sigma in NOISE[robot])
    hidden = {
        law: parameters(robot, law, size, np.random.default_rng([seed, 22, first + number]))
        for number, (law, size) in enumerate(laws.items())
    }
    tables = {}
    for number, (role, kind) in enumerate([*(("fit", k) for k in FIT), *(("check", k) for k in CHECK)]):
        inputs = excitation.experiment(robot, kind, SAMPLES, 1000 * seed + number)
        tables[f"{role}_{kind}"] = simulate_log(
            true, inputs, SAMPLING, noise, 1000 * seed + 500 + number,
            laws=_there(hidden, number), noise_kind=noise_kind, rtol=1e-7, atol=1e-9,
        ).drop(columns="q", errors="ignore")  # fmt: skip
    names = AXIS_NAMES if robot == "axis" else {}
    nominal = {names.get(name) or name: told.parameters[name] for name in KNOWN[robot]}
    if robot == "axis":
        nominal |= {"gain": 10.0, "M": 20.0, "Fv": 30.0, "Fc": 8.0}
    truth = {names.get(name) or name: float(value) for name, value in true.parameters.items() if abs(value) < 1e29}
    return Case(robot, seed, hidden, noise, truth, nominal, tables)


def model_of(case: Case):
    """The nominal model, as its file tells it."""
    return MODEL[case.robot]().with_values(**case.nominal)

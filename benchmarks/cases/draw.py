"""One random case: a robot with its truth, logs as somebody might record them, and numbers to start from.

The case of a number is always the same. Logs are simulated in handy units and then written in the user's: lengths, masses
and inputs from 1e-3 to 1e3, times from 1/20 to 5.
"""

from dataclasses import dataclass, field

import numpy as np

import jaxid
from benchmarks.cases.family import Family, Numbers, Rng, Units
from benchmarks.cases.robots import all_families, families

SAMPLES, FEW, SAMPLING, FIT_LOGS = 300, 80, 0.02, 2

GOOD = ("good", "good, moving", "good, known start", "good, irregular")
"""Conditions in which the data is adequate and the noise white: intervals must hold the truth as often as they say."""
_SENSOR = (
    "short",
    "weak",
    "one way",
    "step",
    "coarse",
    "missing",
    "dropped rows",
    "odd first interval",
    "coloured",
    "outliers",
    "heavy tails",
    "noisy",
    "no noise",
    "moving",
    "one log in other units",
    "swapped sign",
)
_MODEL = ("process noise", "dead zone", "delay")
WIDE = (
    *GOOD,
    "process noise, dropped rows",
    "process noise, missing",
    "process noise, outliers",
    "coarse, irregular",
    "coarse, dropped rows",
    "coarse, moving",
    "coloured, missing",
    "heavy tails, odd first interval",
    "weak, coloured",
    "short, coarse",
    "short, process noise",
    "dead zone, noisy",
    "delay, noisy",
    "delay, coarse",
    "long held-out log",
    "wrong constants",
    "wrong constants, noisy",
)
"""Conditions of the wide draw, beside forces that are hidden: two things are poor at a time."""
_SHARES = {"good": 6.0, "good, moving": 1.5, "good, known start": 2.0, "good, irregular": 1.5, "process noise": 2.0}


@dataclass(frozen=True)
class Case:
    """What the estimator gets, and the truth. `truth`: free parameters; `clean`: outputs of the truth without any noise of
    the sensors or the process, by log (fit logs, then the held-out one); `adequate`: whether intervals must hold;
    `conditional`: the robot's fixed parameters are not the true ones, so that only its predictions can be right."""

    number: int
    family: str
    condition: str
    units: Units
    robot: jaxid.Robot
    truth: Numbers
    start: Numbers
    fit: jaxid.LogSet
    held_out: jaxid.LogSet
    clean: tuple[np.ndarray, ...]
    adequate: bool
    facts: dict = field(default_factory=dict)
    conditional: bool = False


def _units(rng: Rng, family: Family) -> Units:
    time = 5.0 if rng.random() < 0.1 else float(np.exp(rng.uniform(np.log(0.05), np.log(0.5))))
    length = 10 ** rng.uniform(-3, 3) if family.has_length else 1.0
    return Units(time, length, 10 ** rng.uniform(-3, 3), 10 ** rng.uniform(-3, 3))


def _times(rng: Rng, n: int, condition: str) -> np.ndarray:
    steps = np.full(n - 1, SAMPLING)
    if "irregular" in condition or "odd first interval" in condition:
        steps *= rng.uniform(0.6, 1.4, n - 1)
    if "odd first interval" in condition:
        steps[0] = SAMPLING * rng.uniform(3, 6)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _coloured(rng: Rng, shape: tuple[int, int], pole: float) -> np.ndarray:
    """AR(1) noise of standard deviation 1 [n, ny]."""
    white = rng.standard_normal(shape)
    out = np.empty(shape)
    out[0] = white[0]
    for k in range(1, shape[0]):
        out[k] = pole * out[k - 1] + np.sqrt(1 - pole**2) * white[k]
    return out


def _noise(rng: Rng, condition: str, shape: tuple[int, int], pole: float) -> np.ndarray:
    """Sensor noise in units of its standard deviation, gross errors included."""
    if "coloured" in condition:
        return _coloured(rng, shape, pole)
    if "heavy tails" in condition:
        return rng.standard_t(3, shape) / np.sqrt(3.0)
    noise = rng.standard_normal(shape)
    if "outliers" in condition:
        hit = rng.random(shape) < 0.05
        noise = np.where(hit, noise + rng.choice([-1, 1], shape) * rng.uniform(8, 40, shape), noise)
    return noise


def _applied(inputs: np.ndarray, condition: str, amount: float) -> np.ndarray:
    """What acts of the commanded inputs."""
    if "dead zone" in condition:
        threshold = amount * np.max(np.abs(inputs), axis=0)
        return np.sign(inputs) * np.maximum(np.abs(inputs) - threshold, 0.0)
    if "delay" in condition:
        late = int(amount)
        return np.concatenate([np.zeros((late, inputs.shape[1])), inputs[:-late]])
    return inputs


def _condition(rng: Rng, family: Family, wide: bool) -> str:
    names = [*(WIDE if wide else (*GOOD, *_SENSOR, *_MODEL)), *(f"unmodelled {name}" for name in family.effects)]
    if wide:
        names += [f"unmodelled {name}, coarse" for name in family.effects]
        return str(rng.choice(names))
    shares = np.array([_SHARES.get(name, 0.9) for name in names])
    return str(rng.choice(names, p=shares / shares.sum()))


def _excitation(condition: str) -> str:
    kinds = [word for word in condition.split(", ") if word in ("weak", "one way", "step")]
    return kinds[0] if kinds else "good"


def _start(rng: Rng, truth: Numbers, condition: str) -> Numbers:
    """Values that a user might have: near, off by two, or off by up to ten."""
    spread = 0.0 if condition == "good, known start" else float(rng.choice([0.1, 0.3, 1.0, 1.0]))
    return {name: value * 10 ** rng.uniform(-spread, spread) if value else 0.0 for name, value in truth.items()}


def _kind(rng: Rng, wide: bool) -> tuple[Family, str]:
    known = all_families() if wide else families()
    shares = np.array([family.share for family in known.values()])
    family = known[str(rng.choice(list(known), p=shares / shares.sum()))]
    return family, _condition(rng, family, wide)


def kind(number: int, seed: int, wide: bool = False) -> tuple[str, str]:
    """Family and condition of a case, without simulating it."""
    family, condition = _kind(np.random.default_rng([seed, number]), wide)
    return family.name, condition


def _off(rng: Rng, robot: jaxid.Robot) -> dict[str, float]:
    """The robot's fixed parameters, but for gravity, as somebody might have measured them: 1 to 5 % off."""
    fixed = {name: p.value for name, p in robot.parameters.items() if not p.free and p.value and name != "g"}
    return {name: value * (1 + rng.choice([-1, 1]) * rng.uniform(0.01, 0.05)) for name, value in fixed.items()}


def draw(number: int, seed: int, wide: bool = False) -> Case:
    """The case of a number, of the `wide` draw or the plain one. Raises `RuntimeError` where the independent simulator gives
    up."""
    rng = np.random.default_rng([seed, number])
    family, condition = _kind(rng, wide)
    words = condition.split(", ")
    units, p = _units(rng, family), family.draw(rng)
    robot = family.model(p, units)
    truth = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    effects = {}
    if condition.startswith("unmodelled "):
        effects = family.effects[words[0].removeprefix("unmodelled ")](rng, p)
    n = FEW if "short" in words else SAMPLES
    noisy, usual = 10 ** rng.uniform(-0.9, -0.3), 10 ** rng.uniform(-3, -1.5)
    level = noisy if "noisy" in words else 0.0 if "no noise" in words else usual
    if condition in GOOD:
        level = 10 ** rng.uniform(-2.7, -1.5)
    pole, amount = rng.uniform(0.6, 0.97), rng.uniform(0.05, 0.3)
    if "delay" in words:
        amount = float(rng.integers(2, 8))
    lost = rng.uniform(0.05, 0.3)
    push = 10 ** rng.uniform(-1.5, 0) if "process noise" in words else 0.0
    moving = "moving" in condition

    runs = []
    for which in range(FIT_LOGS + 1):
        if "long held-out log" in words and which == FIT_LOGS:
            n = 3 * SAMPLES
        rows = int(n / (1 - lost)) + 1 if "dropped rows" in words else n
        time = _times(rng, rows, condition)
        inputs = family.excite(rng, rows, _excitation(condition) if which < FIT_LOGS else "good", p)
        start = family.move(rng, p) if moving and which < FIT_LOGS else family.rest(p)
        acting = _applied(inputs, condition, amount)
        size = np.array(family.forces(p))
        calm = family.states(p, effects, start, time, acting, np.zeros((rows, len(size))))
        seen = clean = family.see(calm, p)
        if push:
            pushed = _coloured(rng, (rows, len(size)), 0.8) * push * size
            seen = family.see(family.states(p, effects, start, time, acting, pushed), p)
        keep = np.arange(rows)
        if "dropped rows" in words:
            keep = np.sort(np.concatenate([[0], 1 + rng.choice(rows - 1, n - 1, replace=False)]))
            # The held-out log asks what the model is worth, and must not lose what drove the robot.
            keep = keep if which < FIT_LOGS else np.arange(n)
        runs.append((time[keep] - time[keep][0], inputs[keep], seen[keep], clean[keep]))

    rms = np.sqrt(np.mean(np.concatenate([seen for _, _, seen, _ in runs]) ** 2, axis=0))
    steps = rms * 10 ** rng.uniform(-1.7, -0.5)  # of a coarse encoder
    scale_out, scale_in = np.array(family.output_units(units)), np.array(family.input_units(units))
    logs, cleans = [], []
    for which, (time, inputs, seen, clean) in enumerate(runs):
        outputs = seen + level * rms * _noise(rng, condition, seen.shape, pole)
        if "coarse" in words:
            outputs = np.round(seen / steps) * steps
        if "missing" in words:
            outputs[rng.random(len(outputs)) < lost] = np.nan
        other = 1.0
        if condition == "one log in other units" and which == 1:
            other = float(rng.choice([1000.0, 180 / np.pi, 0.001]))
        if condition == "swapped sign" and which == 1:
            other = -1.0
        name = f"fit {which + 1}" if which < FIT_LOGS else "held out"
        logs.append(
            jaxid.Log.from_arrays(
                name, time * units.time, inputs * scale_in, outputs * scale_out * other, robot.channels
            )
        )
        cleans.append(clean * scale_out)
    begin = _start(rng, truth, condition)
    conditional = "wrong constants" in words
    if conditional:
        robot = robot.with_values(**_off(rng, robot))
    if "asymmetric_friction" in effects:  # Fc (1 ± asymmetry) is exactly what an axis has in Fc and offset
        truth["offset"] += effects["asymmetric_friction"]["asymmetry"] * truth["Fc"]
    return Case(
        number=number,
        family=family.name,
        condition=condition,
        units=units,
        robot=robot,
        truth=truth,
        start=begin,
        fit=jaxid.LogSet(logs[:FIT_LOGS]),
        held_out=jaxid.LogSet(logs[FIT_LOGS:]),
        clean=tuple(cleans),
        adequate=condition in GOOD,
        facts={"noise": float(level), "push": float(push), "effects": effects},
        conditional=conditional,
    )

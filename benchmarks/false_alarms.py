"""Are complete models called incomplete? `python -m benchmarks.false_alarms [--cases 950]`, then `--report`.

Robots simulated by `reference/` (no code shared with the models), to whose exact outputs noise of every kind of
`sensor_noise.py` is added, are fitted and looked at as `explain` does: nothing is missing, so that every verdict but "adequate"
is a false alarm. With `--hidden`, a force or a filter is hidden whose size is `HIDDEN` times the noise, and the share that is
seen is counted. Every finished case is a line of `benchmarks/results/false_alarms.jsonl` (`false_alarms_hidden.jsonl`); a run
that is stopped goes on where it was. `--report` writes `docs/false_alarms.md`.
"""

import argparse
import time
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path

import jax
import numpy as np

import jaxid
from benchmarks.cases.family import Family, Units, signal
from benchmarks.cases.robots import families as every_family
from benchmarks.false_alarms_page import write
from benchmarks.sensor_noise import KINDS, Exact
from benchmarks.silent import append, code_version, rows_of
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.level import FALSE_ALARM, at_level
from jaxid.explanation.search.search import search
from jaxid.explanation.search.steps import Search

RESULTS = Path(__file__).parent / "results" / "false_alarms.jsonl"
PAGE = Path(__file__).parents[1] / "docs" / "false_alarms.md"
SEED = 12
LEVELS = (0.001, 0.003, 0.01, 0.03, 0.1)
"""Levels of the calibration curve; 0.01 is the one that decides."""
ROBOTS = {
    "axis": 0.25, "pioneer": 0.15, "omni": 0.1, "pendulum": 0.15, "differential drive, own": 0.2, "two masses": 0.15,
}  # fmt: skip
"""Robots and their shares of the cases; the omni's take longest."""
VARIANTS = 4
"""Sets of constants and motions of each robot in each setting; the noise is drawn anew for every case."""
SIZES = (0.005, 0.05)
"""Standard deviation of the noise as a share of the signals' root mean square, from and to."""
HIDDEN = (0.5, 3.0)
"""Root mean square of what is hidden on held-out logs in units of the noise, once the fit has absorbed what it can."""
_COMMANDS = 50.0
"""Rate [Hz] at which commands change, at most."""
_OMNI = 1000.0
"""Samples of a log of the omni, at most: a first look at its candidates takes minutes on longer ones."""
_FORGET = 100
"""Cases after which compiled programs are forgotten."""


@cache
def families() -> dict[str, Family]:
    """The robots of the study by name; the pendulum is driven too little to go over the top, where nothing predicts it."""
    found = {name: every_family()[name] for name in ROBOTS}
    calm = replace(
        found["pendulum"], excite=lambda rng, n, kind, p: signal(rng, n, kind, 0.3 * p["mgl"], p["tau"])[:, None]
    )
    return found | {"pendulum": calm}


@dataclass(frozen=True)
class Setting:
    """How logs are recorded: sampling `rate` [Hz], `seconds` of each log, how many to fit and to hold out; `share` of cases."""

    rate: float
    seconds: float
    fit: int
    held_out: int
    share: float


SETTINGS = {
    "50 Hz, 20 s, 3 + 2 logs": Setting(50.0, 20.0, 3, 2, 0.3),
    "20 Hz, 30 s, 3 + 2 logs": Setting(20.0, 30.0, 3, 2, 0.15),
    "200 Hz, 10 s, 2 + 2 logs": Setting(200.0, 10.0, 2, 2, 0.15),
    "1 kHz, 10 s, 2 + 1 logs": Setting(1000.0, 10.0, 2, 1, 0.1),
    "50 Hz, 10 s, 1 + 1 logs": Setting(50.0, 10.0, 1, 1, 0.12),
    "50 Hz, 2 min, 1 + 1 logs": Setting(50.0, 120.0, 1, 1, 0.06),
    "50 Hz, 10 s, 8 + 6 logs": Setting(50.0, 10.0, 8, 6, 0.12),
}


@dataclass(frozen=True)
class Case:
    """One case: which robot in which setting, which of its variants, which noise of which size, and what is hidden."""

    number: int
    robot: str
    setting: str
    variant: int
    kind: str
    size: float
    hidden: str = ""
    strength: float = 0.0


def draw(number: int, seed: int, hidden: bool = False) -> Case:
    """The case of a number: kinds of noise take turns, all else is drawn."""
    rng = np.random.default_rng([seed, number])
    robot = str(rng.choice(list(ROBOTS), p=list(ROBOTS.values())))
    possible = {name: own.share for name, own in SETTINGS.items() if robot != "omni" or own.rate * own.seconds <= _OMNI}
    setting = str(rng.choice(list(possible), p=np.array(list(possible.values())) / sum(possible.values())))
    size = float(np.exp(rng.uniform(*np.log(SIZES))))
    kind = list(KINDS)[number % len(KINDS)]
    case = Case(number, robot, setting, int(rng.integers(VARIANTS)), kind, size)
    if not hidden:
        return case
    # Friction of one direction is, on the axis, friction and an offset, which its model has.
    what = str(rng.choice([name for name in families()[robot].effects if name != "asymmetric"]))
    return replace(case, hidden=what, strength=float(rng.uniform(*HIDDEN)))


@lru_cache(maxsize=4)
def exact(robot: str, setting: str, variant: int, hidden: str, seed: int):
    """The user's model, inputs and exact logs of one variant: (robot, [(inputs, Exact)])."""
    family, how = families()[robot], SETTINGS[setting]
    rng = np.random.default_rng([seed, list(ROBOTS).index(robot), list(SETTINGS).index(setting), variant, 7])
    p = family.draw(rng)
    # Effects are drawn by a generator of their own, so that the motions are those of the complete model.
    effects = family.effects[hidden](np.random.default_rng([seed, variant, 8]), p) if hidden else {}
    time = np.arange(round(how.rate * how.seconds) + 1) / how.rate
    logs = []
    for k in range(how.fit + how.held_out):
        held = family.excite(rng, int(how.seconds * _COMMANDS) + 2, "good", p)
        inputs = held[np.floor(time * _COMMANDS + 1e-6).astype(int)]
        forces = np.zeros((len(time), len(family.forces(p))))
        states = family.states(p, effects, family.rest(p), time, inputs, forces)
        logs.append((inputs, Exact(time, family.see(states, p), k)))
    return family.model(p, Units(1.0, 1.0, 1.0, 1.0)), logs


def logs_of(model: jaxid.Robot, logs, outputs, fit: int) -> tuple[jaxid.LogSet, jaxid.LogSet]:
    """Logs to fit and to hold out, with these outputs [T, ny] each."""
    made = [
        jaxid.Log.from_arrays(f"{'fit' if k < fit else 'held out'} {k}", own.time, inputs, y, model.channels)
        for k, ((inputs, own), y) in enumerate(zip(logs, outputs, strict=True))
    ]
    return jaxid.LogSet(made[:fit]), jaxid.LogSet(made[fit:])


@lru_cache(maxsize=4)
def _hidden_size(robot: str, setting: str, variant: int, hidden: str, seed: int):
    """Root mean square [share of the signals'] of what is hidden, that a fit to exact logs leaves on the held-out ones."""
    model, logs = exact(robot, setting, variant, hidden, seed)
    fit_logs, held_out = logs_of(model, logs, [own.outputs for _, own in logs], SETTINGS[setting].fit)
    fit = jaxid.output_error(model, fit_logs)
    state = held_out_state(
        fit.robot, held_out, dict(zip(model.channels.outputs, sizes(logs), strict=False)) | _rest(model)
    )
    return state.normalised_rms


def _rest(model: jaxid.Robot) -> dict[str, float]:
    return {name: 1.0 for name in model.channels.measured if name not in model.channels.outputs}


def sizes(logs) -> np.ndarray:
    """Root mean square [ny] of the exact outputs, all logs together."""
    return np.sqrt(np.mean(np.concatenate([own.outputs for _, own in logs]) ** 2, axis=0))


def prepared(case: Case, seed: int):
    """Model, logs to fit and to hold out, and the standard deviation of the noise [ny]."""
    model, logs = exact(case.robot, case.setting, case.variant, case.hidden, seed)
    size = case.size
    if case.hidden:
        size = _hidden_size(case.robot, case.setting, case.variant, case.hidden, seed) / case.strength
    noise = size * sizes(logs)
    rng = np.random.default_rng([seed, case.number, 9])
    outputs = [KINDS[case.kind](rng, own, noise) for _, own in logs]
    return model, *logs_of(model, logs, outputs, SETTINGS[case.setting].fit), noise


def run(case: Case, seed: int = SEED, most: int = 0) -> dict:
    """Fit, look for what is missing, add at `most` so many effects, and say what came of it."""
    model, logs, held_out, noise = prepared(case, seed)
    begin = time.perf_counter()
    fit = jaxid.output_error(model, logs)
    fitted = time.perf_counter() - begin
    found = search(fit, logs, held_out, most=most)
    before = found.before
    true = dict(zip(model.channels.outputs, noise, strict=False))
    return {
        "number": case.number,
        **{name: getattr(case, name) for name in ("robot", "setting", "variant", "kind", "size", "hidden", "strength")},
        "alarm": alarm(found),
        "alarms": {} if case.hidden else alarms(found, fit, logs, held_out),
        "named": [step.chosen.id for step in found.steps],
        "why": _why(found),
        "normalised_rms": before.normalised_rms,
        "usual": before.usual,
        "level": {name: before.noise[name] / float(true[name]) for name in before.noise if name in true},
        "p_white": before.p_white,
        "p_value": before.p_value,
        "p_colour": found.colour.p_value if found.colour is not None else None,
        "noise_error": before.noise_error,
        "judgement": fit.judgement.verdict if fit.judgement else "",
        "seconds": [round(fitted, 2), round(time.perf_counter() - begin - fitted, 2)],
    }


def alarm(found: Search) -> bool:
    """Whether something is called missing, or left open."""
    enough = found.after.adequate or (found.colour is not None and found.colour.simple)
    return bool(found.steps) or not enough


def alarms(found: Search, fit: jaxid.Fit, logs: jaxid.LogSet, held_out: jaxid.LogSet) -> dict[str, bool]:
    """Whether something is called missing at every one of `LEVELS`, where `found` is at the usual one."""
    before, usual, every = found.before, alarm(found), {}
    for level in LEVELS:
        same = level == FALSE_ALARM or before.normalised_rms < before.negligible or before.p_value >= max(LEVELS)
        if same:
            every[str(level)] = usual
        elif found.colour is not None and found.colour.simple and before.p_value < min(LEVELS):
            every[str(level)] = found.colour.p_value < level
        else:
            with at_level(level):
                every[str(level)] = alarm(search(fit, logs, held_out, most=0))
    return every


def _why(found: Search) -> str:
    """Which rule decided."""
    state = found.after
    if found.before.adequate:
        return "within errors" if found.before.within_errors and found.before.p_value < FALSE_ALARM else "white"
    if state.adequate:
        return "adequate after refit"
    if found.colour is None:
        return "not noise"
    return "coloured" if found.colour.simple else "coloured, open"


def main() -> None:
    """Run what is not done yet, or write the page."""
    parser = argparse.ArgumentParser(description="Are complete models called incomplete?")
    parser.add_argument("--cases", type=int, default=50 * len(KINDS))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--numbers", type=int, nargs="+", help="these cases")
    parser.add_argument("--kind", help="only kinds of noise that hold this word")
    parser.add_argument("--robot", help="only this one")
    parser.add_argument("--setting", help="only settings that hold this word")
    parser.add_argument("--seed", type=int, default=SEED, help="another one draws cases that nobody has seen")
    parser.add_argument("--hidden", action="store_true", help="with something hidden")
    parser.add_argument(
        "--most", type=int, default=0, help="effects to be named; none is needed to see that one is missing"
    )
    parser.add_argument("--seconds", type=float, default=np.inf, help="begin no further case after so many")
    parser.add_argument("--out", type=Path, help="by default a file of the draw's own")
    parser.add_argument("--report", action="store_true", help="write docs/false_alarms.md from what has been run")
    arguments = parser.parse_args()
    name = RESULTS.stem + "_hidden" * arguments.hidden + (f"_{arguments.seed}" if arguments.seed != SEED else "")
    out = arguments.out or RESULTS.with_name(f"{name}.jsonl")
    if arguments.report:
        write(rows_of(out), rows_of(out.with_name(f"{out.stem}_hidden.jsonl")), LEVELS, list(SETTINGS), PAGE)
        return
    code, begin = code_version(), time.perf_counter()
    numbers = arguments.numbers or range(arguments.first, arguments.first + arguments.cases)
    cases = [draw(number, arguments.seed, arguments.hidden) for number in numbers]
    done = {row["number"] for row in rows_of(out) if row["code"] == code}
    left = [
        case
        for case in cases
        if case.number not in done
        and arguments.robot in (None, case.robot)
        and (arguments.kind or "") in case.kind
        and (arguments.setting or "") in case.setting
    ]
    # A few hundred at a time, those of one variant one after the other: they share programs and exact logs.
    left.sort(key=lambda case: (case.number // 500, case.robot, case.setting, case.variant, case.hidden, case.number))
    alarms = 0
    for count, case in enumerate(left, start=1):
        if time.perf_counter() - begin > arguments.seconds:
            break
        row = run(case, arguments.seed, arguments.most)
        append(out, row | {"code": code})
        alarms += row["alarm"]
        print(
            f"{case.number} {case.robot}, {case.setting}, {case.kind}{', ' * bool(case.hidden)}{case.hidden}: "
            f"{'ALARM' * row['alarm']} {row['why']} {' '.join(row['named'])} {row['normalised_rms']:.3f} ({row['usual']:.3f}) "
            f"p {row['p_white']:.2g} {row['judgement']} {row['seconds']} s; {alarms} of {count} of {len(left)} in "
            f"{time.perf_counter() - begin:.0f} s",
            flush=True,
        )
        if count % _FORGET == 0:
            jax.clear_caches()


if __name__ == "__main__":
    main()

"""Following a payload on-line: what a sample costs, how soon a change is told, and how often one is told without any.

    python -m benchmarks.online

A drive axis from the independent simulator in `reference/` (true sticking friction, noise 0.01 m/s, 50 Hz) takes on 40 %
more mass, and dry friction with it, half-way. Recursive least squares with forgetting and the moving window follow it. Then
the same axis without any change, on other noise and inputs: how often a change is told. Results go to
`benchmarks/results/online.json`, the picture to `docs/online/payload.png`.
"""

import json
import platform
import time
from dataclasses import replace
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

import jaxid
from jaxid.estimate.linear.window_equations import window_equations
from jaxid.report.style import HOUSE
from reference.axis import AXIS
from reference.logs import simulate

RESULTS = Path(__file__).parent / "results" / "online.json"
PICTURE = Path(__file__).parents[1] / "docs" / "online" / "payload.png"
INTERVAL, NOISE, SECONDS = 0.02, 0.01, 60.0
WINDOW, MEMORY, REFIT = 4.0, 20.0, 10
"""Seconds of a window and of the memory, and samples from one fit to the next."""
FORGETTING = 0.995
LOAD = {"J": 1.4, "Cs": 0.6}
NAMES = {"M": "J", "Fv": "Cv", "Fc": "Cs"}
"""The axis's parameters as the simulator calls them."""
QUIET = 40
COLOURED = (0.8, 0.95)
"""Correlation of neighbouring errors."""


class Run(NamedTuple):
    """Samples: `time` [T], `inputs` [T, 1], `outputs` [T, 1]."""

    time: np.ndarray
    inputs: np.ndarray
    outputs: np.ndarray


def recorded(seed: int, seconds: float = SECONDS, load: dict[str, float] | None = None, related: float = 0.0) -> Run:
    """Levels of force, held for half a second; from half-way on with another load. Errors are `related` to their neighbours."""
    random, T = np.random.default_rng(seed), int(seconds / INTERVAL)
    inputs = np.repeat(random.uniform(-6.0, 6.0, -(-T // 25)), 25)[:T, None]
    half = T // 2 if load else T
    light = simulate(AXIS, np.concatenate([inputs[:half], inputs[half - 1 : half]]), INTERVAL)
    speeds = [light.speeds[:half, 0]]
    if load:
        heavy = replace(AXIS, parameters={**AXIS.parameters, **load})
        speeds.append(simulate(heavy, inputs[half:], INTERVAL, start=dict(enumerate(light.states[half]))).speeds[:, 0])
    noise = lfilter([np.sqrt(1.0 - related**2)], [1.0, -related], random.standard_normal((T, 1)), axis=0)
    outputs = np.concatenate(speeds)[:, None] + NOISE * noise
    return Run(INTERVAL * np.arange(T), inputs, outputs)


def truth(name: str, time: np.ndarray) -> np.ndarray:
    """True values of a parameter [T]."""
    before = AXIS.parameters[NAMES[name]]
    return np.where(time < SECONDS / 2, before, LOAD.get(NAMES[name], before))


def by_recursion(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Times [K], estimates and standard errors [K, n], and microseconds an equation."""
    robot = jaxid.Axis()
    equations = window_equations(robot, [jaxid.Log.from_arrays("run", *run, robot)], "momentum")
    begun = time.process_time()
    _, theta, errors = jaxid.recursive_least_squares(equations.regressors, equations.targets, FORGETTING)
    return equations.time, theta, errors, (time.process_time() - begun) / len(equations) * 1e6


def by_window(run: Run) -> tuple[list[jaxid.WindowFit], np.ndarray]:
    """A fit every few samples, and the seconds each took. What has changed is forgotten when it is named."""
    window = jaxid.MovingWindow(jaxid.Axis(), WINDOW, noise={"v": NOISE}, memory=MEMORY)
    fits, seconds = [], []
    for k in range(0, len(run.time), REFIT):
        window.add(*(values[k : k + REFIT] for values in run))
        if not window.full:
            continue
        begun = time.process_time()
        fits.append(window.refit())
        seconds.append(time.process_time() - begun)
        if fits[-1].changed:
            window.forget(fits[-1].changed)
    return fits, np.array(seconds)


def picture(run: Run, recursion, fits: list[jaxid.WindowFit]) -> None:
    """Estimates of both, with standard errors, and the truth."""
    import matplotlib.pyplot as plt

    plt.rcParams.update(HOUSE)
    times, theta, errors, _ = recursion
    names, at = jaxid.Axis().parameters.free_names, np.array([fit.time for fit in fits])
    across = [fit.time for fit in fits if fit.alarm and not fit.sound][
        :: max(sum(f.alarm and not f.sound for f in fits) - 1, 1)
    ]
    figure, axes = plt.subplots(len(NAMES), 1, figsize=(7, 6), sharex=True, layout="constrained")
    for axis, name in zip(axes, NAMES, strict=True):
        j, true = names.index(name), truth(name, run.time)
        own, spread = (np.array([getattr(fit, of)[name] for fit in fits]) for of in ("values", "std_errors"))
        axis.plot(times, theta[:, j], color="C1", label=f"recursive least squares, forgetting {FORGETTING}")
        axis.fill_between(at, own - 2 * spread, own + 2 * spread, color="C0", alpha=0.3)
        axis.plot(at, own, color="C0", label=f"moving window of {WINDOW:g} s, two standard errors")
        axis.plot(run.time, true, "k--", lw=1, label="true")
        axis.set(ylabel=f"{name} [{jaxid.Axis().parameters[name].unit}]", ylim=(0.7 * true.min(), 1.3 * true.max()))
        axis.axvspan(*across, color="0.9")
    axes[0].legend(loc="upper left")
    axes[-1].set_xlabel("time [s]")
    PICTURE.parent.mkdir(exist_ok=True)
    figure.savefig(PICTURE, dpi=90)
    plt.close(figure)


def quiet(seeds: range, related: float = 0.0) -> dict[str, float]:
    """How often a change is told where there is none: of windows that share no sample, and all of them; and how often the 95 %
    interval of a sound window apart holds a parameter, all together."""
    p, told, begun, fits, off = [], 0, 0, 0, []
    for seed in seeds:
        found, _ = by_window(recorded(seed, related=related))
        apart = [fit for fit in found[:: round(WINDOW / INTERVAL / REFIT)] if fit.sound]
        off += [abs(f.values[n] - AXIS.parameters[own]) / f.std_errors[n] for f in apart for n, own in NAMES.items()]
        later = [fit for fit in found if np.isfinite(fit.p_value)]
        told, fits = told + sum(fit.alarm for fit in later), fits + len(later)
        begun += sum(fit.alarm and not before.alarm for before, fit in pairwise(later))
        p += [fit.p_value for fit in later[:: round(WINDOW / INTERVAL / REFIT)]]
    return {
        "windows_apart": len(p),
        "p_below_0.05": float(np.mean(np.array(p) < 0.05)),
        "p_below_0.01": float(np.mean(np.array(p) < 0.01)),
        "fits": fits,
        "alarms_at_0.001": told / fits,
        "begun_at_0.001": begun,
        "in_95_percent": float(np.mean(np.array(off) < 1.96)),
    }


def update_seconds(parameters: int, count: int = 3000) -> float:
    """Processor time of one update of the recursive estimator, called sample by sample without `jit`."""
    random = np.random.default_rng(0)
    rows, targets = random.standard_normal((count, parameters)), random.standard_normal(count)
    state = jaxid.RecursiveLeastSquares.start(parameters).update(rows[0], targets[0], FORGETTING)
    begun = time.process_time()
    for row, target in zip(rows, targets, strict=True):
        state = state.update(row, target, FORGETTING)
    return (time.process_time() - begun) / count


def main() -> None:
    run = recorded(1, load=LOAD)
    recursion = by_recursion(run)
    fits, seconds = by_window(run)
    picture(run, recursion, fits)
    alarms, named = [fit for fit in fits if fit.alarm], [fit for fit in fits if fit.changed]
    last, names = fits[-1], jaxid.Axis().parameters.free_names
    rows = {
        "samples_in_a_window": round(WINDOW / INTERVAL),
        "refit_ms": float(np.median(seconds)) * 1e3,
        "refit_us_a_sample": float(np.median(seconds)) / REFIT * 1e6,
        "recursion_us_an_equation": recursion[3],
        "update_us_4_parameters": update_seconds(4) * 1e6,
        "update_us_8_parameters": update_seconds(8) * 1e6,
        "alarm_after_s": alarms[0].time - SECONDS / 2,
        "alarms_before": sum(fit.time < SECONDS / 2 for fit in alarms),
        "named_after_s": [fit.time - SECONDS / 2 for fit in named],
        "named": [list(fit.changed) for fit in named],
        "at_the_end": {
            name: {
                "true": float(truth(name, run.time)[-1]),
                "window": [last.values[name], last.std_errors[name]],
                "recursion": [float(recursion[1][-1, j]), float(recursion[2][-1, j])],
            }
            for j, name in enumerate(names)
            if name in NAMES
        },
        "without_a_change": quiet(range(100, 100 + QUIET)),
        "without_a_change_in_coloured_noise": {
            str(related): quiet(range(100, 100 + QUIET), related) for related in COLOURED
        },
    }
    document = {"command": "python -m benchmarks.online", "machine": platform.processor() or platform.machine()}
    versions = {name: version(name) for name in ("jax", "numpy", "scipy", "llvmlite")}
    RESULTS.write_text(json.dumps(document | {"versions": versions} | rows, indent=1) + "\n")
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()

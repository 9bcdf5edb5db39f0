"""Plants that a free simulation cannot follow: what windows and a given controller make of them, against the truth.

    python -m benchmarks.unstable

prints the table of docs/unstable.md. The motion is simulated here, by Runge-Kutta steps of 1 ms in NumPy, for all
repeats at once; nothing of jaxid is in it.
"""

import warnings
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from jaxid import Channels, Controller, Custom, Log, LogSet, Parameter, output_error
from jaxid.estimate.output_error.predictability import predictability

Array = NDArray[np.float64]
CHANNELS = Channels(("u",), ("q",), units={"u": "N m", "q": "rad"})
TRUTH = {"g": 9.0, "d": 0.1, "b": 1.0}
INTERVAL, SAMPLES, FINE, REPEATS = 0.02, 300, 20, 40
GAINS = (30.0, 6.0)


def robot() -> Custom:
    """q'' = -g sin q - d q' + b u, the angle measured."""

    def dynamics(state, inputs, p):
        return {"q": state["w"], "w": -p["g"] * jnp.sin(state["q"]) - p["d"] * state["w"] + p["b"] * inputs["u"]}

    table = {name: Parameter(value, free=True, lower=0.0) for name, value in TRUTH.items()}
    return Custom(dynamics=dynamics, state_names=("q", "w"), own_channels=CHANNELS, table=table, title="pendulum")


def law(reference, measured, state, p):
    """Proportional and derivative control of the angle from upright, beside the commanded sequence."""
    q = measured["q"]
    rate = (q - state["before"]) / INTERVAL
    return {"u": reference["plan"] - GAINS[0] * (q - jnp.pi) - GAINS[1] * rate}, {"before": q}


def _motion(q: Array, w: Array, u: Array) -> tuple[Array, Array]:
    h = INTERVAL / FINE

    def rates(q, w):
        return w, -TRUTH["g"] * np.sin(q) - TRUTH["d"] * w + TRUTH["b"] * u

    for _ in range(FINE):
        a = rates(q, w)
        b = rates(q + 0.5 * h * a[0], w + 0.5 * h * a[1])
        c = rates(q + 0.5 * h * b[0], w + 0.5 * h * b[1])
        d = rates(q + h * c[0], w + h * c[1])
        q = q + h * (a[0] + 2 * b[0] + 2 * c[0] + d[0]) / 6
        w = w + h * (a[1] + 2 * b[1] + 2 * c[1] + d[1]) / 6
    return q, w


def recorded(plan: Array, first: float, noise: float, closed: bool, seed: int) -> list[Log]:
    """A log for each row of `plan` [R, T]; `closed`: the controller adds to it, from the measured angle."""
    rng, (R, T) = np.random.default_rng(seed), plan.shape
    q, w, before = np.full(R, first), np.zeros(R), np.full(R, first)
    measured, inputs = np.zeros((R, T)), np.array(plan)
    for k in range(T):
        measured[:, k] = q + noise * rng.normal(size=R)
        if closed:
            rate = (measured[:, k] - before) / INTERVAL
            inputs[:, k] += -GAINS[0] * (measured[:, k] - np.pi) - GAINS[1] * rate
        before = measured[:, k]
        q, w = _motion(q, w, inputs[:, k])
    time = INTERVAL * np.arange(T)
    return [
        Log.from_arrays(f"{r}", time, inputs[r][:, None], measured[r][:, None], CHANNELS, extra={"plan": plan[r]})
        for r in range(R)
    ]


def _plans(amplitude: float, each: int) -> Array:
    rng = np.random.default_rng(4)
    return amplitude * np.repeat(rng.choice([-1.0, 1.0], (REPEATS, SAMPLES // each)), each, axis=1)


def _row(name: str, logs: list[Log], **options) -> str:
    inside, error, spread, start = 0, [], [], {"g": 8.0, "d": 0.15, "b": 0.9}
    for log in logs:
        fit = output_error(robot(), LogSet([log]), start=start, **options)
        own = [abs(fit[p].value - v) < 1.96 * fit[p].std_error for p, v in TRUTH.items()]
        inside += sum(own)
        error.append([(fit[p].value - v) / fit[p].std_error for p, v in TRUTH.items()])
        spread.append([fit[p].std_error for p in TRUTH])
    cells = ", ".join(f"{p} {np.median(s):.2g}" for p, s in zip(TRUTH, np.array(spread).T, strict=True))
    bias = ", ".join(f"{p} {m:+.2f}" for p, m in zip(TRUTH, np.nanmean(np.array(error), axis=0), strict=True))
    count = len(logs) * len(TRUTH)
    return f"| {name} | {inside} of {count} ({100 * inside / count:.0f} %) | {cells} | {bias} |"


def main(report: Callable[[str], None] = print) -> None:
    """Print growth of errors, and coverage, errors and bias of windows and of the closed loop."""
    warnings.simplefilter("ignore")
    over = recorded(_plans(8.0, 30), 0.0, 0.01, False, 1)
    upright = recorded(_plans(3.0, 15), np.pi, 0.002, True, 2)
    report("| record | free simulation |\n| --- | --- |")
    for name, logs in (("over the top", over), ("upright, in its loop", upright)):
        report(f"| {name} | {predictability(robot(), LogSet(logs[:1])).sentence} |")
    report("\n| fit of one record | truth inside the 95 % interval | median standard errors | bias [standard errors] |")
    report("| --- | --- | --- | --- |")
    report(_row("over the top, windows of 1.2 s", over, windows=1.2))
    report(_row("upright, windows of 1 s", upright, windows=1.0))
    loop = Controller(law, ("plan",), states=("before",), start={"before": float(np.pi)})
    report(_row("upright, closed loop given", upright, controller=loop))


if __name__ == "__main__":
    main()

"""Machine code against XLA: a rollout's derivatives and an output-error fit's linearisation, in three ways.

    PJRT_NPROC=1 python -m benchmarks.kernel    # a few minutes on an idle core

Pioneer (8 free parameters, 3 initial states), omni and a drive axis; 8 and 128 experiments of 1,000 samples at 50 Hz, four
sub-steps with sticking friction. The ways: machine code called from NumPy ("direct", as `output_error` works), the same
machine code called from XLA's programs (under `jit` and `vmap`), and XLA's own scan. What is timed:

- derivatives: outputs and their derivatives by parameters and initial states, each way (from NumPy copied out of the lanes,
  to be compared, which a fit never does: it shows where they are many);
- linearisation: residual and Jacobian reduced to the arrow-shaped triangle, all initial states free, by machine code from
  NumPy and from XLA's program: what a fit waits for at every step.

The least processor time of several runs, the ways in turn, which other work on the machine disturbs least; the first call's
elapsed seconds (compiling; the machine code itself is made by the first way and there for the second); and how far the
results agree. Results go to `benchmarks/results/kernel.json`, machine and versions beside them.
"""

import json
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxid import Axis, Integrator, Log, LogSet, Omni, Pioneer, Robot, float64, output_error_problem
from jaxid.estimate.output_error.direct import linearised_directly
from jaxid.estimate.output_error.laid_out import direct
from jaxid.estimate.output_error.problem import linearise
from jaxid.kernel.direct import outputs, tangents
from jaxid.kernel.groups import grouped, ungrouped
from jaxid.kernel.machine import lanes
from jaxid.simulation.direct import machine_model
from jaxid.simulation.rollout import rollout, rollout_in_xla

RESULTS = Path(__file__).parent / "results" / "kernel.json"
SAMPLES, SUBSTEPS, INTERVAL = 1000, 4, 0.02
EXPERIMENTS = (8, 128)
RUNS = 6
DIRECT, CALLED, XLA = "direct", "called from XLA", "XLA alone"
NOISE = 0.01


def excited(robot: Robot, experiments: int) -> np.ndarray:
    """Inputs [E, T, nu] that change every half second."""
    rng = np.random.default_rng(1)
    levels = rng.choice([-6.0, 0.0, 6.0], size=(experiments, SAMPLES // 25, len(robot.channels.inputs)))
    return np.repeat(levels, 25, axis=1)


def derivatives(robot: Robot, run: Callable, inputs: np.ndarray) -> Callable[[], Any]:
    """Outputs [E, T, Y] and their derivatives [E, T, Y, n + s], by a compiled program around the rollout `run`."""
    names, states = robot.parameters.free_names, robot.estimated_states
    numbers = {name: jnp.asarray(value) for name, value in robot.parameters.numbers.items()}
    at_rest = {name: jnp.asarray(value) for name, value in robot.initial_state().items()}
    integrator, dt, shown = Integrator(SUBSTEPS), jnp.full(SAMPLES, INTERVAL), len(robot.channels.outputs)

    def simulated(x, inputs):
        p = {**numbers, **dict(zip(names, x[: len(names)], strict=True))}
        start = {**at_rest, **dict(zip(states, x[len(names) :], strict=True))}
        return run(robot, p, start, inputs, dt, integrator)[:, :shown]

    def lane(x, inputs):
        columns = jnp.eye(x.size)
        return jax.vmap(lambda t: jax.jvp(lambda x: simulated(x, inputs), (x,), (t,)), out_axes=(None, -1))(columns)

    x = jnp.array([*(numbers[name] for name in names), *(at_rest[name] for name in states)])
    program, u = jax.jit(jax.vmap(lane, in_axes=(None, 0))), jnp.asarray(inputs)
    return lambda: jax.block_until_ready(program(x, u))


def derivatives_directly(robot: Robot, inputs: np.ndarray) -> Callable[[], Any]:
    """The same from NumPy, the inputs laid out in lanes beforehand as in a fit."""
    names, (E, T, _) = tuple(robot.parameters.numbers), inputs.shape
    integrator, shown = Integrator(SUBSTEPS), len(robot.channels.outputs)
    u, dt, fixed = (grouped(a) for a in (inputs[:, :, None], np.full((E, T), INTERVAL), np.zeros((E, T, 0))))
    shares = np.full((SUBSTEPS, lanes()), 1.0 / SUBSTEPS)
    moving = tuple(names.index(name) for name in robot.parameters.free_names)
    started = [robot.states.index(name) for name in robot.estimated_states]
    n, s = len(moving), len(started)
    dp, dx = np.zeros((E, n + s, n)), np.zeros((E, n + s, len(robot.states)))
    dp[:, np.arange(n), np.arange(n)] = dx[:, n + np.arange(s), started] = 1.0
    p = np.tile(list(map(float, robot.parameters.numbers.values())), (E, 1))
    x = np.tile([float(robot.initial_state()[name]) for name in robot.states], (E, 1))

    def run():
        model = machine_model(robot, names, integrator.friction)
        if model is None:
            raise RuntimeError(f"{robot.name} has no machine code here")
        system = model.system
        seen = shares, grouped(p), grouped(x), u, dt, fixed
        found = outputs(system, seen), tangents(system, moving, seen, grouped(dp), grouped(dx))
        return tuple(ungrouped(a, E)[:, :, :shown] for a in found)

    return run


def linearisations(robot: Robot, inputs: np.ndarray) -> dict[str, Callable[[], Any]]:
    """A fit's linearisation, by machine code from NumPy and as a compiled program."""
    rng, time_ = np.random.default_rng(2), INTERVAL * np.arange(SAMPLES)
    shown = {name: NOISE * rng.normal(size=(len(inputs), SAMPLES)) for name in robot.channels.outputs}
    logs = LogSet(
        Log.from_arrays(f"{e}", time_, inputs[e], {name: y[e] for name, y in shown.items()}, robot)
        for e in range(len(inputs))
    )
    problem, there = output_error_problem(robot, logs, initial_states="estimate", integrator=Integrator(SUBSTEPS))
    program = jax.jit(linearise, static_argnums=0)
    laid_out = direct(problem.structure, problem.arrays)
    if laid_out is None:
        raise RuntimeError(f"{robot.name} has no machine code here")
    return {
        DIRECT: lambda: linearised_directly(laid_out, there),
        CALLED: lambda: jax.block_until_ready(program(problem.structure, problem.arrays, there)),
    }


def timed(ways: dict[str, Callable[[], Any]]) -> tuple[dict[str, float], dict[str, Any]]:
    """First call [s] and processor time [ms] of every way, ratios to the first way, and results."""
    found, results = {}, {}
    for name, run in ways.items():
        begin = time.perf_counter()
        results[name] = run()
        found[f"{name}, first call [s]"] = time.perf_counter() - begin
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(RUNS):
        for name, run in ways.items():  # in turn, so that the machine's moods fall on all
            begin = time.process_time()
            run()
            spent[name].append(time.process_time() - begin)
    least, *others = ways
    for name, seconds in spent.items():
        found[f"{name} [ms]"] = 1e3 * min(seconds)
    for name in others:
        found[f"{name} / {least}"] = min(spent[name]) / min(spent[least])
    return found, results


def _apart(found: Any, expected: Any) -> float:
    """Largest difference of derivatives, each in units of its largest."""
    found, expected = np.asarray(found), np.asarray(expected)
    size = np.abs(expected).max(axis=tuple(range(expected.ndim - 1)))
    return float(np.max(np.abs(found - expected) / np.where(size > 0, size, 1.0)))


def measured(robot: Robot, experiments: int) -> dict[str, dict[str, float]]:
    """Both rows of a robot."""
    inputs = excited(robot, experiments)
    ways = {
        DIRECT: derivatives_directly(robot, inputs),
        CALLED: derivatives(robot, rollout, inputs),
        XLA: derivatives(robot, rollout_in_xla, inputs),
    }
    by_hand, results = timed(ways)
    y, slopes = results.pop(XLA)
    by_hand["outputs differ by at most"] = max(float(np.max(np.abs(y - own))) for own, _ in results.values())
    by_hand["derivatives differ by at most, of the largest"] = max(_apart(own, slopes) for _, own in results.values())
    reduced, triangles = timed(linearisations(robot, inputs))
    reduced["triangles differ by at most, of the largest"] = _apart(
        *(triangles[way].shared for way in (DIRECT, CALLED))
    )
    return {"derivatives": by_hand, "linearisation": reduced}


def main() -> None:
    """Measure, print and write."""
    rows: dict[str, dict[str, float]] = {}
    with float64():
        for robot in (Pioneer(), Omni(), Axis()):
            for experiments in EXPERIMENTS:
                for what, row in measured(robot, experiments).items():
                    rows[title := f"{robot.name}, {experiments} experiments, {what}"] = row
                    print(title)
                    for name, value in row.items():
                        print(f"  {name:<48} {value:.3g}", flush=True)
    machine = {
        "processor": platform.processor() or platform.machine(),
        "jax": jax.__version__,
        "python": platform.python_version(),
    }
    RESULTS.write_text(json.dumps({"machine": machine, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()

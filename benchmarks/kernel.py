"""One linearisation of an output-error problem, machine code against XLA: processor time, compile time, agreement.

    PJRT_NPROC=1 python -m benchmarks.kernel

Pioneer (8 free parameters, 3 initial states), omni and a drive axis; 8 and 128 experiments of 1,000 samples at 50 Hz, four
sub-steps with sticking friction. Results go to `benchmarks/results/kernel.json`, machine and versions beside them.
"""

import json
import platform
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxid import Axis, Integrator, Omni, Pioneer, Robot, float64
from jaxid.simulation.rollout import rollout, rollout_in_xla

RESULTS = Path(__file__).parent / "results" / "kernel.json"
SAMPLES, SUBSTEPS, INTERVAL = 1000, 4, 0.02
EXPERIMENTS = (8, 128)
RUNS = 5


def linearisation(robot: Robot, run):
    """`(parameters, initial states, inputs) -> outputs [E, T, Y] and their derivatives [E, T, Y, n + s]`, compiled."""
    names, states = robot.parameters.free_names, robot.estimated_states
    numbers = {name: jnp.asarray(value) for name, value in robot.parameters.numbers.items()}
    at_rest = {name: jnp.asarray(value) for name, value in robot.initial_state().items()}
    integrator, dt, outputs = Integrator(SUBSTEPS), jnp.full(SAMPLES, INTERVAL), len(robot.channels.outputs)

    def simulated(x, inputs):
        p = {**numbers, **dict(zip(names, x[: len(names)], strict=True))}
        start = {**at_rest, **dict(zip(states, x[len(names) :], strict=True))}
        return run(robot, p, start, inputs, dt, integrator)[:, :outputs]

    def lane(x, inputs):
        columns = jnp.eye(x.size)
        return jax.vmap(lambda t: jax.jvp(lambda x: simulated(x, inputs), (x,), (t,)), out_axes=(None, -1))(columns)

    x = jnp.array([*(numbers[name] for name in names), *(at_rest[name] for name in states)])
    return jax.jit(jax.vmap(lane, in_axes=(None, 0))), x


def measured(robot: Robot, experiments: int) -> dict:
    """Processor and first-call seconds of both, and how far they agree."""
    rng = np.random.default_rng(1)
    levels = rng.choice([-6.0, 0.0, 6.0], size=(experiments, SAMPLES // 25, len(robot.channels.inputs)))
    inputs = jnp.asarray(np.repeat(levels, 25, axis=1))
    found, results = {}, {}
    programs = {name: linearisation(robot, run) for name, run in (("machine code", rollout), ("XLA", rollout_in_xla))}
    for name, (program, x) in programs.items():
        begin = time.perf_counter()
        results[name] = jax.block_until_ready(program(x, inputs))
        found[f"{name}, first call [s]"] = time.perf_counter() - begin
    spent: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(RUNS):
        for name, (program, x) in programs.items():  # in turn, so that the machine's moods fall on both
            begin = time.process_time()
            jax.block_until_ready(program(x, inputs))
            spent[name].append(time.process_time() - begin)
    for name, seconds in spent.items():
        found[f"{name} [ms]"] = 1e3 * float(np.median(seconds))
    found["ratio"] = float(np.median(np.array(spent["XLA"]) / np.array(spent["machine code"])))
    (y, dy), (expected, slopes) = results["machine code"], results["XLA"]
    found["outputs differ by at most"] = float(jnp.max(jnp.abs(y - expected)))
    size = jnp.max(jnp.abs(slopes), axis=(0, 1, 2))
    found["derivatives differ by at most, of the largest"] = float(
        jnp.max(jnp.abs(dy - slopes) / jnp.where(size > 0, size, 1))
    )
    return found


def main() -> None:
    """Measure, print and write."""
    with float64():
        rows = {
            f"{robot.name}, {experiments} experiments": measured(robot, experiments)
            for robot in (Pioneer(), Omni(), Axis())
            for experiments in EXPERIMENTS
        }
    for title, row in rows.items():
        print(title)
        for name, value in row.items():
            print(f"  {name:<48} {value:.3g}")
    machine = {
        "processor": platform.processor() or platform.machine(),
        "jax": jax.__version__,
        "python": platform.python_version(),
    }
    RESULTS.write_text(json.dumps({"machine": machine, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()

"""jaxid/estimate/output_error/over_experiments.py: experiments on several devices, and in several processes, together have the
optimum that they have on one device."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxid

ROOT = Path(__file__).parents[3]
PROGRAM = """
import json, re, sys
import jax, numpy as np
number, processes, address, each = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3], int(sys.argv[4])
jax.config.update("jax_num_cpu_devices", each)
if processes > 1:
    jax.distributed.initialize(address, num_processes=processes, process_id=number)
import jaxid
from jax.sharding import AxisType

def log(seed):
    rng = np.random.default_rng(seed)
    u, v, dt = np.repeat(rng.uniform(-4, 4, 12), 15), np.zeros(180), 0.02
    decay = np.exp(-2.0 * dt)
    for k in range(179):
        v[k + 1] = decay * v[k] + (1 - decay) * u[k] / 2.0
    return jaxid.Log.from_arrays(f"{seed}", np.arange(180) * dt, u[:, None], {"v": v + 0.01 * rng.normal(size=180)}, "axis")

robot = jaxid.Axis().change("offset", free=False).change("Fc", value=0.0, free=False).with_values(M=1.3, Fv=1.5)
with jaxid.float64():
    problem, start = jaxid.output_error_problem(robot, jaxid.LogSet(map(log, range(19))), initial_states="estimate")
    shape = problem.arrays.inputs.shape
    mesh = jax.make_mesh((jax.device_count(),), ("experiments",), axis_types=(AxisType.Auto,))
    problem, start = problem.shared_out(start, mesh)
    program = jax.jit(jaxid.minimise).lower(problem, start).compile()
    found = program(problem, start)
    gathered = re.findall(r"= f64\\[([\\d,]*)\\]\\S* all-gather", program.as_text())
    print(json.dumps({
        "parameters": np.asarray(found.parameters).tolist(), "errors": np.sqrt(np.diag(found.covariance)).tolist(),
        "cost": float(found.cost), "outcome": int(found.outcome), "devices": jax.device_count(),
        "largest": max((int(np.prod([int(n) for n in dims.split(",") if n])) for dims in gathered), default=0),
        "inputs": int(np.prod(shape)), "experiments": found.unknowns.states.shape[0],
    }))
"""


def run(processes, each):
    """What every process of the program found."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    search = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    started = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(number), str(processes), address, str(each)],
            env={**os.environ, "PYTHONPATH": search},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for number in range(processes)
    ]
    said = [process.communicate(timeout=300) for process in started]
    assert not any(process.returncode for process in started), said[0][1]
    return [json.loads(out.strip().splitlines()[-1]) for out, _ in said]


@pytest.mark.slow
@pytest.mark.parametrize("processes, each", [(1, 2), (2, 1)])
def test_two_devices_find_what_one_finds(processes, each):
    (alone,) = run(1, 1)
    for found in run(processes, each):
        assert found["devices"] == 2 and found["outcome"] == alone["outcome"] == 0
        assert found["experiments"] == 20 and alone["experiments"] == 19  # one that does not count fills up the second
        apart = np.subtract(found["parameters"], alone["parameters"]) / alone["errors"]
        assert np.max(np.abs(apart)) < 1e-6
        np.testing.assert_allclose(found["errors"], alone["errors"], rtol=1e-8)
        assert found["cost"] == pytest.approx(alone["cost"], rel=1e-10)
        assert found["largest"] < found["inputs"] / 2, "no device is given the others' samples"


def test_a_mesh_needs_an_axis_of_experiments(axis_log):
    logs = jaxid.LogSet([axis_log("a", [1.0] * 30, 0.01, 1, position=False)])
    with jaxid.float64():
        problem, start = jaxid.output_error_problem(jaxid.Axis(), logs)
        with pytest.raises(ValueError, match="name one of them 'experiments'"):
            problem.shared_out(start, jax.make_mesh((1,), ("x",)))

"""Double precision without a global flag: the caller's JAX stays as it was."""

import subprocess
import sys
import threading
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Integrator, LogSet, float64, simulate
from jaxid._float64 import in_float64
from jaxid.papers.pioneer import equations as pioneer_equations
from jaxid.robots.pioneer import Pioneer
from jaxid.simulation.rollout import rollout

ROOT = Path(__file__).parents[1]


def single() -> bool:
    return not jax.config.jax_enable_x64 and jnp.ones(2).dtype == jnp.float32 and jnp.asarray(1.0).dtype == jnp.float32


def test_importing_jaxid_leaves_the_configuration_as_it_was():
    program = (
        "import jax; before = dict(jax.config.values); import jaxid, jax.numpy as jnp; "
        "changed = {k for k, v in jax.config.values.items() if k in before and before[k] != v}; "
        "assert not changed, changed; assert jnp.ones(1).dtype == jnp.float32"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=str(ROOT))
    assert run.returncode == 0, run.stderr


def test_a_public_function_computes_in_double_and_restores_single(axis_log):
    assert single()
    log = axis_log("step", np.full(50, 3.0))
    outputs = simulate(Axis().with_values(Fv=2.0, Fc=0.5), LogSet([log]), integrator=Integrator(2))[0]
    assert outputs.dtype == np.float64
    np.testing.assert_allclose(outputs, log.outputs, atol=1e-8)  # single precision would leave 1e-7 and more
    assert single()


def test_an_exception_restores_single_precision():
    @in_float64
    def fails():
        assert jnp.ones(1).dtype == jnp.float64
        raise ValueError("on purpose")

    with pytest.raises(ValueError, match="on purpose"):
        fails()
    assert single()


def test_blocks_nest_and_functions_recurse():
    @in_float64
    def depth(n):
        return jnp.ones(1).dtype if n == 0 else depth(n - 1)

    with float64():
        assert depth(3) == jnp.float64
        with float64():
            assert jnp.ones(1).dtype == jnp.float64
        assert jnp.ones(1).dtype == jnp.float64
    assert single()
    block = float64()
    for _ in range(2):  # the same block used again
        with block:
            assert jnp.ones(1).dtype == jnp.float64
        assert single()


def test_threads_do_not_see_each_other():
    inside, done = threading.Event(), threading.Event()
    seen: dict[str, object] = {}

    @in_float64
    def double():
        inside.set()
        done.wait(10)
        seen["double"] = jnp.ones(1).dtype

    worker = threading.Thread(target=double)
    worker.start()
    assert inside.wait(10)
    seen["single"] = single()  # while the other thread is in double precision
    done.set()
    worker.join()
    assert seen == {"single": True, "double": jnp.float64}
    # One decorated function on many threads at once
    results: list[object] = []
    threads = [
        threading.Thread(target=lambda: results.append(in_float64(lambda: jnp.ones(1).dtype)())) for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [jnp.dtype("float64")] * 8


def test_a_single_precision_program_may_jit_and_vmap_over_jaxid():
    p = Pioneer().parameters.numbers
    q = np.zeros((3, 7))
    q[:, 3] = [0.1, -0.4, 1.0]
    expected = np.stack([pioneer_equations.reduced_inertia(row, p) for row in q])
    assert expected.dtype == np.float64

    def program(rows):  # the host's own arithmetic around it is in single precision
        scale = jnp.sum(jnp.ones(4))
        return jax.vmap(lambda row: pioneer_equations.reduced_inertia(row, p))(rows), scale

    for run in (program, jax.jit(program)):
        inertia, scale = run(jnp.asarray(q))
        assert scale.dtype == jnp.float32
        np.testing.assert_allclose(inertia, expected, rtol=1e-6)  # the angles arrived in single precision
    assert single()


def test_a_single_precision_program_may_jit_a_rollout():
    robot = Axis().with_values(Fv=2.0, Fc=0.5)
    inputs = np.full((32, 1), 3.0)

    def final_speed(M):
        p = {**robot.parameters.numbers, "M": M}
        return rollout(robot, p, robot.initial_state(), jnp.asarray(inputs), jnp.full(32, 0.02), Integrator(2))[-1, 0]

    masses = jnp.array([0.5, 1.0, 2.0])
    speeds = jax.jit(jax.vmap(final_speed))(masses)
    truth = 1.25 * (1 - np.exp(-2.0 * 31 * 0.02 / np.asarray(masses)))  # (3 - 0.5) / 2 approached with M / 2 seconds
    np.testing.assert_allclose(speeds, truth, rtol=1e-5)
    assert single()

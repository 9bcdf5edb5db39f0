"""The GPU's kernel of a rollout: interpreted on a processor it is the machine code's equal, and every expression has an
instruction."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxid
from jaxid.kernel.call import System, _outputs, _tangents
from jaxid.kernel.on_gpu import call_on_gpu, gpu_program
from jaxid.simulation.friction import Sticking
from jaxid.simulation.machine_rollout import system_of

E, T, SUBSTEPS, K = 5, 9, 2, 3


def everything(p, x, u, h):
    """A step that takes every operation there is, at arguments that each can take."""
    a, b = p
    v, w = x
    s = v * a + u[0]
    terms = [
        jnp.sin(s), jnp.cos(s), jnp.exp(-(s**2)), jnp.log(1.0 + s**2), jnp.log1p(s**2), jnp.expm1(-(s**2)), jnp.tanh(s),
        jnp.sqrt(1.0 + s**2), jnp.abs(s), jnp.floor(3.0 * s), jnp.round(3.0 * s), (3.0 * s).astype(int).astype(float),
        jnp.sign(s), jnp.arctan2(s, 1.0 + b), (1.0 + s**2) ** 0.3, jnp.maximum(s, b), jnp.minimum(s, b), 1.0 / (2.0 + s**2),
        jnp.where((s > 0.0) & ~(s > b) | (s < -b), s, 0.5 * s), jnp.where(jnp.isfinite(s), s, 0.0),
    ]  # fmt: skip
    return v + h * 0.1 * sum(terms), w + h * (v - b * w)


def of_its_own() -> tuple[System, np.ndarray]:
    return System(everything, lambda p, x, u: (x[0], x[1] * p[1]), (2, 2, 1), 2), np.array([0.7, 0.3])


def of_robot(robot: jaxid.Robot, fixed=()) -> tuple[System, np.ndarray]:
    from jaxid.simulation.rollout import step

    names = tuple(robot.parameters.numbers)
    return system_of(robot.structure, names, step, Sticking(), fixed), np.array([*robot.parameters.numbers.values()])


def arrays(system: System, numbers: np.ndarray, rows: int = 1) -> list:
    P, S, U = system.sizes
    rng = np.random.default_rng(3)
    p = numbers * (1.0 + 0.1 * rng.random((E, P)))
    x, u = 0.1 * rng.normal(size=(E, S)), 3.0 * rng.normal(size=(E, T, rows, U))
    fixed = rng.normal(size=(E, T, len(system.fixed)))
    return [jnp.array(a) for a in (np.full(SUBSTEPS, 1 / SUBSTEPS), p, x, u, np.full((E, T), 0.02), fixed)]


def compared(system: System, numbers: np.ndarray, *, inputs_move: bool = False, rows: int = 1) -> None:
    P, S, U = system.sizes
    given, rng = arrays(system, numbers, rows), np.random.default_rng(4)
    plain = gpu_program(system.step, system.output, system.sizes, system.fixed)
    y = jax.jit(partial(call_on_gpu, plain, (T, system.outputs), interpret=True))(given)
    np.testing.assert_allclose(y, _outputs(system)(*given), rtol=1e-11, atol=1e-12)
    moving = tuple(range(0, P, 2))
    dp = rng.normal(size=(E, K, len(moving))) * numbers[list(moving)]
    dx, du = rng.normal(size=(E, K, S)), rng.normal(size=(E, T, rows, K, U if inputs_move else 0))
    directions = [jnp.array(a) for a in (dp, dx, du)]
    program = gpu_program(system.step, system.output, system.sizes, system.fixed, moving, inputs_move)
    dy = jax.jit(partial(call_on_gpu, program, (T, system.outputs, K), interpret=True))([*given, *directions])
    expected = np.asarray(_tangents(system, moving, inputs_move)(*given, *directions))
    assert np.abs(expected).max() > 0.0
    np.testing.assert_allclose(dy, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(("inputs_move", "rows"), [pytest.param(False, 1, marks=pytest.mark.slow), (True, SUBSTEPS)])
def test_every_operation(inputs_move, rows):
    with jaxid.float64():
        compared(*of_its_own(), inputs_move=inputs_move, rows=rows)


def test_a_drive_axis_whose_position_is_prescribed():
    with jaxid.float64():
        compared(*of_robot(jaxid.Axis(), (jaxid.Axis().states[0],)))


@pytest.mark.slow
@pytest.mark.parametrize("robot", [jaxid.Omni(), jaxid.Pioneer()])
def test_the_papers_robots(robot):
    with jaxid.float64():
        compared(*of_robot(robot))


@pytest.mark.parametrize("make", [of_its_own, lambda: of_robot(jaxid.Omni()), lambda: of_robot(jaxid.Pioneer())])
def test_all_of_a_kernel_has_instructions(make):
    # Where there is no GPU, as far as its compiler's input.
    with jaxid.float64():
        system, numbers = make()
        P, S, _ = system.sizes
        directions = [jnp.zeros((E, K, P)), jnp.zeros((E, K, S)), jnp.zeros((E, T, 1, K, 0))]
        program = gpu_program(system.step, system.output, system.sizes, system.fixed, tuple(range(P)))
        call = jax.jit(partial(call_on_gpu, program, (T, system.outputs, K)))
        lowered = call.trace([*arrays(system, numbers), *directions]).lower(lowering_platforms=("cuda",))
    assert "triton" in lowered.as_text()

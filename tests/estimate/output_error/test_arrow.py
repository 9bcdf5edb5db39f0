"""Steps of the arrow-shaped problem against the same problem written out as one matrix."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.estimate.output_error.arrow import eliminate, gradient, norms
from jaxid.estimate.output_error.problem import Triangle

pytestmark = pytest.mark.usefixtures("double_precision")
E, N = 4, 3


def _problem(states: int) -> tuple[Triangle, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    local, crossed = np.triu(rng.normal(size=(E, states, states))), rng.normal(size=(E, states, N))
    shared, rl, rs = np.triu(rng.normal(size=(N, N))), rng.normal(size=(E, states)), rng.normal(size=N)
    whole = np.zeros((E * states + N, N + E * states))
    for e in range(E):
        rows = slice(e * states, (e + 1) * states)
        whole[rows, :N] = crossed[e]
        whole[rows, N + e * states : N + (e + 1) * states] = local[e]
    whole[E * states :, :N] = shared
    parts = (shared, crossed, local, rs, rl, np.zeros(1), np.zeros((E, 1)))
    return Triangle(*(jnp.asarray(part) for part in parts)), whole, np.concatenate([rl.ravel(), rs])


@pytest.mark.parametrize("states", [0, 2])
@pytest.mark.parametrize("damping", [1e-6, 0.1, 1e3])
def test_a_damped_step_solves_the_damped_normal_equations(states, damping):
    triangle, whole, residual = _problem(states)
    system = eliminate(triangle, damping)
    z = system.shared_step(jnp.array(damping))
    found = np.concatenate([z, np.ravel(system.own_step(z))])
    expected = -np.linalg.solve(whole.T @ whole + damping * np.eye(whole.shape[1]), whole.T @ residual)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-10)
    slope, lengths = gradient(triangle), norms(triangle)
    np.testing.assert_allclose(np.concatenate([slope.z, np.ravel(slope.states)]), whole.T @ residual, atol=1e-12)
    lengths = np.concatenate([lengths.z, np.ravel(lengths.states)])
    np.testing.assert_allclose(lengths, np.linalg.norm(whole, axis=0), atol=1e-12)

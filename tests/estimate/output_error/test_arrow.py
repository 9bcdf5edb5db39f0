"""Steps of the arrow-shaped problem against the same problem written out as one matrix."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.estimate.output_error.arrow import Arrow, damped_step, gradient, promise

pytestmark = pytest.mark.usefixtures("double_precision")
E, S, N = 4, 2, 3


def _arrow(states: int) -> tuple[Arrow, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    local, crossed = np.triu(rng.normal(size=(E, states, states))), rng.normal(size=(E, states, N))
    shared, rl, rs = np.triu(rng.normal(size=(N, N))), rng.normal(size=(E, states)), rng.normal(size=N)
    whole = np.zeros((E * states + N, N + E * states))
    for e in range(E):
        rows = slice(e * states, (e + 1) * states)
        whole[rows, :N] = crossed[e]
        whole[rows, N + e * states : N + (e + 1) * states] = local[e]
    whole[E * states :, :N] = shared
    return Arrow(*(jnp.asarray(a) for a in (local, crossed, shared, rl, rs))), whole, np.concatenate([rl.ravel(), rs])


@pytest.mark.parametrize("states", [0, S])
@pytest.mark.parametrize("damping", [1e-6, 0.1, 1e3])
def test_a_damped_step_solves_the_damped_normal_equations(states, damping):
    arrow, whole, residual = _arrow(states)
    step = damped_step(arrow, jnp.array(damping))
    expected = -np.linalg.solve(whole.T @ whole + damping * np.eye(whole.shape[1]), whole.T @ residual)
    np.testing.assert_allclose(np.concatenate([step.z, np.ravel(step.states)]), expected, rtol=1e-8, atol=1e-10)
    slope = gradient(arrow)
    np.testing.assert_allclose(np.concatenate([slope.z, np.ravel(slope.states)]), whole.T @ residual, atol=1e-12)


def test_the_promise_is_the_drop_of_the_linear_problem():
    arrow, whole, residual = _arrow(S)
    step = damped_step(arrow, jnp.array(1e-12))
    left = residual + whole @ np.concatenate([step.z, np.ravel(step.states)])
    assert float(promise(arrow, step)) == pytest.approx(0.5 * (residual @ residual - left @ left), rel=1e-6)

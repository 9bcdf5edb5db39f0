"""Places among stamps, held to counting, under every transformation of JAX's and in NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.kernel.in_numpy import steps_of
from jaxid.kernel.places import stamps_before


def _counted(stamps, at):
    return np.array([np.sum(stamps < x) for x in np.ravel(at)]).reshape(np.shape(at))


@pytest.fixture
def case():
    rng = np.random.default_rng(3)
    stamps = np.sort(rng.uniform(0.0, 5.0, (4, 30)), axis=1)
    return stamps, np.concatenate(
        [rng.uniform(-1.0, 6.0, (4, 20)), stamps[:, ::3]], axis=1
    )  # also at the stamps themselves


@pytest.mark.parametrize(
    "axes",
    [(None, 0), (0, None), (0, 0), (None, 1)],
    ids=["many places", "many stamps", "both", "places by columns"],
)
def test_counts_under_batching_as_a_program_and_in_numpy(case, axes):
    stamps, at = case
    one, other = stamps if axes[0] is not None else stamps[0], at if axes[1] is not None else at[0]
    if axes[1] == 1:
        other = at.T
    expected = [
        _counted(stamps[k if axes[0] is not None else 0], at[k if axes[1] is not None else 0]) for k in range(4)
    ]
    function = jax.vmap(stamps_before, axes)
    with jax.enable_x64(True):
        np.testing.assert_array_equal(jax.jit(function)(one, other), expected)
        # Batched once more, with the places of every lane moved.
        twice = jax.vmap(lambda by: function(one, other + by))(jnp.array([0.0, 0.3]))
        np.testing.assert_array_equal(twice[0], expected)
        (found,) = steps_of(jax.make_jaxpr(function)(one, other))(one, other)
    np.testing.assert_array_equal(found, expected)


def test_a_count_has_no_derivative(case):
    stamps, at = case

    def total(by):
        before = stamps_before(stamps[0], at[0] + by)
        return jnp.sum(before * (at[0] + by))

    with jax.enable_x64(True):
        for slope in (jax.grad(total)(0.0), jax.jvp(total, (0.0,), (1.0,))[1]):
            np.testing.assert_allclose(slope, np.sum(_counted(stamps[0], at[0])))

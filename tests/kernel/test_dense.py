"""Decompositions of small matrices, against LAPACK's and against what they must fulfil, under `jit` and `vmap`."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.kernel.dense import orthogonal_columns, solved, triangle_of

pytestmark = pytest.mark.usefixtures("double_precision")


def badly_scaled(*shape, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape) * 10.0 ** rng.uniform(-8, 8, shape[-1])


@pytest.mark.parametrize("shape", [(5, 3), (3, 5), (100, 7), (900, 6), (4, 40, 6), (17, 33, 9), (2, 3, 50, 8)])
def test_the_triangle_is_that_of_lapack(shape):
    A = badly_scaled(*shape)
    R = np.asarray(jax.jit(triangle_of)(A))
    m, n = shape[-2:]
    scale = np.linalg.norm(A, axis=-2)[..., None, :]
    expected = np.linalg.qr(A / scale, mode="r")
    expected = expected * np.sign(np.diagonal(expected, axis1=-2, axis2=-1))[..., None]
    rows = min(m, n)
    np.testing.assert_allclose((R / scale)[..., :rows, :], expected, atol=1e-14)
    np.testing.assert_allclose((R / scale)[..., rows:, :], 0.0, atol=1e-14)
    assert not np.tril(R, -1).any()


@pytest.mark.parametrize("shape", [(6, 6), (9, 4), (3, 31, 31), (19, 8, 8)])
def test_singular_values_and_vectors(shape):
    A = badly_scaled(*shape, seed=1)
    B, right = (np.asarray(x) for x in jax.jit(orthogonal_columns)(A))
    n = shape[-1]
    values = np.sort(np.linalg.norm(B, axis=-1), axis=-1)[..., ::-1]
    largest = values[..., :1]
    np.testing.assert_allclose(values / largest, np.linalg.svd(A)[1] / largest, atol=1e-14)
    np.testing.assert_allclose(right @ right.swapaxes(-1, -2), np.broadcast_to(np.eye(n), right.shape), atol=1e-13)
    np.testing.assert_allclose(B.swapaxes(-1, -2) @ right / largest[..., None], A / largest[..., None], atol=1e-14)
    unit = B / np.linalg.norm(B, axis=-1, keepdims=True)
    np.testing.assert_allclose(unit @ unit.swapaxes(-1, -2), np.broadcast_to(np.eye(n), right.shape), atol=1e-12)


def test_small_singular_values_of_a_graded_triangle_are_exact_to_rounding():
    """LAPACK loses those below 1e-16 of the largest; the product of all is the determinant, known exactly."""
    rng = np.random.default_rng(2)
    R = jnp.triu(rng.normal(size=(7, 7))) * 10.0 ** -np.arange(0, 28, 4)
    B, _ = orthogonal_columns(R)
    product = np.prod(np.linalg.norm(np.asarray(B), axis=1))
    assert product == pytest.approx(abs(np.prod(np.diagonal(R))), rel=1e-12)


@pytest.mark.parametrize("shape", [(1, 1, 1), (5, 2), (9, 8, 3, 3)])
def test_equations_of_a_covariance_matrix_are_solved(shape):
    *ahead, n, k = (*shape, 4) if len(shape) == 2 else shape
    rng = np.random.default_rng(5)
    root = rng.normal(size=(*ahead, n, n)) * 10.0 ** rng.uniform(-4, 4, n)[:, None]
    S, B = root @ root.swapaxes(-1, -2), rng.normal(size=(*ahead, n, k))
    X = np.asarray(jax.jit(jax.vmap(solved) if ahead else solved)(S, B))
    scale = np.sqrt(np.diagonal(S, axis1=-2, axis2=-1))[..., None]
    expected = np.linalg.solve(S / scale / scale.swapaxes(-1, -2), B / scale) / scale
    np.testing.assert_allclose(X * scale, expected * scale, rtol=1e-9)


def test_columns_of_zeros_and_no_rotation_needed():
    A = jnp.array([[3.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(triangle_of(A), [[3.0, 0, 0], [0, 0, 0], [0, 0, 2.0]])
    B, right = orthogonal_columns(A)
    np.testing.assert_array_equal(right, np.eye(3))
    np.testing.assert_array_equal(np.linalg.norm(B, axis=1), [3.0, 0.0, 2.0])


def test_lanes_of_vmap_are_what_each_is_alone():
    A = jnp.asarray(badly_scaled(5, 3, 40, 6, seed=3))
    together = jax.jit(jax.vmap(jax.vmap(triangle_of)))(A)
    for i in range(5):
        for k in range(3):
            np.testing.assert_array_equal(together[i, k], triangle_of(A[i, k]))
    rotated = jax.jit(jax.vmap(orthogonal_columns))(A[:, 0, :6])
    for i in range(5):
        np.testing.assert_allclose(
            jnp.linalg.norm(rotated[0][i], axis=1),
            jnp.linalg.norm(orthogonal_columns(A[i, 0, :6])[0], axis=1),
            rtol=1e-13,
        )


def test_single_precision_takes_jax_s_own():
    A = jnp.asarray(np.random.default_rng(4).normal(size=(9, 4)), jnp.float32)
    R = triangle_of(A)
    assert R.dtype == jnp.float32
    np.testing.assert_allclose(R.T @ R, A.T @ A, rtol=1e-4, atol=1e-4)
    B, right = orthogonal_columns(R)
    np.testing.assert_allclose(B.T @ right, R, atol=1e-5)

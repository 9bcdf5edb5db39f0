"""Functions of records in NumPy, and compiled where they have run long; what was computed of few numbers is kept."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxid._float64 import float64
from jaxid.kernel import in_numpy_or_xla as module
from jaxid.kernel.in_numpy_or_xla import in_numpy_or_xla, in_xla


def summed(power, x):
    return jnp.cumsum(x**power), x


def looped(power, x):
    return (jax.lax.while_loop(lambda c: c[0] < 5, lambda c: (c[0] + 1, c[1] * 0.5), (0, x**power))[1],)


def test_what_ran_long_is_compiled_and_gives_the_same(monkeypatch):
    monkeypatch.setattr(module, "_COMPILED", 1e-6)
    monkeypatch.setattr(module, "_SMALL", 0)
    x = np.random.default_rng(0).normal(size=20_011)
    with float64():
        results = [in_numpy_or_xla(summed, (3,), [x])[0] for _ in range(20)]
    assert in_xla(summed, 1)._outer._cache_size() == 1
    np.testing.assert_allclose(results[0], np.cumsum(x**3), rtol=0, atol=1e-9)
    np.testing.assert_allclose(results[-1], results[0], rtol=0, atol=1e-9)


def test_what_numpy_has_no_operation_for_runs_in_xla():
    with float64():
        (found,) = in_numpy_or_xla(looped, (2,), [np.arange(4.0)])
    np.testing.assert_allclose(found, np.arange(4.0) ** 2 / 32.0, rtol=1e-15)


def test_what_was_kept_is_not_written_to_and_is_not_the_caller_s():
    x = np.arange(5.0)
    with float64():
        first, passed = in_numpy_or_xla(summed, (1,), [x])
        assert not first.flags.writeable and not np.may_share_memory(passed, x)
        assert in_numpy_or_xla(summed, (1,), [x])[0] is first
        x[0] = 7.0
        np.testing.assert_array_equal(passed, np.arange(5.0))
        np.testing.assert_array_equal(in_numpy_or_xla(summed, (1,), [x])[0], np.cumsum(x))

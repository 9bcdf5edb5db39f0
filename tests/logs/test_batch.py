"""jaxid/logs/batch.py."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid._float64 import float64
from jaxid.logs import AXIS, Batch, Log, LogSet


def _set(lengths, prefix="log"):
    random = np.random.default_rng(0)
    logs = []
    for number, samples in enumerate(lengths):
        time = np.cumsum(random.uniform(0.01, 0.03, samples))
        outputs = {"v": random.normal(size=samples), "q": np.where(np.arange(samples) % 3, np.nan, 1.0)}
        logs.append(Log.from_arrays(f"{prefix}{number}", time, random.normal(size=samples), outputs, AXIS))
    return LogSet(logs)


def test_padding_masks_and_intervals():
    before = jax.config.read("jax_enable_x64")
    logs = _set([5, 9])
    batch = logs.batch(multiple=4)
    assert batch.inputs.shape == (2, 12, 1) and batch.outputs.shape == (2, 12, 2) and batch.mask.shape == (2, 12, 2)
    assert batch.dt.dtype == batch.inputs.dtype == batch.outputs.dtype == np.float64
    np.testing.assert_array_equal(batch.length, [5, 9])
    for row, log in enumerate(logs):
        n = len(log)
        np.testing.assert_array_equal(batch.dt[row, : n - 1], np.diff(log.time))
        assert np.all(np.asarray(batch.dt[row, n - 1 :]) == log.sampling_interval)
        np.testing.assert_array_equal(batch.inputs[row, :n], log.inputs)
        np.testing.assert_array_equal(batch.mask[row, :n], np.isfinite(log.outputs))
        assert not np.asarray(batch.mask[row, n:]).any() and not np.asarray(batch.inputs[row, n:]).any()
        np.testing.assert_array_equal(batch.outputs[row, :n], np.nan_to_num(log.outputs))
    assert jax.config.read("jax_enable_x64") == before  # the caller's setting is left alone


def test_an_exact_multiple_is_not_padded_and_bad_multiples_are_refused():
    assert _set([8]).batch(multiple=4).dt.shape == (1, 8)
    with pytest.raises(ValueError, match="multiple of 0"):
        _set([8]).batch(multiple=0)
    with pytest.raises(ValueError, match="at least one"):
        Batch.from_logs([])


def test_sets_of_similar_length_share_one_program():
    traces = []

    @eqx.filter_jit
    def total(batch):
        traces.append(batch.dt.shape)
        return jnp.sum(jnp.where(batch.mask, batch.outputs, 0))

    for lengths, prefix in (([600, 30], "a"), ([700, 768], "b")):
        logs = _set(lengths, prefix)
        expected = sum(np.nansum(log.outputs) for log in logs)
        with float64():
            np.testing.assert_allclose(total(logs.batch().without_names()), expected, rtol=1e-12)
    assert traces == [(2, 768)]


@pytest.mark.parametrize(("longest", "padded"), [(20, 24), (64, 64), (100, 128), (256, 256), (257, 512)])
def test_short_logs_are_not_padding_for_the_most_part(longest, padded):
    assert _set([longest, 10]).batch().dt.shape == (2, padded)

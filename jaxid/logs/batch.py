"""A batch: a set of logs as padded float64 JAX arrays, one row an experiment, ready for compiled code."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._arrays import array
from .._float64 import float64
from .channels import Channels
from .log import Log
from .readings import counting

_MULTIPLES = ((64, 8), (256, 64))
"""Samples of the longest log up to which a batch is padded to multiples of so many, instead of 256: thousands of windows, and
pieces of half a second, would be padding for the most part."""


class Batch(eqx.Module):
    """E experiments of T samples (T is the longest log's length, rounded up).

    **Fields:**

    - `dt`: s, the interval that starts at sample k; for a log's last sample, and for padding, the log's median.
    - `inputs`: applied from sample k to k + 1; 0 in padding.
    - `outputs`: measured at sample k (outputs, then optional outputs); 0 where `mask` is False.
    - `mask`: True where there is a measurement that counts (`readings`): not NaN, not padding, no counter's reading again.
    - `length`: number of real samples of each experiment.
    - `names`, `channels`: static. JAX compiles anew for other static values: hand `batch.without_names()` to compiled
      functions that should be shared by different sets.
    """

    dt: Float[Array, "E T"]
    inputs: Float[Array, "E T nu"]
    outputs: Float[Array, "E T ny"]
    mask: Bool[Array, "E T ny"]
    length: Int[Array, " E"]
    names: tuple[str, ...] = eqx.field(static=True)
    channels: Channels = eqx.field(static=True)

    @classmethod
    @float64()
    def from_logs(cls, logs: Sequence[Log], multiple: int | None = None) -> "Batch":
        """Pad the logs to one length, rounded up to a `multiple` of samples so that sets of similar length share
        compiled programs: by default 256; 64 where the longest log has no more than 256, and 8 where it has no more than 64.
        Nothing is truncated. Raises `ValueError` for a multiple below 1 or no logs.
        """
        if multiple is not None and multiple < 1:
            raise ValueError(f"A batch cannot be padded to a multiple of {multiple} samples; give 1 or more.")
        if not len(logs):
            raise ValueError("A batch needs at least one log; give some.")
        channels = logs[0].channels
        longest = max(len(log) for log in logs)
        multiple = multiple or next((few for samples, few in _MULTIPLES if longest <= samples), 256)
        padded = -(-longest // multiple) * multiple
        shape = len(logs), padded
        dt = np.zeros(shape)
        inputs = np.zeros((*shape, len(channels.inputs)))
        outputs = np.zeros((*shape, len(channels.measured)))
        mask = np.zeros(outputs.shape, dtype=bool)
        for row, log in enumerate(logs):
            n = len(log)
            dt[row] = log.sampling_interval
            dt[row, : n - 1] = np.diff(log.time)
            inputs[row, :n] = log.inputs
            mask[row, :n] = counting(log)
            outputs[row, :n] = np.where(mask[row, :n], log.outputs, 0.0)
        return cls(
            dt=array(dt),
            inputs=array(inputs),
            outputs=array(outputs),
            mask=array(mask),
            length=array(np.array([len(log) for log in logs], dtype=np.int32)),
            names=tuple(log.name for log in logs),
            channels=channels,
        )

    def without_names(self) -> "Batch":
        """The same arrays with `names = ()`, so that batches of equal shape share one compiled program."""
        return replace(self, names=())

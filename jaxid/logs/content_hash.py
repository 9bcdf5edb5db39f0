"""A log's content as one hash, so that a result can say which logs it was computed from."""

import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .log import Log


def content_hash(log: "Log") -> str:
    """SHA-256 of a log's channels, time, inputs, outputs and further columns of numbers, whatever the log is called and in
    whichever format it was stored."""
    digest = hashlib.sha256(repr((log.channels.inputs, log.channels.measured, log.cut)).encode())
    for part in (log.time, log.inputs, log.outputs):
        digest.update(_bytes(part))
    further = log.extra.select_dtypes("number")
    for name in sorted(further.columns, key=str):
        digest.update(str(name).encode())
        digest.update(_bytes(further[name].to_numpy(float)))
    return digest.hexdigest()


def _bytes(values: np.ndarray) -> bytes:
    # Every NaN is the same NaN, and minus zero is zero.
    return np.where(np.isnan(values), np.nan, values + 0.0).astype("<f8").tobytes()

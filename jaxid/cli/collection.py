"""How often a command looks for unreachable objects: hardly, since it ends soon."""

import atexit
import gc

_THRESHOLDS = 100_000, 20, 100
"""Of Python's three generations (`gc.set_threshold`)."""


def collect_seldom() -> None:
    """Let this process look for unreachable objects rarely: what traces and modules hold is alive until it ends, when going
    through all of it once more takes a second."""
    gc.freeze()
    gc.set_threshold(*_THRESHOLDS)
    atexit.register(gc.freeze)

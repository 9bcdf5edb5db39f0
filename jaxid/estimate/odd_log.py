"""The one log of several that holds nearly all of what a fit leaves."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .confidence.agreement import rms

_ODD, _SEVERAL = 2.0, 3
"""Times what the next worst log leaves that an odd one does, of so many logs at least."""


def odd_log(
    names: Sequence[str],
    errors: Sequence[Mapping[str, NDArray[np.float64]]],
    noise: Mapping[str, float],
    least: float,
) -> str:
    """A sentence on the odd one of the logs `names`, whose `errors` by channel are at `least` so many times the `noise`; empty
    where none is."""
    if len(errors) < _SEVERAL or not all(errors):
        return ""
    each = [rms(np.concatenate([own[c] / noise[c] for c in own])) for own in errors]
    *_, second, most = ranked = sorted(each)
    if most < max(_ODD * second, least):
        return ""
    return (
        f"Most of it is on the log {names[int(np.argmax(each))]}: {most:.3g} times the noise, on the others {ranked[0]:.3g} to "
        f"{second:.3g}. It may not have been recorded as they were (another load, a swapped or flipped column, a shifted "
        "clock); `repeatability` compares them."
    )

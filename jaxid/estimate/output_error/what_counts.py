"""A problem in lanes without the outputs that nobody measured and without what lies behind the last measurement: these need
not be simulated, differentiated or weighed."""

from functools import lru_cache

import numpy as np

from ...kernel.call import System
from ...robots.effect import Scalars
from .laid_out import Direct, Logs

_MOST_SYSTEMS = 256


@lru_cache(_MOST_SYSTEMS)
def _showing(system: System, outputs: tuple[int, ...]) -> System:
    """The same with some of its outputs."""

    def shown(p: Scalars, x: Scalars, u: Scalars):
        every = system.output(p, x, u)
        return tuple(every[i] for i in outputs)

    return system.showing(shown, len(outputs), f"outputs {outputs}")


def of_what_counts(d: Direct) -> tuple[Direct, list[int]]:
    """The problem without outputs that weigh nothing in any log, such as currents that nobody measured, and without samples
    that come after all that weighs, and the places of the outputs that stay. With effects on sensors all outputs stay, with
    effects on whole records all samples."""
    counts, records = d.logs.weight > 0.0, d.model.records
    long = np.flatnonzero(counts.any(axis=(0, 2, 3)))
    if len(long) and records.commands is None and records.measures is None and long[-1] + 1 < d.logs.dt.shape[1]:
        d = d._replace(logs=Logs(*(np.ascontiguousarray(x[:, : long[-1] + 1]) for x in d.logs)))
    there = np.flatnonzero(counts.any(axis=(0, 1, 3))).tolist()
    if not there or len(there) == d.model.system.outputs or records.measures is not None:
        return d, list(range(d.model.system.outputs))
    logs = d.logs._replace(
        measured=np.ascontiguousarray(d.logs.measured[:, :, there]),
        weight=np.ascontiguousarray(d.logs.weight[:, :, there]),
    )
    model = d.model._replace(system=_showing(d.model.system, tuple(there)))
    return d._replace(model=model, logs=logs), there

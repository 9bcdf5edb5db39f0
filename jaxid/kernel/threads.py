"""Groups of lanes on several threads: machine code holds no lock of Python's, and groups know nothing of one another.

One pool a process, of as many threads as it may use processors, or as `OMP_NUM_THREADS` says, which processes of a cluster
set to one.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

_LEAST = 20_000
"""Group x sub-steps that a thread gets at least: some milliseconds, beside which handing them over costs nothing."""


@cache
def threads() -> int:
    """Threads on which machine code runs."""
    asked = os.environ.get("OMP_NUM_THREADS", "").split(",")[0]
    try:
        there = len(os.sched_getaffinity(0))
    except AttributeError:  # not on this system
        there = os.cpu_count() or 1
    return max(1, min(int(asked), there)) if asked.isdecimal() else there


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads(), thread_name_prefix="jaxid")


os.register_at_fork(after_in_child=_pool.cache_clear)  # threads do not live on in a forked process


def over_groups(run: Callable[[slice], None], groups: int, substeps: int, directions: int = 0) -> None:
    """`run` some of the groups at a time until all have been, in parallel where there is enough of so many `substeps` each,
    which cost the more the more `directions` go with them."""
    work = groups * substeps * (1 + directions)
    parts = min(groups, threads(), work // _LEAST)
    if parts < 2:
        return run(slice(0, groups))
    ends = [groups * part // parts for part in range(parts + 1)]
    others = [_pool().submit(run, slice(*pair)) for pair in zip(ends[1:], ends[2:], strict=False)]
    try:
        run(slice(0, ends[1]))
    finally:
        for other in others:
            other.result()

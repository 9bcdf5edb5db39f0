"""Work on many things shared out by Dask: to processes of this machine, or to the workers of a scheduler anywhere.

Things go out in parts, a few parts more than there are workers at a time, so that the scheduler never holds them all. Where
a worker dies, Dask gives its part to another one. A part on which one worker after another dies is taken apart, and a thing on
which they die is tried once more when nothing else is under way, since a worker takes down all that waits for it: only what
kills them by itself is lost, and said to be.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from distributed import Client

_NEEDED = "a fleet on several processes needs Dask; install it with: pip install jaxid-robots[fleet]"
_ONE_THREAD = dict.fromkeys(("PJRT_NPROC", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""What makes a process one thread: jaxid's work is long loops of small operations."""
_AHEAD = 2
"""Parts on their way for each thread of the workers."""
_SETTINGS = {"distributed.admin.large-graph-warning-threshold": "1 GiB"}  # logs are the graph


@dataclass(frozen=True)
class Lost:
    """What stands in the place of a result: `why` there is none."""

    why: str


@contextmanager
def on_this_machine(workers: int | None = None) -> Iterator["Client"]:
    """A client of as many processes (by default one for every core), of one thread each, for as long as the block lasts.

    The processes import the program that calls this: it has to be below `if __name__ == "__main__":`. Raises `ImportError`
    without Dask.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise ImportError(_NEEDED) from None
    count = workers or len(os.sched_getaffinity(0))
    settings: Any = {"dashboard_address": None, "env": _ONE_THREAD, "silence_logs": 50}
    cluster = LocalCluster(n_workers=count, threads_per_worker=1, processes=True, **settings)
    with cluster, Client(cluster) as client:
        yield client


@contextmanager
def of_scheduler(address: str) -> Iterator["Client"]:
    """A client of the scheduler at `address`. Raises `OSError` if there is none, and `ImportError` without Dask."""
    try:
        from distributed import Client
    except ImportError:
        raise ImportError(_NEEDED) from None
    with Client(address, timeout="10s") as client:
        yield client


def worked_off(
    client: "Client", work: Callable[[Sequence[Any]], list[Any]], parts: Mapping[str, Sequence[Any]]
) -> Iterator[tuple[str, list[Any]]]:
    """The name of each part and `work(part)`, one result for each of its things, as they are done; each exactly once.

    Of things on which workers die the result is `Lost`. What `work` raises is raised here. Parts must not be empty.
    """
    from dask.config import set as setting
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    waiting = iter(parts.items())
    apart: dict[str, list[Any]] = {}
    where: dict[str, tuple[str, int | None, bool]] = {}
    suspects: list[tuple[str, int | None]] = []

    def sent(name: str, place: int | None = None, alone: bool = False) -> Any:
        things = parts[name] if place is None else parts[name][place : place + 1]
        key = f"jaxid-{name}-{place}" + "-alone" * alone
        where[key] = name, place, alone
        with setting(_SETTINGS):
            return client.submit(work, things, key=key, pure=False)

    counts: Any = client.nthreads()
    threads = sum(counts.values())
    going = as_completed([sent(name) for name, _ in islice(waiting, max(_AHEAD * threads, 4))])
    for future in going:
        name, place, alone = where.pop(future.key)
        died = future.status == "error" and isinstance(future.exception(), KilledWorker)
        found = [Lost("the processes that worked on it died, one after another")] if died else future.result()
        future.release()
        done = False
        if died and place is None and len(parts[name]) > 1:
            apart[name] = [None] * len(parts[name])
            for one in range(len(parts[name])):
                going.add(sent(name, one))
        elif died and not alone:
            suspects.append((name, place))
            for following, _ in islice(waiting, 1):
                going.add(sent(following))
        elif place is not None:
            apart[name][place] = found[0]
            done = all(result is not None for result in apart[name])
        else:
            done = True
        if suspects and not going.count():
            going.add(sent(*suspects.pop(0), alone=True))
        if not done:
            continue
        found = found if place is None else apart.pop(name)
        yield name, found
        for following, _ in islice(waiting, 1):
            going.add(sent(following))

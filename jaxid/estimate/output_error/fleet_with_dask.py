"""A fleet fitted by several processes, on this machine or on many: `fit_fleet` for a part of the members in each."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from ..._dask import Lost, on_this_machine, worked_off
from ..._float64 import in_float64
from ..._origin import with_origin
from ...logs import LogSet
from ...robots.robot import Robot
from ..result import Fit
from .fleet import Fleet, check_fleet, fit_fleet, of_member
from .setup import Starts

if TYPE_CHECKING:
    from distributed import Client

PART = 32
"""Members in a part: little is lost with a worker, and their logs fill the lanes of machine code."""


class _Member(NamedTuple):
    """What a fit needs."""

    name: str
    robot: Robot
    logs: LogSet
    start: Starts


def _fitted(members: Sequence[_Member], options: Mapping[str, Any]) -> list[Fit | str]:
    """In a worker: each member's fit, or why there is none."""
    fleet = fit_fleet(
        {one.name: one.robot for one in members},
        {one.name: one.logs for one in members},
        start={one.name: one.start for one in members},
        **options,
    )
    return [fleet.fits[one.name] if one.name in fleet.fits else fleet.failed[one.name] for one in members]


@with_origin
@in_float64
def fit_fleet_with_dask(
    robot: Robot | Mapping[str, Robot],
    fleet: Mapping[str, LogSet],
    client: "Client | None" = None,
    *,
    start: Starts | Mapping[str, Starts] = None,
    report: Callable[[str], None] = lambda message: None,
    **options: Any,
) -> Fleet:
    """`fit_fleet`, its members shared out to the workers of a Dask `client`, `PART` at a time: the same fits.

    Without a client, processes of this machine, one for every core, work on it while the call lasts; a program that calls
    it so does that below `if __name__ == "__main__":`. Workers need jaxid and the modules that a user's robot comes from, and
    should have one thread. A part whose worker dies is done again by another one; a member on which workers die again and
    again is in `Fleet.failed`. `report` is told how many members are done.

    Errors are those of `fit_fleet`, and `ImportError` without Dask.
    """
    check_fleet(robot, fleet, start)
    members = [_Member(n, of_member(n, robot, fleet), logs, of_member(n, start, fleet)) for n, logs in fleet.items()]
    parts = {str(begin): members[begin : begin + PART] for begin in range(0, len(members), PART)}
    fits: dict[str, Fit] = {}
    failed: dict[str, str] = {}
    with nullcontext(client) if client is not None else on_this_machine() as worker_client:
        for part, results in worked_off(worker_client, partial(_fitted, options=options), parts):
            for one, result in zip(parts[part], results, strict=True):
                if isinstance(result, Fit):
                    fits[one.name] = result
                else:
                    failed[one.name] = result.why if isinstance(result, Lost) else result
            report(f"{len(fits) + len(failed)} of {len(members)} members done")
    return Fleet({n: fits[n] for n in fleet if n in fits}, {n: failed[n] for n in fleet if n in failed})

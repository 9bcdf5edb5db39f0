"""`jaxid fleet`: a folder of robots, each fitted (and explained) on its own logs; tables for programs, a summary for people.

The members are worked on in parts, here or by the workers of Dask. A part's results are a file as soon as there are any, so
that a run that ends before its time goes on where it was, and memory stays bounded.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from .._dask import Lost, of_scheduler, on_this_machine, worked_off
from ..estimate.output_error.far_members import far_estimates
from ..logs.files import LOG_ENDINGS, logs_in
from ..report.document import write_page
from ..report.fleet_files import MEMBERS, Row, member_row, read_parts, with_distances, write_part, write_tables
from ..report.tables import to_text
from ..robots import Robot
from .arguments import UnusableInput
from .cache import keep_compiled_programs
from .console import say, show, step
from .fleet_page import Columns, fleet_page, identified, members_table, sentences, spread_table
from .fleet_work import Member, Work, fingerprint, parts_of, robot_of, worked
from .folder import results_in

PART = 32
"""Members in a part: little is lost with it, and their logs fill the lanes of machine code."""


def members_of(folder: Path) -> dict[str, list[Path]]:
    """Logs by member: a member is a folder with logs, or, where there are none, a log. Raises `UnusableInput`."""
    if not folder.is_dir():
        raise UnusableInput(f"{folder} is no folder; give one with a folder of logs for every robot.")
    own = logs_in(folder)
    folders = {p.name: logs_in(p) for p in sorted(folder.iterdir()) if p.is_dir() and p not in own and p.name[0] != "."}
    found = {name: logs for name, logs in folders.items() if logs}
    if found and own:
        raise UnusableInput(
            f"{folder} has folders with logs and logs of its own, such as {own[0].name}; put each robot's into a folder."
        )
    if not (found or own):
        raise UnusableInput(
            f"{folder} holds no logs ({', '.join(LOG_ENDINGS)}, ROS 2 bags as folders), nor does any folder in it; check the "
            "path."
        )
    if found and (without := [name for name in folders if name not in found]):
        listed = ", ".join(without[:5]) + (f" and {len(without) - 5} more" if len(without) > 5 else "")
        say(f"warning: {folder}: left out, since there is no log in it: {listed}.", style="yellow")
    return found or _by_name(own)


def _by_name(logs: Sequence[Path]) -> dict[str, list[Path]]:
    """A member for every log, called like it without its ending where that tells them apart."""
    short = [path.name if path.is_dir() else path.stem for path in logs]
    return {path.name if short.count(name) > 1 else name: [path] for name, path in zip(short, logs, strict=True)}


def _here(work: Work, parts: Mapping[str, Sequence[Member]]) -> Iterator[tuple[str, list[Row]]]:
    """The parts' rows, by this process."""
    for number, (name, part) in enumerate(parts.items(), start=1):
        with step(f"Part {number} of {len(parts)}, {len(part)} members") as report:
            rows = worked(part, work, report)
        yield name, rows


def _by_workers(
    work: Work, parts: Mapping[str, Sequence[Member]], workers: int | None, scheduler: str | None
) -> Iterator[tuple[str, list[Row]]]:
    """The parts' rows, by Dask's workers. Raises `UnusableInput` without Dask, and for a scheduler that is not there."""
    with ExitStack() as open_:
        try:
            client = open_.enter_context(of_scheduler(scheduler) if scheduler else on_this_machine(workers))
        except ImportError as error:
            raise UnusableInput(str(error)) from None
        except (OSError, ValueError) as error:
            raise UnusableInput(f"There is no scheduler at {scheduler} ({error}); check the address.") from None
        with step("Members") as report:
            done = 0
            for name, found in worked_off(client, partial(worked, work=work), parts):
                rows = [
                    member_row(member, None, None, row.why, unexplained=row.why if work.held_out else "")
                    if isinstance(row, Lost)
                    else row
                    for (member, _), row in zip(parts[name], found, strict=True)
                ]
                yield name, rows
                done += len(rows)
                report(f"{done} of {sum(map(len, parts.values()))} members done")


def run_fleet(
    spec: str,
    folder: Path,
    model: Path | None,
    mapping: Path | None,
    out: Path,
    options: Mapping[str, Any],
    held_out: Sequence[str] = (),
    workers: int | None = None,
    scheduler: str | None = None,
    overwrite: bool = False,
) -> None:
    """Write a file for each part of the members to `out`/parts, then estimates.parquet and members.parquet, with `held_out`
    logs explanations.parquet and effects.parquet, and report.html, and print a summary.

    Parts that are there already, of the same logs, model, options and code, are not worked on again. A member whose logs
    cannot be read or fitted is named and does not touch the others. Raises `UnusableInput` where no member could be fitted.
    """
    keep_compiled_programs()
    files = members_of(folder)
    first = tuple(str(path.resolve()) for path in next(iter(files.values())))
    model, mapping = (path.resolve() if path is not None else None for path in (model, mapping))
    work = Work(spec, model, mapping, tuple(options.items()), str(Path.cwd()), first, tuple(held_out))
    robot = robot_of(work)
    say(f"{len(files)} members")
    with results_in(out, "fleet", robot.name, overwrite):
        members = _worked_off(robot, files, work, out, workers, scheduler)
    if all(members["failure"]):
        raise UnusableInput(f"No member could be fitted; the first: {members['failure'][0]}")


def _worked_off(
    robot: Robot, files: Mapping[str, Sequence[Path]], work: Work, out: Path, workers: int | None, scheduler: str | None
) -> Columns:
    """Work on what is not done yet, and write tables and page; returns the table of the members."""
    place = out / "parts"
    place.mkdir(exist_ok=True)
    files = {name: [path.resolve() for path in paths] for name, paths in files.items()}
    parts = parts_of(files, fingerprint(work, robot), PART)
    paths = {name: place / f"{name}.parquet" for name in parts}
    left = {name: part for name, part in parts.items() if not paths[name].is_file()}
    if len(left) < len(parts):
        done = sum(len(part) for name, part in parts.items() if name not in left)
        say(f"{done} members are done already: their logs, the model, the options and the code are what they were")
    if left:
        rows = _by_workers(work, left, workers, scheduler) if workers or scheduler else _here(work, left)
        for name, found in rows:
            write_part(paths[name], found)
    for path in set(place.glob("*.parquet")) - set(paths.values()):
        path.unlink()  # of other logs, or otherwise made
    tables = read_parts(paths.values())
    members, estimates = tables["members"], tables["estimates"]
    far = far_estimates(identified(members, estimates))
    written = {
        "estimates.parquet": with_distances(estimates, far),
        "members.parquet": {name: members[name] for name in MEMBERS},
        **{f"{name}.parquet": tables[name] for name in ("explanations", "effects") if name in tables},
    }
    write_tables(out, written)
    said, spread = sentences(tables, far), spread_table(members, estimates, far)
    show(to_text([spread], said))
    every = members_table(members, estimates, far, tables.get("explanations"))
    write_page(out / "report.html", fleet_page(robot, said, [spread, every], "explanations" in tables))
    say(f"{out}: {', '.join([*written, 'report.html'])}")
    return members

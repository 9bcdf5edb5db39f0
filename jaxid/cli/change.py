"""`jaxid change`: fit two sets of logs of one robot, and say what changed between them."""

from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from ..explanation.changes.explain_change import explain_change
from ..explanation.explain import without_windows
from ..logs import LogSet, read_logs
from ..logs.intersample import Intersample, between_samples
from ..robots import Robot
from .arguments import UnusableInput, load_effects
from .cache import keep_compiled_programs
from .console import say, show, step
from .findings import refuse_useless, warn_of_findings, warn_of_unused
from .fit import estimate, identifiable
from .folder import results_in


def _read(robot: Robot, paths: list[str], mapping: Path | None, intersample: Intersample) -> LogSet:
    """The logs of one set, looked over. Raises `UnusableInput` if none can be fitted."""
    logs = between_samples(read_logs(paths, robot, mapping=mapping), intersample)
    refuse_useless(logs)
    return logs


def run_change(
    spec: str,
    before: list[str],
    after: list[str],
    held_out_before: list[str],
    held_out_after: list[str],
    model: Path | None,
    mapping: Path | None,
    out: Path | None,
    options: Mapping[str, Any],
    intersample: Intersample,
    false_alarm: float,
    own_effects: str | None = None,
    overwrite: bool = False,
) -> None:
    """Print what changed, and write change.json and report.html to `out` where one is given."""
    keep_compiled_programs()
    if bool(held_out_before) != bool(held_out_after):
        raise UnusableInput(
            "Held-out logs are given of one set only; give --held-out-before and --held-out-after, or neither."
        )
    robot = identifiable(spec, model, before, mapping, load_effects(own_effects))
    with nullcontext() if out is None else results_in(out, "change", robot.name, overwrite):
        sets = [_read(robot, paths, mapping, intersample) for paths in (before, after)]
        held_out = [
            _read(robot, paths, mapping, intersample) if paths else None for paths in (held_out_before, held_out_after)
        ]
        say(f"{len(sets[0])} logs before, {len(sets[1])} after")
        for logs, own in zip(sets, held_out, strict=True):
            warn_of_findings(logs, own)
        warn_of_unused(robot, *sets, *held_out)
        fits = []
        for logs in sets:
            fits.append(without_windows(estimate(robot, logs, options)[-1], logs, say, **options))
        with step("What changed") as report:
            found = explain_change(*fits, *sets, *held_out, false_alarm=false_alarm, report=report)
        show(str(found))
        if out is not None:
            from ..report.change_page import change_page  # and matplotlib with it
            from ..report.document import write_page

            found.save(out)
            write_page(out / "report.html", change_page(found))
    if out is not None:
        say(f"{out}: change.json, report.html")

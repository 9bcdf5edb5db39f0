"""Parts of a fleet: what is done for each, in this process or in a worker, and how one that has been done is known again."""

import hashlib
import sys
import sysconfig
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatch
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from ..estimate.linear.integral_least_squares import linear_estimate
from ..estimate.output_error.fleet import fit_fleet
from ..estimate.result import Fit
from ..estimate.units_doubted import with_units_doubted
from ..explanation.explain import explain
from ..explanation.explanation import Explanation
from ..explanation.fleet import unforeseen
from ..logs import LogError, LogSet, LogWarning, read_logs
from ..logs.finding import Finding
from ..parameters import ParameterError
from ..report.fleet_files import Row, member_row
from ..robots import Robot
from .arguments import UnusableInput
from .cache import keep_compiled_programs
from .findings import in_short, refuse_useless
from .fit import identifiable

_SHOWN = 10
Member = tuple[str, tuple[Path, ...]]
"""Its name and its logs."""
Report = Callable[[str], None]


class Work(NamedTuple):
    """What is done with every member, as the command line says it: what a worker needs to know beside the logs.

    `place`: the folder that a robot of the user's is imported from; `first`: the logs whose columns say what the robot
    measures; `held_out`: patterns of the names of logs that are not fitted, for members that are to be explained.
    """

    spec: str
    model: Path | None
    mapping: Path | None
    options: tuple[tuple[str, Any], ...]
    place: str
    first: tuple[str, ...]
    held_out: tuple[str, ...] = ()


def robot_of(work: Work) -> Robot:
    """The robot of the command line."""
    if work.place not in sys.path:
        sys.path.insert(0, work.place)
    return identifiable(work.spec, work.model, work.first, work.mapping)


_robot = lru_cache(1)(robot_of)


def worked(members: Sequence[Member], work: Work, report: Report | None = None) -> list[Row]:
    """A row for each of the members; those that cannot be read, fitted or explained say why."""
    keep_compiled_programs()
    robot, told = _robot(work), report or (lambda message: None)
    logs: dict[str, LogSet] = {}
    held_out: dict[str, LogSet | None] = {}
    left_out: dict[str, list[str]] = {}
    failed: dict[str, str] = {}
    for name, paths in members:
        try:
            logs[name], held_out[name], left_out[name] = _read(robot, paths, work)
        except (LogError, UnusableInput) as error:
            failed[name] = str(error)
    fits: dict[str, Fit] = {}
    if logs:
        starts = {name: _started(robot, own) for name, own in logs.items()}
        if any(start is not None for start in starts.values()):
            told("linear estimates are there, from which output error starts")
        # What every member goes through is told of a few; of thousands nobody could read it.
        of_each = told if len(logs) <= _SHOWN else lambda message: None
        fleet = fit_fleet(robot, logs, start=starts, report=of_each, **dict(work.options))
        fits, failed = fleet.fits, failed | fleet.failed
    rows = []
    for name, _ in members:
        fit, own = fits.get(name), logs.get(name)
        if fit is None or own is None:
            why = failed.get(name, "")
            rows.append(member_row(name, own, None, why, unexplained=why if work.held_out else ""))
            continue
        found, unexplained, apart = None, "", held_out[name]
        if apart is not None:
            told(f"{name}: explanation")
            found, unexplained = _explained(fit, own, apart, work)
        elif work.held_out:
            unexplained = left_out[name][-1]  # why no held-out log is left
        # What was found to be missing biases every number of the model without it.
        fit = found.final if found is not None else fit
        fit = with_units_doubted(fit, own)
        why = why_doubted(fit, [*left_out[name], *in_short(findings(own, apart))])
        fit = with_findings(fit, own, apart, left_out[name])
        rows.append(member_row(name, own, fit, why=why, explanation=found, unexplained=unexplained))
    return rows


def _read(robot: Robot, paths: Sequence[Path], work: Work) -> tuple[LogSet, LogSet | None, list[str]]:
    """A member's logs to fit, the held-out ones (None where nothing is to be explained, or none can be used), and what is to be
    said of those that cannot be used: they are left out. Raises `LogError` or `UnusableInput` where none is left."""
    apart = [path for path in paths if any(fnmatch(path.name, pattern) for pattern in work.held_out)]
    fit = [path for path in paths if path not in apart]
    if work.held_out and not (apart and fit):
        what = "held out" if fit else "to fit"
        raise UnusableInput(
            f"{paths[0].parent} has no log {what} (--held-out {' '.join(work.held_out)}); give it some, or other patterns."
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)  # they stand in the members' notes
        logs, left_out = _usable(robot, fit, work)
        refuse_useless(logs)
        if not apart:
            return logs, None, left_out
        try:
            held_out, more = _usable(robot, apart, work)
        except LogError as error:
            return logs, None, [*left_out, f"No held-out log can be used: {error}"]
        return logs, held_out, [*left_out, *more]


def _usable(robot: Robot, paths: Sequence[Path], work: Work) -> tuple[LogSet, list[str]]:
    """The logs that can be read, and what is wrong with the others. Raises `LogError` where there is none."""
    try:
        return read_logs(paths, robot, mapping=work.mapping), []
    except LogError:
        wrong: dict[Path, LogError] = {}
        for path in paths:
            try:
                read_logs([path], robot, mapping=work.mapping)
            except LogError as error:
                wrong[path] = error
        usable = [path for path in paths if path not in wrong]
        if not (wrong and usable):
            raise
        return read_logs(usable, robot, mapping=work.mapping), [
            f"warning: left out: {error}" for error in wrong.values()
        ]


def _started(robot: Robot, logs: LogSet) -> Fit | None:
    """The linear estimate, from which output error starts; None where there is none."""
    try:
        return linear_estimate(robot, logs)[0]
    except (ParameterError, LogError):
        return None


def _explained(fit: Fit, logs: LogSet, held_out: LogSet, work: Work) -> tuple[Explanation | None, str]:
    """A member's explanation, or why there is none."""
    options = {name: value for name, value in work.options if name in ("loss", "covariance", "windows")}
    try:
        return explain(fit, logs, held_out, **options), ""
    except (ParameterError, LogError) as error:
        return None, str(error)
    except Exception as error:  # noqa: BLE001  one member's must not cost the others theirs
        return None, unforeseen(error)


def findings(*sets: LogSet | None) -> Iterator[Finding]:
    """What pre-flight finds wrong with logs, or doubts."""
    every = (finding for own in sets if own is not None for finding in own.preflight())
    return (finding for finding in every if finding.severity in ("error", "warning"))


def with_findings(fit: Fit, logs: LogSet, held_out: LogSet | None, left_out: Sequence[str]) -> Fit:
    """The fit with what was left out and what pre-flight says of its logs, held-out ones too, among its notes, such as a
    wrong sign."""
    found = [*left_out, *map(str, findings(logs, held_out))]
    return replace(fit, notes=(*fit.notes, *dict.fromkeys(found)))


def why_doubted(fit: Fit, remarks: Sequence[str]) -> str:
    """Why a fit is doubted: what is said of its logs, which may be the reason, then its judgement, and what else it notes, such
    as a remedy."""
    judged = [fit.judgement.sentence] if fit.judgement is not None else []
    said = [*remarks, *judged, *(() if fit.trustworthy else fit.notes)]
    return " ".join(dict.fromkeys(said))


def _sources() -> Iterator[Path]:
    """Files of the modules that are loaded and belong neither to Python nor to an installed package: jaxid's own, and those
    that a user's robot is made of."""
    own = Path(__file__).parents[1]
    yield from sorted(own.rglob("*.py"))
    others = [Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib", "purelib", "platlib")]
    files = {getattr(module, "__file__", None) for module in list(sys.modules.values())}
    for path in sorted(Path(file).resolve() for file in files if file):
        inside = any(path.is_relative_to(folder) for folder in (own, *others))
        if path.suffix == ".py" and path.is_file() and not inside:
            yield path


def fingerprint(work: Work, robot: Robot) -> bytes:
    """What, beside its logs, a member's result follows from: the code of jaxid and of a user's robot, its parameters, the
    model and the mapping, the options and the libraries."""
    digest = hashlib.sha256()
    versions = jax.__version__, np.__version__, sys.version
    numbers = {name: repr(robot.parameters[name]) for name in robot.parameters}
    _add(digest, repr((work.spec, robot.channels, work.options, work.held_out, versions, numbers)).encode())
    for path in (*filter(None, (work.model, work.mapping)), *_sources()):
        _add(digest, path.read_bytes())
    return digest.digest()


def _add(digest: Any, content: bytes) -> None:
    """Content with its length, so that no two lists of contents look alike."""
    digest.update(len(content).to_bytes(8, "big") + content)


def part_name(common: bytes, members: Sequence[Member]) -> str:
    """The name under which a part's results are kept: another one as soon as a byte of a log, or of what is `common` to
    all, is another. Raises `OSError`."""
    digest = hashlib.sha256(common)
    for name, paths in members:
        _add(digest, name.encode())
        for path in paths:
            for file in sorted(path.iterdir()) if path.is_dir() else [path]:
                _add(digest, file.name.encode())
                _add(digest, file.read_bytes())
    return digest.hexdigest()[:32]


def parts_of(files: Mapping[str, Sequence[Path]], common: bytes, size: int) -> dict[str, list[Member]]:
    """The members in parts of `size`, by `part_name`. Raises `OSError`."""
    members = [(name, tuple(paths)) for name, paths in files.items()]
    parts = [members[begin : begin + size] for begin in range(0, len(members), size)]
    return {part_name(common, part): part for part in parts}

"""All cases of the fuzz suite: what to write into which file, and who judges it."""

import gzip
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jaxid.model_file import model_text

from . import models
from .breakage import Breakage
from .dialects import DAMAGED, DIALECTS, frame, parquet
from .good import Good, good_logs
from .judge import ROBOTS, Verdict, judge_command, judge_log, judge_model
from .mutations import cells, drawn, edited, edits, with_cells
from .structure import CLOCK, STRUCTURE
from .values import CELLS, COLUMNS, UNITS, WIRING

BREAKAGES: tuple[Breakage, ...] = (
    *(*DIALECTS, *DAMAGED, *STRUCTURE, *CLOCK),
    *(*CELLS, *COLUMNS, *WIRING, *UNITS),
)
_SHORT = 300
"""Rows of a log that is mutated at random: few, so that a change hits every part of it."""


@dataclass(frozen=True)
class Case:
    """One broken input: `kind` and `name` of the breakage, the `source` it was made from, and the work of judging it in
    an empty folder."""

    kind: str
    name: str
    source: str
    judge: Callable[[Path], Verdict]


def broken_logs(seeds: int, number: int, fit_every: int) -> Iterator[Case]:
    """Every breakage of every good log, `seeds` times; each `fit_every`-th goes through integral least squares."""
    count = 0
    for b, breakage in enumerate(BREAKAGES):
        for g, good in enumerate(good_logs()):
            for repeat in range(seeds):
                data = breakage.bytes(good, (number, b, g, repeat))
                if data is not None:
                    yield log_case(breakage, good, data, fit=count % fit_every == 0)
                    count += 1


def log_case(breakage: Breakage, good: Good, data: bytes, fit: bool = False) -> Case:
    """The case of one file's content."""

    def judge(folder: Path) -> Verdict:
        path = folder / breakage.file
        path.write_bytes(data)
        return judge_log(path, good, harmless=breakage.harmless, fit=fit)

    return Case("fit of a broken log" if fit else breakage.kind, breakage.name, good.name, judge)


def mutated_logs(count: int, number: int) -> Iterator[Case]:
    """Random bytes and random cells of short logs of each robot, as CSV, gzip and Parquet."""
    goods = [next(good for good in good_logs() if good.robot == robot) for robot in ROBOTS]
    for g, good in enumerate(good.short(_SHORT) for good in goods):
        text = good.text.encode()
        forms = {"CSV": (text, 10), "gzip": (gzip.compress(text, mtime=0), 1), "Parquet": (parquet(frame(good)), 1)}
        for form, (data, weight) in forms.items():
            for changes in drawn(edits(len(data)), weight * count // 60, number + g):
                yield chance_case(f"random bytes of {form}", good, edited(data, changes))
        for changes in drawn(cells(len(good.rows), len(good.header)), 8 * count // 60, number + g):
            yield chance_case("random cells", good, with_cells(good, changes))


def chance_case(kind: str, good: Good, data: bytes) -> Case:
    """The case of a random change."""

    def judge(folder: Path) -> Verdict:
        path = folder / ("run.parquet" if "Parquet" in kind else "run.csv")
        path.write_bytes(data)
        return judge_log(path, good, by_chance=True)

    return Case(kind, kind, good.name, judge)


def broken_models(seeds: int, number: int) -> Iterator[Case]:
    """Model files of each robot that are broken, odd, or changed at random."""
    for r, (name, build) in enumerate(ROBOTS.items()):
        robot = build()
        for b, (kind, make) in enumerate((models.BROKEN | models.ODD).items()):
            for repeat in range(seeds):
                content = make(robot, np.random.default_rng([number, r, b, repeat]))
                yield model_case(name, kind, content, odd=kind in models.ODD)
        text = model_text(robot).encode()
        for changes in drawn(edits(len(text)), 100 * seeds, number + r):
            yield model_case(name, "random bytes", edited(text, changes), by_chance=True)


def model_case(name: str, kind: str, content: str | bytes, odd: bool = False, by_chance: bool = False) -> Case:
    """The case of one model file."""

    def judge(folder: Path) -> Verdict:
        path = folder / "model.toml"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return judge_model(path, ROBOTS[name](), odd=odd, by_chance=by_chance)

    return Case("model file", kind, name, judge)


def broken_mappings() -> Iterator[Case]:
    """Mappings of each good Pioneer log."""
    for good in (good for good in good_logs() if good.robot == "pioneer"):
        for kind, content in (models.BROKEN_MAPPINGS | models.ODD_MAPPINGS).items():
            yield mapping_case(good, kind, content)


def mapping_case(good: Good, kind: str, content: str | bytes) -> Case:
    """The case of one mapping."""

    def judge(folder: Path) -> Verdict:
        path, mapping = folder / "run.csv", folder / "mapping.toml"
        path.write_text(good.text)
        mapping.write_bytes(content.encode() if isinstance(content, str) else content)
        return judge_log(path, good, mapping=mapping, harmless=kind in models.ODD_MAPPINGS)

    return Case("mapping", kind, good.name, judge)


def commands(number: int, every: int = 1) -> Iterator[Case]:
    """Broken logs and models of the axis through the command line: simulated, and each fiftieth fitted both ways."""
    good = next(good for good in good_logs() if good.robot == "axis")
    for b, breakage in list(enumerate(BREAKAGES))[::every]:
        data = breakage.bytes(good, (number, b))
        if data is not None:
            yield command_case(breakage.name, breakage.file, good.text, data, None, fit=b % 50 == 0)
    robot = ROBOTS["axis"]()
    for b, (kind, make) in list(enumerate(models.BROKEN.items()))[::every]:
        content = make(robot, np.random.default_rng([number, b]))
        content = content.encode() if isinstance(content, str) else content
        yield command_case(kind, "run.csv", good.text, None, content, fit=b % 50 == 0)


def command_case(kind: str, file: str, text: str, log: bytes | None, model: bytes | None, fit: bool) -> Case:
    """`jaxid simulate axis` or `jaxid fit axis` with a broken log or model and the other one good."""

    def judge(folder: Path) -> Verdict:
        path, known = folder / file, folder / "model.toml"
        path.write_bytes(text.encode() if log is None else log)
        known.write_bytes(b"[parameters]\nM = 2.0\nFv = 3.0\nFc = 0.4\n" if model is None else model)
        place = file if model is None else "model.toml"
        if fit:
            out = folder / "out"
            arguments = ["fit", "axis", "--fit", str(path), "--model", str(known), "--out", str(out)]
            return judge_command(arguments, place, (out / "fit.json", out / "model.toml", out / "report.html"))
        out = folder / "predicted.csv"
        arguments = ["simulate", "axis", "--log", str(path), "--model", str(known), "--out", str(out)]
        return judge_command(arguments, place, (out,))

    return Case("command line", f"{'fit' if fit else 'simulate'}: {kind}", "axis", judge)


def million_rows() -> Good:
    """A Pioneer log of a million rows: a good one again and again, its clock running on."""
    good = good_logs()[0]
    values, copies = good.values, -(-1_000_000 // len(good.rows))
    span = values[-1, 0] + values[1, 0] - values[0, 0]
    table = np.concatenate([values + np.r_[k * span, np.zeros(values.shape[1] - 1)] for k in range(copies)])[:1_000_000]
    rows = tuple((f"{row[0]:.2f}", *(f"{cell:g}" for cell in row[1:])) for row in table)
    return Good(good.robot, "a million rows", good.header, rows)

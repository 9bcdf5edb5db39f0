"""The page of a designed experiment: what it is worth, what to drive, what to expect, and what to do with the file."""

from dataclasses import replace

import numpy as np

from ..design import Design, PlannedRun
from ..estimate.uncertainty import PRACTICAL
from .chart import Chart, Panel, Trace
from .design_figure import floor_path
from .document import Block, Charted, Code, Listing, Page, Picture, Section, Tabled, Text, Tone, picture, texts
from .spoken_robot import spoken
from .tables import Cell, Table, constant, number

_LITTLE = 0.9
"""Width of the intervals over those with a PRBS above which a design brings little."""


def planned_chart(run: PlannedRun) -> Chart:
    """Inputs to drive over the outputs to expect of them."""
    units, panels = run.channels.units, []

    def titled(name: str) -> str:
        return f"{name} [{units[name]}]" if units.get(name) else name

    for k, name in enumerate(run.channels.inputs):
        drive = Trace(run.time, run.inputs[:, k], "c0", "" if k else "to drive", "step")
        panels.append(Panel(titled(name), (drive,), small=True))
    for k, name in enumerate(run.channels.measured):
        if not np.isfinite(run.outputs[:, k]).any():
            continue
        expected = Trace(run.time, run.outputs[:, k], "c2", "" if k else "to expect")
        panels.append(Panel(titled(name), (expected,), small=True, follows=True))
    limits = "; ".join(run.limited_by) or "it uses up no limit"
    return Chart(
        tuple(panels), f"{run.name}: inputs to drive and outputs to expect over {run.time[-1]:.3g} s. {limits}."
    )


def _floor(run: PlannedRun) -> tuple[Picture, ...]:
    if run.path is None:
        return ()
    extent = np.ptp(run.path, axis=0)
    said = f"The path on the floor takes {extent[0]:.2g} m by {extent[1]:.2g} m."
    return (picture(floor_path(run), run.name, said, f"{said} It begins at the dot."),)


def _worth(design: Design) -> Table:
    """Expected standard errors, beside those of the reference and of what was known before."""
    rows = []
    for name, value in design.values.items():
        unit = design.units[name]

        def cell(error: float, name: str = name) -> Cell:
            size = design.magnitudes[name]
            if not error <= PRACTICAL * size:
                return Cell("not determined", "bad")
            return Cell(f"{100 * error / size:.2g} %", "value", number(error, 2))

        ratio = design.ratios[name]
        rows.append(
            (
                Cell(name, detail=design.meanings.get(name, "")),
                Cell(unit, "words"),
                Cell(constant(float(f"{value:.4g}"))),
                cell(design.before[name]),
                cell(design.std_errors[name]),
                cell(design.reference_std_errors[name]),
                Cell(f"{ratio:.2f}", "good" if ratio < _LITTLE else "bad" if ratio > 1.05 else ""),
            )
        )
    header = ("parameter", "unit", "value", "known so far", "with this", "with a PRBS", "this / PRBS")
    notes = (
        "Expected standard errors, as a share of the parameter's size and in its unit.",
        f"PRBS: {design.reference}.",
    )
    return Table("", header, tuple(rows), notes)


def _verdict(design: Design) -> tuple[str, Tone]:
    if design.doubt:
        return "For a doubtful model", "bad"
    return ("Worth driving", "good") if design.gain < _LITTLE else ("Little better than a PRBS", "open")


def _headline(design: Design, files: tuple[str, ...]) -> str:
    """What to drive, and what it brings beside what is known and beside a PRBS."""
    what = " and ".join(files) or "these inputs"
    known = [design.std_errors[n] / e for n, e in design.before.items() if e <= PRACTICAL * design.magnitudes[n]]
    beside = f"{design.gain:.2f} of what a PRBS of the same length and energy would leave"
    if len(known) < len(design.before):
        new = len(design.before) - len(known)
        return f"Drive {what}: it determines {new} parameters that nothing known so far does, with errors of {beside}."
    share = float(np.exp(np.mean(np.log(known))))
    return f"Drive {what}: standard errors fall to {share:.2f} of what is known so far, and to {beside}."


def design_page(design: Design, files: tuple[str, ...] = ()) -> Page:
    """The page of a design; `files` are the names under which its runs were saved."""
    verdict, tone = _verdict(design)
    sections = [Section("What it is worth", (Tabled(_worth(design)),))]
    for run in design.runs:
        name = run.name.replace("_", " ").capitalize() if len(design.runs) > 1 else "What to drive, and what to expect"
        told = repr(run if len(design.runs) > 1 or not files else replace(run, name=files[0]))
        sections.append(Section(name, (Text(told), Charted(planned_chart(run)), *_floor(run))))
    drive = f"Drive {' and '.join(files)} from rest" if files else "Drive the inputs from rest"
    items = (
        f"{drive}, and record every output: the file has the time and the inputs, ready for the columns that the sensors fill.",
        "Fit the logs so far and the new ones together.",
    )
    after = Code(
        f"jaxid fit {spoken(design.robot)} --fit LOGS {' '.join(files)} --held-out OTHER_LOGS --out results".replace(
            "  ", " "
        )
    )
    doubt = design.doubt.removeprefix("But ")  # nothing stands before it here
    next_: tuple[Block, ...] = (*texts([f"{doubt[:1].upper()}{doubt[1:]}"]), Listing(items), after)
    return Page(
        title=f"jaxid design {design.robot}",
        kind=f"jaxid design: {design.robot}, {design.tried} inputs tried",
        verdict=verdict,
        tone=tone,
        headline=_headline(design, files),
        lead=texts([design.sentence]),
        sections=tuple(sections),
        next=next_,
    )

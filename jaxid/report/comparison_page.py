"""The page of fits: verdict, parameters with what they mean, measured and simulated, what is left, and what next."""

from collections.abc import Mapping, Sequence

import numpy as np

from ..estimate.confidence.agreement import counted_channels
from ..estimate.judge import POOR
from ..estimate.result import Fit
from ..explanation.where.localise import channel_name
from ..logs import Log
from ..robots.meanings import meanings_of
from . import tables as tab
from .chart import Chart, Panel, Trace, reach_of
from .comparison import Comparison
from .document import Block, Charted, Code, Listing, More, Page, Section, Tabled, Text, Tone, texts
from .intervals import intervals
from .own_clock import on_own_clock
from .spoken_robot import spoken
from .tables import Cell, Table

_VERDICTS: dict[str, tuple[str, Tone]] = {
    "sound": ("Sound", "good"),
    "coloured": ("Sound, coloured noise", "good"),
    "biased": ("Biased", "open"),
    "poor": ("Poor", "bad"),
    "failed": ("Failed", "bad"),
}
_NOTES = 3
"""Notes that stand on the page; the others are folded up."""
_LOGS = 8
"""Logs with a chart of their own, worst first; pictures of all of them are beside the page."""
_FAR = 1e3
"""Times the largest measured value beyond which a simulation is not drawn."""
_COLOURS = tuple(f"c{k}" for k in range(6))


def verdict_of(fit: Fit, predicted: float | None = None) -> tuple[str, Tone]:
    """What is said of a fit in a word, and how grave that is; `predicted`: its error on held-out logs (NaN: it diverges)."""
    if fit.judgement is None:
        return "No verdict", "open"
    word, tone = _VERDICTS[fit.judgement.verdict]
    if tone == "good" and predicted is not None and not predicted <= POOR:
        return "Does not predict", "bad"
    return word, tone


def quantity(log: Log, name: str, words: Mapping[str, str]) -> str:
    """A channel in words with its symbol and unit."""
    unit = log.channels.units.get(name, "")
    return channel_name(name, words) + (f" [{unit}]" if unit else "")


# -- parameters ------------------------------------------------------------------------------------------------------
def meanings(fits: Sequence[Fit]) -> dict[str, str]:
    """What every parameter and combination stands for, by symbol."""
    found: dict[str, str] = {}
    for fit in fits:
        found |= meanings_of(fit.robot)
        found |= {name: meaning for name, (_, _, meaning) in fit.robot.combinations.items()}
    return found


def parameter_table(fits: Mapping[str, Fit], names: Sequence[str], references: Mapping[str, float], kind: str) -> Table:
    """Every parameter with what it means, its unit, every method's estimate and their intervals side by side."""
    meaning = meanings(list(fits.values()))
    known = any(name in references for name in names)
    drawn = len(fits) > 1 or known
    rows = []
    for name in names:
        own = {label: fit.parameters.get(name) or fit.combinations.get(name) for label, fit in fits.items()}
        reference = references.get(name, np.nan)
        unit = next((e.unit for e in own.values() if e and e.unit), "")
        cells = [Cell(name, detail=meaning.get(name, "")), Cell(unit, "words")]
        cells += [Cell(tab.constant(reference))] if known else []
        for label, e in own.items():
            cell = tab.value_cell(e, not fits[label].trustworthy)
            off = e is not None and np.isfinite(reference) and reference and e.status != "fixed"
            detail = tab.percent(100 * (e.value - reference) / abs(reference)) if off and e else ""
            cells.append(Cell(cell.text, f"{cell.mark} value".strip(), detail))
        cells += [intervals(name, own, _COLOURS, reference, kind)] if drawn else []
        rows.append(tuple(cells))
    header = ("parameter", "unit", *([kind] if known else []), *map(tab.title_of, fits))
    header += ("95 % intervals",) if drawn else ()
    notes = ["± is one standard error." + (f" Below it: the difference from the {kind} value." if known else "")]
    if drawn:
        centre = f"the {kind} value" if known else f"the estimate of {tab.title_of(list(fits)[-1])}"
        notes.append(
            f"Intervals: every row has its own scale, with {centre} in the middle; from top to bottom {_in_order(fits)}."
        )
    notes += [tab.DOUBT] if not all(fit.trustworthy for fit in fits.values()) else []
    return Table("", header, tuple(rows), tuple(notes))


def _in_order(fits: Mapping[str, Fit]) -> str:
    return ", ".join(map(tab.title_of, fits))


# -- measured over simulated -------------------------------------------------------------------------------------------
def response_chart(
    log: Log, simulated: Mapping[str, np.ndarray], noise: Mapping[str, float], words: Mapping[str, str]
) -> Chart:
    """A log's inputs, every channel measured and simulated by each method, and below it the residual."""
    units = {log.channels.units.get(name, "") for name in log.channels.inputs}
    unit = units.pop() if len(units) == 1 else ""
    inputs = tuple(
        Trace(log.time, log.input(name), "input" if k == 0 else f"c{k + 2}", f"input {name}", "step")
        for k, name in enumerate(log.channels.inputs)
    )
    panels = [Panel("inputs" + (f" [{unit}]" if unit else ""), inputs, small=True)]
    told = []
    for name in counted_channels(log):
        column, y = log.channels.measured.index(name), log.output(name)
        size = float(np.nanmax(np.abs(y))) if np.isfinite(y).any() else 1.0
        traces = [Trace(log.time, y, "measured", "measured", "dots")]
        left = []
        for k, (label, outputs) in enumerate(simulated.items()):
            own = np.asarray(outputs)[:, column]
            own = np.where(
                np.abs(own) < _FAR * max(size, noise[name]), own, np.nan
            )  # a simulation that diverges ends there
            title = tab.title_of(label)
            traces.append(
                Trace(log.time, own, f"c{k % 6}", title, "dashed" if k % 2 and len(simulated) > 1 else "line")
            )
            left.append(Trace(*on_own_clock(log.time, own - y), f"c{k % 6}", "", "thin"))
            error = (own - y)[np.isfinite(own - y)]
            if error.size:
                told.append(
                    f"{title} leaves {float(np.sqrt(np.mean(error**2))) / noise[name]:.2f} times the noise in {name}"
                )
        shown = y[np.isfinite(y)]
        low, high = (float(shown.min()), float(shown.max())) if shown.size else (-1.0, 1.0)
        margin = 0.15 * max(high - low, 6 * noise[name])
        reach = reach_of([trace.y for trace in left], 3.0 * noise[name], max(high - low, 6 * noise[name]))
        panels.append(Panel(quantity(log, name, words), tuple(traces), low - margin, high + margin, follows=True))
        residual = f"residual, simulated minus measured: {quantity(log, name, words)}"
        panels.append(Panel(residual, tuple(left), -reach, reach, 1.96 * noise[name], small=True))
    alt = f"{log.name}, measured and simulated over time: {'; '.join(told)}." if told else f"{log.name} over time."
    return Chart(tuple(panels), alt, band_label="where noise alone lies 95 % of the time")


def _charts(found: Comparison) -> tuple[Block, ...]:
    """A chart of the worst held-out log, and, folded up, of the others."""
    robot = next(iter(found.fits.values())).robot
    size = {log.name: _worst(found, log.name) for log in found.logs}
    order = sorted(found.logs, key=lambda log: -size[log.name])
    blocks: list[Block] = []
    for k, log in enumerate(order[:_LOGS]):
        simulated = {label: v.simulated[log.name] for label, v in found.predicted.items()}
        chart = Charted(response_chart(log, simulated, found.noise, robot.words))
        said = "; ".join(f"{tab.title_of(label)} {_size(v.by_log[log.name])}" for label, v in found.predicted.items())
        if k == 0:
            which = f"{log.name}, predicted worst: {said}." if len(order) > 1 else f"{log.name}: {said}."
            blocks += [Text(which), chart]
        else:
            blocks.append(More(f"{log.name}: {said}", (chart,)))
    if len(order) > _LOGS:
        blocks.append(Text(f"Pictures of the other {len(order) - _LOGS} logs are files beside this page."))
    return tuple(blocks)


def _size(own: object) -> str:
    return "diverges" if own.diverged else f"{own.normalised_rms:.2f} times the noise"  # type: ignore[attr-defined]


def _worst(found: Comparison, name: str) -> float:
    own = [v.by_log[name] for v in found.predicted.values()]
    return max(np.inf if one.diverged else one.normalised_rms for one in own)


# -- what next -----------------------------------------------------------------------------------------------------------
def advice(fits: Sequence[Fit], held_out: bool, command: bool) -> tuple[Block, ...]:
    """What to do next about the last fit: what it lacks, and where its model goes."""
    fit = fits[-1]
    robot = spoken(fit.robot.name)
    items, lines = [], []
    judgement = fit.judgement
    if judgement is not None and judgement.verdict in ("poor", "failed"):
        items.append(
            "Find out what the model lacks before its numbers are used: an explanation names the missing effect."
        )
        lines.append(f"jaxid explain {robot} --fit LOGS --held-out OTHER_LOGS --out explained")
    elif judgement is not None and judgement.better:
        items.append(judgement.better)
    open_ = [name for name in fit.free_names if fit[name].status == "not_identifiable"]
    # Of what may be zero, such as an offset, no share can be known.
    away = [n for n in fit.free_names if fit[n].status == "identified" and abs(fit[n].value) > 2.0 * fit[n].std_error]
    wide = [n for n in away if fit[n].std_error > 0.1 * abs(fit[n].value)]
    if open_ or wide:
        what = (
            f"do not determine {', '.join(open_)}" if open_ else f"determine {', '.join(wide)} to no better than 10 %"
        )
        items.append(
            f"These logs {what}: design the experiment that does, within your limits on inputs, speed and floor."
        )
        lines.append(f"jaxid design {robot} --model model.toml --already LOGS --limit LARGEST_INPUT --out next")
    if not held_out:
        items.append("Hold some logs out: nothing says yet how well these models predict.")
        lines.append(f"jaxid fit {robot} --fit LOGS --held-out OTHER_LOGS --out checked")
    if fit.trustworthy and judgement is not None:
        items.append("Use the model: model.toml has the estimates, and simulates any log's inputs.")
        lines.append(f"jaxid simulate {robot} --log LOG --model model.toml --out predicted.csv")
    if not items:
        items.append("Look at what is left above, and fit again with what you know.")
    return (Listing(tuple(items)), *([Code("\n".join(lines))] if command and lines else []))


def _split(sentence: str) -> tuple[str, str]:
    """The headline, and what follows its first semicolon."""
    head, _, rest = sentence.partition("; ")
    if not rest:
        return sentence, ""
    return f"{head}.", f"{rest[0].upper()}{rest[1:]}"


def _judged(fit: Fit) -> tuple[str, str]:
    """What the residual says of a fit first, and the rest of it."""
    title = tab.title_of(fit.method)
    if fit.judgement is None:
        return f"{title.capitalize()} of {fit.robot.name}.", ""
    if not fit.judgement.sentences:
        size = fit.judgement.normalised_rms
        white = " and has no pattern" if fit.judgement.white else ""
        return f"{title.capitalize()} leaves {size:.2f} times the noise{white}.", fit.judgement.better
    first, *others = fit.judgement.sentences
    return f"{title.capitalize()}: {first}", " ".join([*others, fit.judgement.better]).strip()


def _noted(notes: Sequence[str]) -> tuple[Block, ...]:
    shown: list[Block] = [Listing(tuple(notes[:_NOTES]))] if notes else []
    if len(notes) > _NOTES:
        shown.append(More(f"{len(notes) - _NOTES} further notes", (Listing(tuple(notes[_NOTES:])),)))
    return tuple(shown)


def comparison_page(found: Comparison, kind: str = "comparison") -> Page:
    """The page of fits that have predicted held-out logs."""
    fits = list(found.fits.values())
    label, last = list(found.fits.items())[-1]
    own = found.predicted[label]
    verdict, tone = verdict_of(last, np.nan if own.diverged else own.normalised_rms)
    headline, rest = _split(found.sentence)
    said = [f"{tab.title_of(n)}: {fit.judgement.sentence}" for n, fit in found.fits.items() if fit.judgement]
    notes = [note for note in found.notes if note not in said]
    units = {channel: found._unit(channel) for channel in found.channels}
    names = (*found._names[0], *found._names[1])
    after: list[Block] = [Tabled(tab.held_out_table(found.predicted, found.fitted, found.noise, units))]
    after += [Tabled(tab.ahead_table(found.ahead, found.predicted))] if found.ahead else []
    after += [More("Every log", (Tabled(tab.log_table(found.predicted)),))] if len(found.logs) > 1 else []
    sections = (
        Section("Parameters", (Tabled(parameter_table(found.fits, names, found.references, found.reference)),)),
        Section("How well it predicts", (*_charts(found), *after)),
        Section("What is left", (Tabled(tab.test_table(found.tested, last.robot.words)),)),
    )
    robot = last.robot.name
    return Page(
        title=f"jaxid {kind} {robot}",
        kind=f"jaxid {kind}: {robot}, {len(found.logs)} log{'s' * (len(found.logs) > 1)} held out",
        verdict=verdict,
        tone=tone,
        headline=headline,
        lead=(*([Text(rest)] if rest else []), Listing(tuple(said)), *_noted(notes)),
        sections=sections,
        next=advice(fits, True, kind == "fit"),
    )


def fits_page(fits: Sequence[Fit], logs: Sequence[Log] = (), simulated: Mapping[str, Sequence[np.ndarray]] | None = None,
              noise: Mapping[str, float] | None = None) -> Page:  # fmt: skip
    """The page of fits without held-out logs; `simulated`: outputs [samples, channels] of the fitted `logs` by method."""
    last = fits[-1]
    named = {fit.method: fit for fit in fits}
    verdict, tone = verdict_of(last)
    names = list(dict.fromkeys(name for fit in fits for name in (*fit.free_names, *fit.combinations)))
    said = [f"{tab.title_of(fit.method)}: {fit.judgement.sentence}" for fit in fits[:-1] if fit.judgement]
    stands = {fit.judgement.sentence for fit in fits if fit.judgement}
    notes = [f"{tab.title_of(fit.method)}: {note}" for fit in fits for note in fit.notes if note not in stands]
    notes += [f"{tab.title_of(fit.method)}: {fit.reason}." for fit in fits if not (fit.converged or fit.failed)]
    headline, rest = _judged(last)
    sections = [Section("Parameters", (Tabled(parameter_table(named, names, {}, "published")),))]
    if logs and simulated and noise:
        sections.append(Section("Measured and simulated", _fitted_charts(last, logs, simulated, noise)))
    return Page(
        title=f"jaxid fit {last.robot.name}",
        kind=f"jaxid fit: {last.robot.name}, no logs held out",
        verdict=verdict,
        tone=tone,
        headline=headline,
        lead=(*texts([rest]), *([Listing(tuple(said))] if said else []), *_noted(notes)),
        sections=tuple(sections),
        next=advice(fits, False, True),
    )


def _fitted_charts(
    fit: Fit, logs: Sequence[Log], simulated: Mapping[str, Sequence[np.ndarray]], noise: Mapping[str, float]
) -> tuple[Block, ...]:
    blocks: list[Block] = [Text("The logs that were fitted, which is no proof: only logs that were held out tell.")]
    for e, log in enumerate(list(logs)[:_LOGS]):
        own = {label: outputs[e] for label, outputs in simulated.items()}
        chart = Charted(response_chart(log, own, noise, fit.robot.words))
        blocks.append(chart if e == 0 else More(log.name, (chart,)))
    return tuple(blocks)

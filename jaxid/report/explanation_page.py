"""The page of an explanation: verdict, what is missing as a picture, where, what, how sure, before and after, what next.

The same body shows in a notebook. Imported when it is wanted (`page.Page`), since matplotlib takes long to import.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from .._atomic import replacing
from ..explanation.explanation import Explanation
from ..explanation.left.heldout import HeldOut
from ..explanation.where.law_curves import LawCurve
from ..robots.effect import in_words
from . import explanation_figures as draw
from . import explanation_tables as tab
from .document import (
    Bar,
    Bars,
    Block,
    Charted,
    Code,
    Listing,
    More,
    Page,
    Section,
    Tabled,
    Text,
    Tone,
    picture,
    rendered,
    texts,
    write_page,
)
from .explanation_charts import before_after_chart, force_chart, next_chart, whiteness_alt
from .figures import as_png
from .law_figure import caption, curves_of, law_figure
from .leads_figure import leads
from .localisation_figures import localisation
from .ranking_figure import ranking
from .spoken_robot import spoken

_DPI = 130
_CONDITIONS, _CANDIDATES, _LOGS = 8, 10, 6
"""Bars and charts that are shown, the first of them."""
PICTURES = ("law", "localisation", "leads", "ranking", "before_after", "whiteness", "moved", "next_experiment")
"""Names of the pictures beside the page."""
_VERDICTS: dict[str, tuple[str, Tone]] = {
    "named": ("Named", "good"),
    "adequate": ("Nothing missing", "good"),
    "ambiguous": ("Named, but open", "open"),
    "unexplained": ("Unexplained", "bad"),
}


class _OnPage(NamedTuple):
    """Figures that the page shows and that are written beside it, made once, and the curves that the first draws."""

    curves: Mapping[str, tuple[LawCurve, ...]]
    law: Figure | None
    leads: Figure | None
    whiteness: Figure


def _on_page(found: Explanation) -> _OnPage:
    curves = curves_of(found)
    led = found.localisation is not None and found.verdict == "unexplained"
    return _OnPage(curves, law_figure(curves), leads(found) if led else None, draw.whiteness(found))


def figures(found: Explanation) -> dict[str, Figure]:
    """The figures that apply, by the names of `PICTURES`."""
    return _figures(found, _on_page(found))


def _figures(found: Explanation, shown: _OnPage) -> dict[str, Figure]:
    made: dict[str, Figure | None] = {"law": shown.law}
    if found.localisation is not None:
        made["localisation"] = localisation(found.localisation, found.held_out)
        made["leads"] = shown.leads
    made["ranking"] = ranking(found)
    made["before_after"] = draw.before_after(found)
    made["whiteness"] = shown.whiteness
    made["moved"] = draw.moved(found)
    if found.next_experiment is not None:
        made["next_experiment"] = draw.next_inputs(found.next_experiment, found.model.channels.units)
    return {name: figure for name, figure in made.items() if figure is not None}


# -- parts of the page -------------------------------------------------------------------------------------------------
def _errors(found: Explanation) -> Bars:
    rows = [("error " + label if found.effects else "error", state.normalised_rms, "after" if label == "after" else "before")
            for state, _, label in draw.states(found)]  # fmt: skip
    if found.verdict == "adequate":
        rows = [(name, value, "after") for name, value, _ in rows]
    rows.append(("noise alone" if found.noise_floor == 1.0 else "coloured noise", found.noise_floor, ""))
    top = max(value for _, value, _ in rows)
    bars = tuple(Bar(name, 100.0 * value / top, f"{value:.2f}", colour) for name, value, colour in rows)
    note = "Error: simulated minus measured on logs that were not fitted (RMS), in units of the measurement noise."
    return Bars("", bars, note)


def _law(found: Explanation, shown: _OnPage) -> tuple[Block, ...]:
    figure, said = shown.law, caption(found, shown.curves)
    if figure is None:
        return ()
    note = (
        f"{said} Dashed: the model without it, as it was fitted; green: with it, and the 95 % band by the errors of its "
        "parameters. Grey, where there is any: what the measured motion asks for, smoothed over time, so that what acts for a "
        "moment only shows less there."
    )
    panels = sum(ax.get_visible() for ax in figure.axes)
    return (picture(figure, "law", said, note, min(panels, 3), 1.5 if panels == 1 else 1.15),)


def _where(found: Explanation, figure: Figure | None) -> Section | None:
    place = found.localisation
    if place is None:
        return None
    blocks: list[Block] = [Text(place.sentence)]
    if place.forces:
        blocks.append(Charted(force_chart(place, found.held_out)))
    bars: list[Block] = []
    if place.conditions:
        shown = sorted(place.conditions[:_CONDITIONS], key=lambda c: -c.ratio)
        top = max(2.0, *(c.ratio for c in shown))
        rows = tuple(
            Bar(c.name, 100 * c.ratio / top, f"{100 * c.share:.0f} % in {100 * c.time_share:.0f} % of the time",
                "before" if c.stands_out else "", c.stands_out)
            for c in shown
        )  # fmt: skip
        note = "How many times as much of the missing force acts there as at random moments (dashed: as much)."
        bars.append(Bars("When it acts", rows, note, line=100 / top))
    if place.patterns:
        rows = tuple(
            Bar(p.name, 100 * min(max(p.share, 0.0), 1.0), f"{100 * max(p.share, 0.0):.0f} %",
                "before" if p.stands_out else "", p.stands_out)
            for p in place.patterns
        )  # fmt: skip
        bars.append(Bars("What it follows", rows, "The share of the missing force that each reproduces."))
    sure = any(c.stands_out for c in place.conditions) or any(p.stands_out for p in place.patterns)
    blocks += bars if sure or not bars else [More("When it acts and what it follows: nothing stands out", tuple(bars))]
    if figure is not None:
        note = (
            "The missing force of all held-out logs against what it may depend on (black: median). A line that is not flat is "
            "a lead."
        )
        blocks.append(picture(figure, "leads", place.sentence, note, len(figure.axes)))
    return Section("Where?", tuple(blocks))


def _candidates(found: Explanation) -> tuple[Block, ...]:
    """What each candidate promised, and what was left with those that were refitted."""
    blocks: list[Block] = []
    for number, step in enumerate(found.search.steps, start=1):
        refitted = {trial.id: trial.held_out.normalised_rms for trial in step.compared}
        promised = {c.effect.id: min(max(c.share, 0.0), 1.0) for c in step.screened}
        names = list(refitted) + [name for name in promised if name not in refitted and promised[name] > 0.005]
        names = names[: max(_CANDIDATES, len(refitted))]
        colour = {name: "alike" for name in step.equivalent} | {step.chosen.id: "after"}
        which = f", effect {number} of {len(found.search.steps)}" if len(found.search.steps) > 1 else ""
        rows = [
            Bar(in_words(n), 100 * promised.get(n, 0.0), f"{100 * promised.get(n, 0.0):.0f} %", colour.get(n, ""),
                n == step.chosen.id)
            for n in names
            if n in promised
        ]  # fmt: skip
        note = "The share of the gap that each promised before anything was refitted. Green: added."
        if step.equivalent:
            note += " Light green: this data cannot tell it from that."
        blocks.append(Bars(f"First look at all candidates{which}", tuple(rows), note))
        before = step.evidence[0].held_out.normalised_rms
        top = max(before, *(min(error, 1.2 * before) for error in refitted.values()))
        after = [
            Bar(in_words(n), 100 * min(error, top) / top, f"{error:.2f}", colour.get(n, ""), n == step.chosen.id)
            for n, error in refitted.items()
        ]
        after.append(Bar("without any", 100 * before / top, f"{before:.2f}", "before"))
        floor = "Held-out error with each, all parameters refitted, in units of the noise (dashed: noise alone)."
        blocks.append(Bars(f"Refitted{which}", tuple(after), floor, line=100 / top))
    first = [c for c in found.search.first_look if c.share > 0.0][:_CANDIDATES]
    if not found.search.steps and first:
        rows = [Bar(in_words(c.effect.id), 100 * min(c.share, 1.0), f"{100 * min(c.share, 1.0):.0f} %") for c in first]
        blocks.append(Bars("First look at all candidates", tuple(rows), "The share of the gap that each promised."))
    return tuple(blocks)


def _what(found: Explanation) -> Section | None:
    candidates = _candidates(found)
    if not (found.effects or candidates):
        return None
    blocks: list[Block] = [Text(effect.sentence) for effect in found.effects]
    if found.effects:
        blocks.append(Tabled(tab.effects_table(found)))
    else:
        blocks.append(
            Text("No candidate explains enough: each must close at least 5 % of the gap on the held-out logs.")
        )
    return Section("What?", (*blocks, *candidates))


def _names(names: tuple[str, ...]) -> str:
    return " or ".join(map(in_words, names))


def _sure(found: Explanation) -> Section:
    items = []
    for effect in found.effects:
        if effect.equivalent_to:
            items.append(f"{effect.title} cannot be told from {_names(effect.equivalent_to)} on this data.")
        else:
            items.append(
                f"{effect.title}: every other name that was refitted predicts worse, on the fitted or on the held-out logs."
            )
        if effect.laws_alike:
            items.append(
                f"Of its laws, {in_words(effect.law)} cannot be told from {_names(effect.laws_alike)} on this data."
            )
        elif effect.shapes:
            items.append("None of its laws with a formula that were refitted predicts as well as the curve.")
    blocks: list[Block] = [Listing(tuple(items)), Tabled(tab.evidence_table(found))] if items else []
    return Section("How sure?", (*blocks, *texts(_chances(found))))


def _cases(p: float) -> str:
    """A probability as how often chance does as much."""
    return "in less than 1 case in 10,000" if p < 1e-4 else f"in {100 * p:.2g} % of cases"


def _excused(left: HeldOut) -> str:
    """Why a pattern that chance alone would not leave is no matter; empty without such a pattern, or where it matters."""
    if not left.adequate or left.p_white >= left.false_alarm / 2:
        return ""
    if left.by_chance:
        return "it is what delays that scatter leave"
    if left.within_errors:
        return "it is what the standard errors of the parameters let expect"
    if left.rounded:
        return "it is what rounding to the sensors' steps makes"
    if left.inputs_rounded:
        return "it is no more than what the rounding of the logged inputs makes"
    if left.unrelated:
        return "it is small and follows nothing that drove the robot"
    return "it is too small beside the noise to matter"


def _chances(found: Explanation) -> list[str]:
    alarm = found.before.false_alarm
    if found.verdict == "adequate" and found.colour:
        return [
            "The residual is not white, but it follows neither the inputs nor the motion, every log has as much of it as its "
            "own neighbouring samples say, and no candidate explains any of it once it is whitened."
        ]
    if found.verdict == "adequate":
        below = f"{_cases(found.before.p_white)}. Something is called missing below {50 * alarm:g} %"
        as_much = f"if there were nothing but noise, residuals with at least this much structure would come up {below}"
        excused = _excused(found.before)
        return [f"A pattern is left: {as_much}, but {excused}." if excused else f"No pattern is left: {as_much}."]
    said = (
        f"A complete model is taken for an incomplete one in {100 * alarm:g} % of cases (the level that was asked for; it is "
        "shared among the tests of size, correlation and, where the noise is coloured, shape)."
    )
    if not found.effects:
        return [said]
    excused = _excused(found.after)
    noise = "there is coloured noise" if found.noise_floor > 1 else "a pattern is still left"
    if excused:
        left = "a pattern is left"
    elif found.after.adequate:
        left = "no pattern is left"
    else:
        left = noise if found.after.p_white < alarm / 2 else "more is left than noise, though without a pattern"
    chance = f"noise alone would have as much structure {_cases(found.after.p_white)}"
    return [said, f"After the last step {left}: {chance}{f', but {excused}' if excused else ''}."]


def _before_and_after(found: Explanation, figure: Figure) -> Section:
    order = sorted(range(len(found.held_out)), key=lambda e: -draw.size_of(found.before.residuals[e]))
    blocks: list[Block] = [Tabled(tab.channel_table(found))]
    for k, e in enumerate(order[:_LOGS]):
        chart = Charted(before_after_chart(found, e))
        name = found.held_out[e].name
        worst = f"{name}, the held-out log that was predicted worst before." if len(order) > 1 else f"{name}."
        blocks += [Text(worst), chart] if k == 0 else [More(name, (chart,))]
    note = (
        "Left: how much neighbouring residuals are alike; noise stays in the grey band. Right: the residual's power at every "
        "frequency, in units of the noise's; noise is flat at one."
    )
    blocks.append(
        More("Correlation and spectrum of the residual", (picture(figure, "whiteness", whiteness_alt(found), note, 2),))
    )
    if found.effects:
        blocks.append(Tabled(tab.moved_table(found, drawn=True)))
    return Section("Before and after" if found.effects else "The residual", tuple(blocks))


def _doubted(found: Explanation) -> bool:
    """Whether an answer was found, but the fit with it, or that in which nothing is missing, is poor or failed all the same."""
    judged = (found.baseline if found.verdict == "adequate" else found.final).judgement
    return found.verdict != "unexplained" and judged is not None and not judged.trustworthy


def _next(found: Explanation) -> tuple[Block, ...]:
    name = spoken(found.model.name)
    simulate = Code(f"jaxid simulate {name} --log LOG --model model.toml --out predicted.csv")
    if found.next_experiment is not None:
        chart = Charted(next_chart(found.next_experiment, found.model.channels.units))
        return Text(f"{found.next_experiment.sentence} The inputs are in next_experiment.csv."), chart
    if _doubted(found):
        # As the sentence and the notes say; what hides a pattern here may be that these logs have too little of it.
        lead = (
            "Find the rest before the numbers of this model are used: record more logs, or livelier ones, and look again from "
            "the model so far."
        )
        return Text(lead), Code(f"jaxid explain {name} --fit LOGS --held-out OTHER_LOGS --model model.toml --out again")
    if found.verdict == "adequate":
        return Text(
            "Use the model. Logs of driving that these lack (other speeds, loads or floors) would test it further."
        ), simulate
    if found.verdict == "unexplained":
        lead = (
            "Look at the missing force under Where?: what it follows, and at which moments it acts, is the lead. An effect of "
            "your own is tried beside the listed ones:"
        )
        return Text(lead), Code(
            f"jaxid explain {name} --fit LOGS --held-out OTHER_LOGS --effects module:attribute --out again"
        )
    return Text("Use the model with what was added: model.toml goes into every other command."), simulate


def page_of(found: Explanation) -> Page:
    """The whole page as data."""
    return _page_of(found, _on_page(found))


def _page_of(found: Explanation, shown: _OnPage) -> Page:
    verdict, tone = _VERDICTS[found.verdict]
    if _doubted(found):
        verdict, tone = f"{verdict.removesuffix(', but open')}, but doubted", "open"
    sections = (_where(found, shown.leads), _what(found), _sure(found), _before_and_after(found, shown.whiteness))
    held_out = f"{len(found.held_out)} log{'s' * (len(found.held_out) > 1)} held out"
    return Page(
        title=f"jaxid explain {found.model.name}",
        kind=f"jaxid explain: {found.model.name}, {held_out}",
        verdict=verdict,
        tone=tone,
        headline=found.sentence,
        lead=(*texts(found.notes), _errors(found), *_law(found, shown)),
        sections=tuple(section for section in sections if section is not None),
        next=_next(found),
    )


def body(found: Explanation) -> str:
    """HTML for a notebook."""
    return rendered(page_of(found), whole=False)


def save(found: Explanation, folder: Path) -> list[Path]:
    """Write the page, and its pictures as PNG files, into `folder` and return their paths."""
    written = [folder / "report.html"]
    shown = _on_page(found)
    write_page(written[0], _page_of(found, shown))
    pictures = _figures(found, shown)
    for name, figure in pictures.items():
        written.append(folder / f"{name}.png")
        with replacing(written[-1]) as temporary:
            temporary.write_bytes(as_png(figure, _DPI))
    # What an earlier explanation left here would pass for this one's.
    for name in set(PICTURES) - pictures.keys():
        (folder / f"{name}.png").unlink(missing_ok=True)
    return written

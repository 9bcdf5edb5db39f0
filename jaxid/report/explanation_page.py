"""The page of an explanation: verdict, where, what, how sure, before and after, what next, in one file.

The same body shows in a notebook. Imported when it is wanted (`page.Page`), since matplotlib takes long to import.
"""

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from .._atomic import replacing, write_text
from ..explanation.explanation import Explanation
from ..explanation.law_curves import LawCurve
from ..robots.effect import in_words
from . import explanation_figures as draw
from . import explanation_tables as tab
from .figures import as_html, as_png
from .law_figure import caption, curves_of, law_figure
from .leads_figure import leads
from .localisation_figures import localisation
from .ranking_figure import ranking
from .tables import Table, to_html

_TEMPLATE = "explanation.html.jinja"
_DPI = 130
ALT = {
    "law": "What is missing: every named effect as a function of what it depends on, before and after",
    "localisation": "The missing force over time, and when it acts",
    "leads": "The missing force against speed, heading, place and time",
    "ranking": "Candidates: promised share of the gap, and error after a refit",
    "before_after": "Residual before and after on the worst held-out log",
    "whiteness": "Correlation and spectrum of the residual before and after",
    "moved": "The robot's own parameters before and after",
    "next_experiment": "Inputs of the proposed experiment",
}
"""Every picture's name and what it shows."""


def figures(found: Explanation) -> dict[str, Figure]:
    """The figures that apply, by the names of `ALT`."""
    return _figures(found, curves_of(found))


def _figures(found: Explanation, curves: Mapping[str, tuple[LawCurve, ...]]) -> dict[str, Figure]:
    made: dict[str, Figure | None] = {"law": law_figure(curves)}
    if found.localisation is not None:
        made["localisation"] = localisation(found.localisation, found.held_out)
        made["localisation"].suptitle("")  # the page says the same sentence above the picture
        if found.verdict == "unexplained":
            made["leads"] = leads(found)
    made["ranking"] = ranking(found)
    made["before_after"] = draw.before_after(found)
    made["whiteness"] = draw.whiteness(found)
    made["moved"] = draw.moved(found)
    if found.next_experiment is not None:
        made["next_experiment"] = draw.next_inputs(found.next_experiment, found.model.channels.units)
    return {name: figure for name, figure in made.items() if figure is not None}


def _drawn(found: Explanation) -> tuple[dict[str, bytes], str]:
    """The figures as PNG files, drawn once for the page and the files beside it (that takes most of the page's time), and
    what the first of them shows in words."""
    curves = curves_of(found)
    return {name: as_png(figure, _DPI) for name, figure in _figures(found, curves).items()}, caption(found, curves)


def _markup(table: Table) -> Markup:
    return Markup(to_html(table))


def _render(found: Explanation, pictures: dict[str, bytes], shown: str, whole: bool) -> str:
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(files("jaxid.report").joinpath(_TEMPLATE).read_text(encoding="utf-8"))
    bars = [("error " + label if found.effects else "error", state.normalised_rms, colour)
            for state, colour, label in draw.states(found)]  # fmt: skip
    bars.append(("noise floor" if found.noise_floor == 1.0 else "coloured noise", found.noise_floor, "#8c8c8c"))
    top = max(value for _, value, _ in bars)
    alt = ALT | ({"law": shown} if shown else {})
    return template.render(
        whole=whole,
        found=found,
        bars=[(name, value, 80.0 * value / top, colour) for name, value, colour in bars],
        pictures={name: Markup(as_html(picture, escape(alt[name]))) for name, picture in pictures.items()},
        caption=shown,
        effects=_markup(tab.effects_table(found)),
        evidence=_markup(tab.evidence_table(found)),
        channels=_markup(tab.channel_table(found)),
        moved=_markup(tab.moved_table(found)),
        false_alarm=found.before.false_alarm,
        words=in_words,
    )


def body(found: Explanation) -> str:
    """HTML for a notebook."""
    return _render(found, *_drawn(found), whole=False)


def save(found: Explanation, folder: Path) -> list[Path]:
    """Write the page and its pictures into `folder` and return their paths."""
    pictures, shown = _drawn(found)
    written = [folder / "report.html"]
    write_text(written[0], _render(found, pictures, shown, whole=True))
    for name, picture in pictures.items():
        written.append(folder / f"{name}.png")
        with replacing(written[-1]) as temporary:
            temporary.write_bytes(picture)
    # What an earlier explanation left here would pass for this one's.
    for name in ALT.keys() - pictures.keys():
        (folder / f"{name}.png").unlink(missing_ok=True)
    return written

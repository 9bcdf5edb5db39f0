"""Draw every mechanism's picture into `docs/effects/`.

python -m benchmarks.fingerprints
python -m benchmarks.fingerprints --only backlash motor_lag
"""

import argparse
import io
import re
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from jaxid.report.style import COLOURS, MEASURED, tidy

from .cases import CASES, Case
from .missing import Run

PICTURES = Path(__file__).parents[2] / "docs" / "effects"
_SIZE = (7.6, 2.3)  # inches
_DOTS = 160


def picture(case: Case, run: Run) -> Figure:
    """The motion with the mechanism and without, and what is missing over what it depends on."""
    column = run.column(case.channel)
    figure = Figure(figsize=_SIZE, layout="constrained")
    motion, shape = figure.subplots(1, 2, width_ratios=(1.25, 1))
    shown = (run.time >= case.seconds[0]) & (run.time <= case.seconds[1])
    motion.plot(run.time[shown], run.model[shown, column], color=MEASURED, lw=1.2, label="without")
    motion.plot(run.time[shown], run.real[shown, column], color=COLOURS[0], lw=1.6, label="with")
    words = run.robot.words.get(case.channel, case.channel)
    unit = run.robot.channels.units[case.channel].split(" or ")[0]  # the axis here is a linear one
    motion.set(xlabel="time [s]", ylabel=f"{words} [{unit}]")
    motion.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, fontsize="small", frameon=False, borderpad=0)
    x, y = case.seen(run)
    apart = case.apart[1](run) if case.apart else np.zeros(len(x), bool)
    for which, colour, label in ((~apart, COLOURS[1], None), (apart, COLOURS[2], case.apart and case.apart[0])):
        places = np.flatnonzero(which & np.isfinite(y))
        places = places[np.linspace(0, len(places) - 1, min(len(places), _DOTS)).astype(int)]
        if len(places):
            shape.plot(x[places], y[places], ".", ms=3.5, color=colour, label=label)
    shape.axhline(0.0, color="0.3", lw=0.6, zorder=0)
    reach = 1.15 * float(np.nanmax(np.abs(y)))
    low, high = float(np.nanmin(y)), float(np.nanmax(y))
    shape.set_ylim(-reach if low < -0.02 * reach else -0.12 * reach, reach if high > 0.02 * reach else 0.12 * reach)
    shape.set(xlabel=case.label, ylabel=case.quantity)
    if case.apart:
        shape.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), fontsize="small", frameon=False, borderpad=0)
    for ax in (motion, shape):
        tidy(ax)
    return figure


_DOT = re.compile(r"<g([^>]*)>\s*((?:<use [^>]*style=\"([^\"]*)\"/>\s*)+)</g>")
_FONTS = {"font.sans-serif": ["DejaVu Sans", "Verdana", "Arial"]}


def _style_once(group: re.Match[str]) -> str:
    """A group of dots that says once how they look."""
    attributes, dots, style = group.groups()
    said = f' style="{style}"'
    return f"<g{attributes}{said}>{dots.replace(said, '')}</g>"


def as_svg(figure: Figure, name: str) -> str:
    """The picture as text that does not change from run to run, and is as short as it can easily be."""
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name, **_FONTS}):
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    # Hundredths of a point are finer than anybody sees.
    text = re.sub(r"(\d+\.\d{2})\d+(?=[\s\",)])", r"\1", buffer.getvalue())
    return re.sub(r"\s*\n\s*", "\n", _DOT.sub(_style_once, text))


def main() -> None:
    """Draw and write."""
    parser = argparse.ArgumentParser(description="Draw every mechanism's picture into docs/effects/.")
    parser.add_argument("--only", nargs="+", choices=list(CASES), default=list(CASES), help="mechanisms to draw")
    PICTURES.mkdir(exist_ok=True)
    for name in parser.parse_args().only:
        case = CASES[name]
        (PICTURES / f"{name}.svg").write_text(as_svg(picture(case, case.run(name)), name), encoding="utf-8")


if __name__ == "__main__":
    main()

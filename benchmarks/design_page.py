"""The page and the picture of `benchmarks.design`."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

DOCS = Path(__file__).parents[1] / "docs"
BLUE, GREY = "#0072B2", "0.62"
TARGET = 0.6


def mean_ratio(found: dict[str, Any]) -> dict[str, float]:
    """Geometric mean and worst ratio of standard errors: expected, and the spread of the Monte Carlo fits."""
    expected = np.array(found["expected"]["design"]) / np.array(found["expected"]["prbs"])
    mc = found["monte_carlo"]
    spread = np.array(mc["design"]["spread"]) / np.array(mc["prbs"]["spread"])
    reported = np.array(mc["design"]["reported"]) / np.array(mc["prbs"]["reported"])
    off = np.array(found["ratios_with_parameters_off"])

    def gm(ratio: np.ndarray) -> float:
        return float(np.exp(np.mean(np.log(ratio))))

    best = max(gm(np.array(found["expected"]["design"]) / np.array(e)) for e in found["rivals"]["clocks"].values())
    return {
        "expected": gm(expected), "expected_worst": float(expected.max()), "spread": gm(spread),
        "spread_worst": float(spread.max()), "reported": gm(reported), "reported_worst": float(reported.max()),
        "off": max(gm(row) for row in off), "best_clock": best,
        "at_limit": gm(np.array(found["expected"]["design"]) / np.array(found["rivals"]["at_limit"])),
    }  # fmt: skip


def picture(results: dict[str, Any]) -> Figure:
    """Left: what is driven. Right: how far each parameter is then known, PRBS above, design below."""
    heights = [0.5 + 0.5 * len(found["values"]) for found in results.values()]
    figure = Figure(figsize=(11, 0.6 + sum(heights)), layout="constrained")
    grid = figure.subplots(len(results), 2, squeeze=False, height_ratios=heights, width_ratios=(1.25, 1.0))
    for (name, found), (left, right) in zip(results.items(), grid, strict=True):
        limit, inputs = found["settings"]["limit"], found["input_names"]
        time = np.arange(len(found["inputs"]["design"])) * found["interval"]
        ticks = []
        for key, colour, first in (("prbs", GREY, 0), ("design", BLUE, len(inputs))):
            for i in range(len(inputs)):
                signal = np.array(found["inputs"][key])[:, i]
                level = -(first + i) * 1.0 - (0.4 if first else 0.0)
                left.step(time, level + 0.42 * signal / limit, where="post", color=colour, lw=1.0)
                ticks.append((level, inputs[i]))
        left.set_yticks([t[0] for t in ticks], [t[1] for t in ticks])
        left.set_title(
            f"{name}: PRBS and designed input, equal energy", loc="left", fontsize="small", fontweight="bold"
        )
        left.margins(x=0.01)
        names = list(found["values"])
        value = np.abs(list(found["values"].values()))
        rows, prbs = np.arange(len(names)), np.array(found["expected"]["prbs"])
        for key, colour, shift in (("prbs", GREY, -0.19), ("design", BLUE, 0.19)):
            width = np.array(found["expected"][key]) / prbs
            seen = np.array(found["monte_carlo"][key]["spread"]) / prbs
            right.barh(rows + shift, width, height=0.36, color=colour)
            right.plot(seen, rows + shift, "o", ms=4, mfc="white", mec="black", mew=1.0)
            for row, end, percent in zip(rows, np.maximum(width, seen), 100 * width * prbs / value, strict=True):
                right.text(end + 0.03, row + shift, f"{percent:.2g} %", va="center", fontsize=7, color="0.25")
        right.set_xlim(0, 1.5)
        right.set_yticks(rows, names)
        right.set_ylim(len(names) - 0.4, -0.6)
        ratio = mean_ratio(found)
        right.set_title(
            f"error bars {ratio['expected']:.2f} times as wide",
            loc="left",
            fontsize="small",
            fontweight="bold",
            color=BLUE,
        )
        for ax in (left, right):
            ax.spines[["top", "right"]].set_visible(False)
            ax.tick_params(labelsize="small")
        right.grid(axis="x", alpha=0.25, lw=0.6)
    grid[-1, 0].set_xlabel("time [s]")
    grid[-1, 1].set_xlabel(
        "standard error, PRBS = 1 (beside it in % of the value)\ncircles: spread of Monte Carlo fits"
    )
    handles = [
        figure.axes[0].plot([], [], color=c, lw=6, label=label)[0] for c, label in ((GREY, "PRBS"), (BLUE, "design"))
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=2, frameon=False)
    return figure


def _limits(settings: dict[str, Any]) -> str:
    parts = [f"input {settings['limit']:g}"]
    parts += [f"{name} {value:g} m/s" for name, value in settings["speeds"].items()]
    if settings["rectangle"]:
        parts.append("floor {:g} m by {:g} m".format(*settings["rectangle"]))
    if settings["radius"]:
        parts.append(f"{settings['radius']:g} m either way")
    return ", ".join(parts)


def write_page(results: dict[str, Any]) -> None:
    """docs/design.md and docs/design/widths.png."""
    (DOCS / "design").mkdir(parents=True, exist_ok=True)
    picture(results).savefig(DOCS / "design" / "widths.png", dpi=110)
    counts = sorted({found["realisations"] for found in results.values()})
    sure = 100 / np.sqrt(2 * (counts[0] - 1))
    lines = [
        "# Designed experiments",
        "",
        "Written by `python -m benchmarks.design`. `jaxid.design_experiment` chooses the input from which output error learns",
        "most about all free parameters together (D-optimality), within limits on voltage, speed and floor space. Here is what",
        "that is worth against the input that an engineer would take.",
        "",
        "![Inputs and standard errors](design/widths.png)",
        "",
        "One run of 20 s at 50 Hz from rest; standard errors with the design over those with the PRBS, geometric mean over",
        f"the free parameters and, in brackets, the worst of them. Target: a mean of at most {TARGET}.",
        "",
        "| robot | limits | expected | spread of fits | errors that fits report | parameters 10 % off |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, found in results.items():
        r = mean_ratio(found)
        lines.append(
            f"| {name} | {_limits(found['settings'])} | **{r['expected']:.2f}** ({r['expected_worst']:.2f}) | "
            f"{r['spread']:.2f} ({r['spread_worst']:.2f}) | {r['reported']:.2f} ({r['reported_worst']:.2f}) | {r['off']:.2f} |"
        )
    lines += [
        "",
        f"The spread is that of {' or '.join(map(str, counts))} output-error fits to data of the independent simulator "
        "(`reference/`), each with fresh",
        f"noise; each is itself known to about {sure:.0f} %. Parameters 10 % off: the ratio where every parameter differs by",
        "10 % from the value that the design was made for, up or down, the worse of two such sets.",
        "",
        "**The PRBS**: maximum length, on every input, all different, clock equal to the robot's rise time (63 % of a step",
        "response), and scaled to the design's energy (integral of the squared inputs). The limits on speed and floor space",
        "are not asked of it. Other rivals, expected geometric means:",
        "",
        "| robot | clock | energy [unit² s] | against the best of five clocks, same energy | against the PRBS at the limit"
        " of amplitude (its energy) |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, found in results.items():
        r = mean_ratio(found)
        lines.append(
            f"| {name} | {found['clock']:g} s | {found['energy']['design']:.0f} | {r['best_clock']:.2f} | {r['at_limit']:.2f} "
            f"({found['rivals']['energy_at_limit']:.0f}) |"
        )
    lines += ["", "What limits the designs, and what the independent simulator says of the limits:", ""]
    for name, found in results.items():
        used = ", ".join(f"{k} {v:.0%}" for k, v in found["monte_carlo"]["design"]["limits_used"].items())
        prbs = ", ".join(f"{k} {v:.0%}" for k, v in found["monte_carlo"]["prbs"]["limits_used"].items())
        seconds = found["processor_seconds"]["design"]
        lines.append(
            f"- {name}: {found['description']}, {found['tried']} inputs tried in {seconds:.0f} processor seconds. "
            f"Limits: {'; '.join(found['limited_by'])}. Used: {used} (PRBS: {prbs})."
        )
    for name, found in results.items():
        lines += ["", f"## {name}", ""]
        lines += [
            "| | value | PRBS: expected, spread | design: expected, spread | ratio: expected, spread | bias / expected error |",
            "| --- | --- | --- | --- | --- | --- |",
        ]
        e, mc = found["expected"], found["monte_carlo"]
        for i, (symbol, value) in enumerate(found["values"].items()):
            p, d = e["prbs"][i], e["design"][i]
            ps, ds = mc["prbs"]["spread"][i], mc["design"]["spread"][i]
            bias = (mc["design"]["mean"][i] - value) / d
            p_share, ps_share, d_share, ds_share = (f"{100 * x / abs(value):.2g} %" for x in (p, ps, d, ds))
            lines.append(
                f"| {symbol} | {value:.4g} {found['units'][symbol]} | {p_share}, {ps_share} | {d_share}, {ds_share} | "
                f"{d / p:.2f}, {ds / ps:.2f} | {bias:+.2f} |"
            )
    before = [name for name, found in results.items() if "run" not in found]
    if before:
        lines += ["", f"By earlier code than the others: {', '.join(before)}."]
    kept = np.concatenate(
        [
            np.array(found["monte_carlo"]["design"]["spread"]) / np.array(found["expected"]["design"])
            for found in results.values()
        ]
    )
    lines += [
        "",
        "## Where linearisation ends",
        "",
        "An input that balances a caster on the verge of flipping has sensitivities without end, where the smallest change of",
        "a parameter changes everything: true and worthless. So a candidate is also simulated with all parameters 10 % off, up",
        "and down; the least of the three log determinants counts, and it is out where the outputs are more than a fifth away",
        "from where the sensitivities put them. How well the designs keep what they promise: over all parameters and robots,",
        f"the spread of the fits is {min(kept):.2f} to {max(kept):.2f} times the expected error, {np.median(kept):.2f} in the",
        "median.",
        "",
    ]
    (DOCS / "design.md").write_text("\n".join(lines), encoding="utf-8")

"""The page of the study of false alarms: shares by noise, setting and robot, and the calibration curve."""

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy import stats

from benchmarks.sensor_noise import FAMILIES
from jaxid.report.style import HOUSE

Rows = Sequence[dict]
_SIZES = (0.5, 1.5, 3.0)
"""Between which sizes of what is hidden, in units of the noise, are rows of the table."""


def wilson(hits: int, cases: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    found = stats.binomtest(hits, cases).proportion_ci(0.95, method="wilson")
    return float(found.low), float(found.high)


def share(hits: int, cases: int) -> str:
    """Such as "3 of 120: 2.5 % (0.9 to 7.1 %)"."""
    if not cases:
        return "none run"
    low, high = wilson(hits, cases)
    return f"{hits} of {cases}: {100 * hits / cases:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"


def _family(row: dict) -> str:
    return next((name for name, kinds in FAMILIES.items() if row["kind"] in kinds), row["kind"])


def _table(rows: Rows, of: Callable[[dict], str], head: str, order: Sequence[str] = ()) -> str:
    names = [name for name in order if any(of(row) == name for row in rows)] or sorted({of(row) for row in rows})
    lines = [
        f"| {head} | called incomplete | median held-out error, in units of the noise seen |",
        "| --- | --- | --- |",
    ]
    for name in names:
        own = [row for row in rows if of(row) == name]
        middle = float(np.median([row["normalised_rms"] for row in own]))
        lines.append(f"| {name} | {share(sum(row['alarm'] for row in own), len(own))} | {middle:.2f} |")
    return "\n".join(lines)


def _calibration(rows: Rows, levels: Sequence[float]) -> str:
    white = [row for row in rows if _family(row) == "white"]
    coloured = [row for row in rows if _family(row) == "coloured"]
    lines = ["| level | all | white | coloured |", "| --- | --- | --- | --- |"]
    for level in levels:
        each = [share(sum(row["alarms"][str(level)] for row in own), len(own)) for own in (rows, white, coloured)]
        lines.append(f"| {100 * level:g} % | {' | '.join(each)} |")
    return "\n".join(lines)


@plt.rc_context(HOUSE)
def _curve(rows: Rows, levels: Sequence[float], path: Path) -> None:
    """Share of complete models called incomplete against the level asked for."""
    hits = [sum(row["alarms"][str(level)] for row in rows) for level in levels]
    low, high = np.array([wilson(hit, len(rows)) for hit in hits]).T
    figure, axes = plt.subplots(figsize=(4.5, 3.6), layout="constrained")
    shares = np.array(hits) / len(rows)
    axes.errorbar(levels, shares, [shares - low, high - shares], fmt="o", capsize=3, label="found (95 %)")
    axes.plot(levels, levels, color="0.6", label="asked for")
    axes.set(xscale="log", yscale="log", xlabel="level asked for", ylabel="complete models called incomplete")
    axes.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _hidden(rows: Rows) -> str:
    def seen(own: Rows) -> str:
        return share(sum(row["alarm"] for row in own), len(own))

    lines = ["| noise | hidden size, in units of the noise | seen |", "| --- | --- | --- |"]
    for name in FAMILIES:
        for low, high in itertools.pairwise(_SIZES):
            own = [row for row in rows if _family(row) == name and low <= row["strength"] < high]
            if own:
                lines.append(f"| {name} | {low:g} to {high:g} | {seen(own)} |")
    lines.append(f"| all | {_SIZES[0]:g} to {_SIZES[-1]:g} | {seen(rows)} |")
    return "\n".join(lines)


def write(rows: Rows, hidden: Rows, levels: Sequence[float], settings: Sequence[str], page: Path) -> None:
    """The page and its picture."""
    _curve(rows, levels, page.with_suffix("") / "calibration.png")
    missed = "\n".join(
        f"- {row['number']}: {row['robot']}, {row['setting']}, {row['kind']} (p = {row['p_value']:.2g}; {row['why']})"
        for row in rows
        if row["alarm"]
    )
    unseen = "\n".join(
        f"- {row['number']}: {row['robot']}, {row['setting']}, {row['kind']}, {row['hidden']}, {row['strength']:.1f} x noise "
        f"({row['why']})"
        for row in hidden
        if not row["alarm"]
    )
    codes = sorted({row["code"] for row in [*rows, *hidden]})
    text = f"""# Are complete models called incomplete?

Written by `python -m benchmarks.false_alarms --report` from what that command ran: {len(rows)} cases of complete models and
{len(hidden)} in which something is hidden (by the code of {", ".join(codes)}). The independent simulator of
`reference/` moves robots whose model lacks nothing; `benchmarks/sensor_noise.py` adds a sensor's noise, of a standard
deviation of 0.5 to 5 % of the signals' root mean square; the logs are fitted and looked at as `explain` does. Whatever is
then called missing, or left open, is a false alarm. Kinds of noise take turns; robot, setting, constants and size of the
noise are drawn. Shares with Wilson's 95 % intervals; the level is 1 %. Cases of this draw were looked at while the tests were
made; `--seed N` draws others, into a file of their own.

{_table(rows, _family, "noise", list(FAMILIES))}

By setting:

{_table(rows, lambda row: row["setting"], "logs", settings)}

By robot:

{_table(rows, lambda row: row["robot"], "robot")}

By kind of noise:

{_table(rows, lambda row: row["kind"], "kind", [kind for kinds in FAMILIES.values() for kind in kinds])}

## Calibration

`explain(..., false_alarm=0.01)` and `jaxid explain --false-alarm 0.01` set the level. The same cases at others:

{_calibration(rows, levels)}

![Level asked for and share found](false_alarms/calibration.png)

Complete models that were called incomplete:

{missed or "none"}

## Does the noise hide what is missing?

The same with a force or a filter that the model lacks, whose trace on the held-out logs, once the fit has absorbed what it can,
is {_SIZES[0]:g} to {_SIZES[-1]:g} times the noise. Seen is every case in which something is called missing, named or not,
or left open.

{_hidden(hidden) if hidden else "not run"}

Not seen:

{unseen or "none"}
"""
    page.write_text(text, encoding="utf-8")

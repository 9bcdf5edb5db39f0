"""docs/methods.md from the figures of `benchmarks.methods`: every conclusion is worked out from them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

_HEAD = """# Which method when?

Written by `python -m benchmarks.methods` (`--only NAME --fits N` runs some cells): as many realisations of every noise as
the table says, two runs of 10 s at 50 Hz, simulated by Euler-Maruyama steps of half a millisecond (nothing of jaxid in it),
and fitted by all four methods, which have the same result object and stand side by side in `jaxid.compare(...)` and
`jaxid fit --method`.

**Bias**: worst parameter, in standard deviations of one fit ({fits} fits, the fewest here, know it to ±{bias:.2f}).
**Error**: root mean square, mean over the parameters, in units of the best method's. **Covers**: share of the 95 % intervals
that hold the truth, all parameters, and the worst one ({fits} fits know one parameter's to ±{half:.0f} %). Judged are
parameters at least four standard deviations from their bounds.

| robot | noise, fits | method | bias | error | covers % | worst |
| --- | --- | --- | --- | --- | --- | --- |
"""
_NAMES = {
    "integral_least_squares": "integral least squares",
    "instrumental_variables": "instrumental variables",
    "output_error": "output error",
    "prediction_error": "prediction error",
}
_KINDS = {
    "white noise of the sensors": lambda noise: "AR(1)" not in noise and "disturbed" not in noise,
    "slow noise of the sensors": lambda noise: "AR(1)" in noise,
    "sensors' noise and disturbed motion": lambda noise: "disturbed" in noise,
}
_SAME = 1.05
"""Ratio of errors up to which two methods are as good."""
_LEAST = 0.93
"""Coverage of a 95 % interval that is aimed at, or more."""
_SAYS = """
**Results say it themselves** (`fit.judgement.better`). Of every hundred results of this study, in percent:

| noise | robot | least squares names others for its regressors | output error names prediction error | and is not sound |
| --- | --- | --- | --- | --- |
"""
_END = """
Slow noise of a sensor and a disturbance of the motion look alike in the residual of a simulation. Where output error names
prediction error, it therefore says what holds in either case; a log of the robot at rest tells them apart. Of the four,
integral least squares alone needs no start values, and the others take theirs from it; the two linear methods need measured
speeds and parameters that enter linearly. What prediction error is: [its page](prediction_error.md). Variance and coverage
against the Cramér-Rao bound: [docs/uncertainty.md](uncertainty.md).
"""


def _found(row: Mapping[str, Any], method: str) -> tuple[float, float, np.ndarray]:
    """Worst bias, mean error and every coverage of a method's judged parameters."""
    judged, found = np.array(row["judged"]), row["methods"][method]
    bias = np.abs(np.array(found["bias"]))[judged].max()
    return float(bias), float(np.array(found["error_over_least"])[judged].mean()), np.array(found["coverage"])[judged]


def _range(values: Sequence[float], digits: int = 1) -> str:
    low, high = (f"{value:.{digits}f}" for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:-1]) + (" or " if len(names) > 1 else "") + names[-1]


def conclusion(rows: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[str]]:
    """Methods as good as the best by their error on these cells (`_SAME`), the best first, and those of all methods whose
    intervals hold the truth too seldom: less than `_LEAST` in the mean of some cell, by more than chance (one standard error
    of a share per fit: parameters of one fit go together)."""
    errors = {method: float(np.mean([_found(row, method)[1] for row in rows])) for method in _NAMES}
    good = [
        method for method in sorted(errors, key=errors.__getitem__) if errors[method] <= _SAME * min(errors.values())
    ]
    chance = {id(row): np.sqrt(_LEAST * (1 - _LEAST) / row["fits"]) for row in rows}
    seldom = [m for m in _NAMES if any(_found(row, m)[2].mean() < _LEAST - chance[id(row)] for row in rows)]
    return good, seldom


def _conclusions(rows: Sequence[Mapping[str, Any]]) -> str:
    text = "\n**What it says**, worked out from the table. Smallest error: methods within 5 % of the best, cells together.\n\n"
    text += "| noise | cells | smallest error | the others' error, times the best's | largest bias | intervals too short |\n"
    text += "| --- | --- | --- | --- | --- | --- |\n"
    for kind, of in _KINDS.items():
        own = [row for row in rows if of(row["noise"])]
        if not own:
            continue
        good, seldom = conclusion(own)
        others = [f"{_NAMES[m]} {_range([_found(row, m)[1] for row in own])}" for m in _NAMES if m not in good]
        biases = {m: max(_found(row, m)[0] for row in own) for m in _NAMES}
        worst = max(biases, key=biases.__getitem__)
        short = [f"{_NAMES[m]} ({_range([100 * _found(row, m)[2].mean() for row in own], 0)} %)" for m in seldom]
        text += f"| {kind} | {len(own)} | **{_listed([_NAMES[m] for m in good])}** | {', '.join(others) or 'none'} "
        text += f"| {biases[worst]:.1f} ({_NAMES[worst]}) | {', '.join(short) or 'none'} |\n"
    return text


def write_page(rows: list[dict], path: Path, missing: Sequence[str] = ()) -> None:
    """The tables and what they say; `missing` are cells of the study that have not been run."""
    fits = min(row["fits"] for row in rows)
    text = _HEAD.format(fits=fits, bias=1.96 / fits**0.5, half=196 * (0.95 * 0.05 / fits) ** 0.5)
    for row in rows:
        for number, method in enumerate(row["methods"]):
            bias, error, cover = _found(row, method)
            where = (row["robot"], f"{row['noise']}, {row['fits']}") if number == 0 else ("", "")
            text += f"| {where[0]} | {where[1]} | {_NAMES[method]} | {bias:.2f} | {error:.2f} "
            text += f"| {100 * cover.mean():.1f} | {100 * cover.min():.0f} |\n"
    if missing:
        text += f"\nNot run yet: {'; '.join(missing)}.\n"
    text += _conclusions(rows) + _SAYS
    for row in rows:
        said = row["methods"]
        text += (
            f"| {row['noise']} | {row['robot']} "
            f"| {100 * said['integral_least_squares']['name_instruments_or_output_error']:.0f} "
            f"| {100 * said['output_error']['name_prediction_error']:.0f} | {100 * said['output_error']['not_sound']:.0f} |\n"
        )
    newest = max(rows, key=lambda row: row.get("run", ""))
    old = [f"{row['robot']}, {row['noise']}" for row in rows if row.get("code") != newest.get("code")]
    if old:
        text += f"\nRun with other code of the estimators than the newest cell: {'; '.join(old)}.\n"
    path.write_text(text + _END, encoding="utf-8")

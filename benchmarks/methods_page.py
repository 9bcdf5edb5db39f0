"""docs/methods.md from the figures of `benchmarks.methods`."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

_HEAD = """# Which method when?

Written by `python -m benchmarks.methods` (`--only NAME --fits N` runs some cells): as many realisations of every noise as
the table says, two runs of 10 s at 50 Hz, simulated by Euler-Maruyama steps of half a millisecond (nothing of jaxid in it),
and fitted by all four methods, which have the same result object and stand side by side in `jaxid.compare(...)` and
`jaxid fit --method`.

**Bias**: worst parameter, in standard deviations of one fit ({fits} fits, the fewest here, know it to ±{bias:.2f}).
**Error**: root mean square, mean over the parameters, in units of the best method's. **Covers**: share of the 95 % intervals
that hold the truth, all parameters, and the worst one. Judged are parameters at least four standard deviations from their
bounds.

| robot | noise, fits | method | bias | error | covers % | worst |
| --- | --- | --- | --- | --- | --- | --- |
"""
_NAMES = {
    "integral_least_squares": "integral least squares",
    "instrumental_variables": "instrumental variables",
    "output_error": "output error",
    "prediction_error": "prediction error",
}
_TAIL = """
**What it says.** Where all noise is on the sensors, output error has the smallest error, and prediction error, which finds no
disturbance then, says the same later. Integral least squares has {ls_error} times its error (stretches of half a second
forget what the whole record says) and is biased by up to {ls} standard deviations;
instrumental variables have {iv_error} times its error and a bias of at most {iv}. Where the motion is
disturbed, prediction error has the smallest error and the truest intervals; the others are {others} times as far off. Slow
noise of a sensor is what prediction error takes for a disturbance: there it is up to {pe} times as far off as output
error, which takes it for what it is.

| you have | take |
| --- | --- |
| no start values, or want a first look | integral least squares, then what it names |
| a model that is linear in its parameters, and noisy speeds | instrumental variables |
| noise on the sensors, white or coloured; effects of any kind | output error |
| motion that is disturbed, drifts or is unstable | prediction error ([its page](prediction_error.md)) |

**Results say it themselves** (`fit.judgement.better`). Of every hundred results of this study, in percent:

| noise | robot | least squares names others for its regressors | output error names prediction error | and is not sound |
| --- | --- | --- | --- | --- |
"""
_END = """
Slow noise of a sensor and a disturbance of the motion look alike in the residual of a simulation. Output error therefore
names both, and what to do in either case; a log of the robot at rest tells them apart.

Variance and coverage against the Cramér-Rao bound, with more realisations: [docs/uncertainty.md](uncertainty.md).
"""


def _range(values: list[float]) -> str:
    return f"{min(values):.1f} to {max(values):.1f}"


def write_page(rows: list[dict], path: Path, missing: Sequence[str] = ()) -> None:
    """The tables and what they say; `missing` are cells of the study that have not been run."""
    fits = min(row["fits"] for row in rows)
    text = _HEAD.format(fits=fits, bias=1.96 / fits**0.5)
    bias_of: dict[str, list[float]] = {method: [] for method in _NAMES}
    quiet: dict[str, list[float]] = {method: [] for method in _NAMES}
    stirred: list[float] = []
    for row in rows:
        judged = np.array(row["judged"])
        for number, (method, found) in enumerate(row["methods"].items()):
            bias = np.abs(np.array(found["bias"]))[judged].max()
            error = np.array(found["error_over_least"])[judged].mean()
            cover = 100 * np.array(found["coverage"])[judged]
            bias_of[method].append(bias)
            if "disturbed" not in row["noise"]:
                quiet[method].append(error)
            elif method != "prediction_error":
                stirred.append(error)
            where = (row["robot"], f"{row['noise']}, {row['fits']}") if number == 0 else ("", "")
            text += f"| {where[0]} | {where[1]} | {_NAMES[method]} | {bias:.2f} | {error:.2f} "
            text += f"| {cover.mean():.1f} | {cover.min():.0f} |\n"
    if missing:
        text += f"\nNot run yet: {'; '.join(missing)}.\n"
    text += _TAIL.format(
        ls_error=_range(quiet["integral_least_squares"]),
        iv_error=_range(quiet["instrumental_variables"]),
        ls=f"{max(bias_of['integral_least_squares']):.1f}",
        iv=f"{max(bias_of['instrumental_variables']):.1f}",
        others=_range(stirred),
        pe=f"{max(quiet['prediction_error']):.1f}",
    )
    for row in rows:
        said = row["methods"]
        text += (
            f"| {row['noise']} | {row['robot']} "
            f"| {100 * said['integral_least_squares']['name_instruments_or_output_error']:.0f} "
            f"| {100 * said['output_error']['name_prediction_error']:.0f} | {100 * said['output_error']['not_sound']:.0f} |\n"
        )
    old = [
        f"{row['robot']}, {row['noise']}" for row in rows if "biased" not in row["methods"]["integral_least_squares"]
    ]
    if old:
        text += (
            "\nWhat least squares names is of earlier code, before it predicted its bias, in these cells, which have not been "
            f"run again since: {'; '.join(old)}.\n"
        )
    path.write_text(text + _END, encoding="utf-8")

"""docs/methods.md from the figures of `benchmarks.methods`."""

from pathlib import Path

import numpy as np

_HEAD = """# Which method when?

Written by `python -m benchmarks.methods`: {fits} realisations of every noise, two runs of 10 s at 50 Hz, simulated by
Euler-Maruyama steps of half a millisecond (nothing of jaxid in it), and fitted by all four methods, which have the same
result object and stand side by side in `jaxid.compare(...)` and `jaxid fit --method`.

**Bias**: worst parameter, in standard deviations of one fit ({fits} fits know it to ±{bias:.2f}). **Error**: root mean square,
mean over the parameters, in units of the best method's. **Covers**: share of the 95 % intervals that hold the truth, all
parameters, and the worst one. Judged are parameters at least four standard deviations from their bounds.

| robot | noise | method | bias | error | covers % | worst |
| --- | --- | --- | --- | --- | --- | --- |
"""
_NAMES = {
    "integral_least_squares": "integral least squares",
    "instrumental_variables": "instrumental variables",
    "output_error": "output error",
    "prediction_error": "prediction error",
}
_TAIL = """
**What it says.** Where all noise is on the sensors, output error has the smallest error; prediction error finds no
disturbance then and says the same, later. Integral least squares and instrumental variables have {linear} times its error,
since they begin anew wherever something stands still. Noise in the regressors biases least squares by up to {ls} standard
deviations, instrumental variables by up to {iv}. Where the motion is disturbed, prediction error has the smallest error, and
the others' reported intervals are to be read with that in mind.

| you have | take |
| --- | --- |
| no start values; a first look; an embedded computer | integral least squares, then whatever it names |
| a model linear in its parameters, noisy speeds, no wish to iterate over simulations | instrumental variables |
| noise on the sensors, white or coloured; effects of any kind; several optima | output error |
| motion that is disturbed (floor, slip, gears), drifts or is unstable | prediction error ([docs/prediction_error.md](prediction_error.md)) |

**Results say it themselves** (`fit.judgement.better`). In this study, of every hundred results:

| noise | robot | least squares name IV or output error | output error names prediction error | output error is not called sound |
| --- | --- | --- | --- | --- |
"""
_END = """
Coloured noise of a sensor and a disturbance of the motion look alike in the residual of a simulation; the sentence is
advice to look, and `fit.disturbance` of prediction error then tells which of the two it is.

Variance and coverage against the Cramér-Rao bound, with more realisations: [docs/uncertainty.md](uncertainty.md).
"""


def write_page(rows: list[dict], path: Path) -> None:
    """The tables and what they say."""
    fits = min(row["fits"] for row in rows)
    text = _HEAD.format(fits=fits, bias=1.96 / fits**0.5)
    worst: dict[str, list[float]] = {method: [] for method in _NAMES}
    linear = []
    for row in rows:
        judged = np.array(row["judged"])
        for number, (method, found) in enumerate(row["methods"].items()):
            bias = np.abs(np.array(found["bias"]))[judged].max()
            error = np.array(found["error_over_least"])[judged].mean()
            cover = 100 * np.array(found["coverage"])[judged]
            worst[method].append(bias)
            if method in ("integral_least_squares", "instrumental_variables") and "disturbed" not in row["noise"]:
                linear.append(error)
            where = (row["robot"], row["noise"]) if number == 0 else ("", "")
            text += f"| {where[0]} | {where[1]} | {_NAMES[method]} | {bias:.2f} | {error:.2f} "
            text += f"| {cover.mean():.1f} | {cover.min():.0f} |\n"
    text += _TAIL.format(
        linear=f"{min(linear):.1f} to {max(linear):.1f}",
        ls=f"{max(worst['integral_least_squares']):.1f}",
        iv=f"{max(worst['instrumental_variables']):.1f}",
    )
    for row in rows:
        said = row["methods"]
        text += (
            f"| {row['noise']} | {row['robot']} "
            f"| {100 * said['integral_least_squares']['name_instruments_or_output_error']:.0f} "
            f"| {100 * said['output_error']['name_prediction_error']:.0f} | {100 * said['output_error']['not_sound']:.0f} |\n"
        )
    path.write_text(text + _END, encoding="utf-8")

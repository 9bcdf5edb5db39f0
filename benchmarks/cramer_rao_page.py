"""docs/uncertainty.md from the figures of `benchmarks.cramer_rao`."""

from pathlib import Path

from scipy import stats

_HEAD = """# Are the uncertainties true? Linear methods or output error?

Written by `python -m benchmarks.cramer_rao` (`--only NAME --fits N --linear M` runs some of the rows, with more or fewer
fits by output error and by the linear methods). Every row is a right model with many realisations of the noise.
**Variance / bound**: scatter of the estimates over the Cramér-Rao bound, mean over the parameters (1 is the best that any
unbiased estimator can do). **Bias**: the worst parameter's, in standard deviations of one fit. **Covers**: share of the
reported 95 % intervals that hold the truth, lowest and highest parameter. Judged are parameters at least four standard
errors from their bounds; the others are named. With {fits:,} fits, a coverage of 95 % is itself known to ±{half:.1f} % and a
variance ratio of one parameter to ±{ratio:.0f} %; rows with more fits know it better. A coverage from {linear} fits by the
linear methods is known to ±{linear_half:.1f} %. Rows of one robot with as
many samples see the same draws of unit noise, so that chance moves them together.

{header}
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""

_LOW, _HIGH = 0.94, 0.96
_TARGET = (0.93, 0.97)
_CHANCE = 0.05
"""Probability of a share as far out as found at which chance is no longer blamed."""

_TAIL = """
**All intervals of output error together** (white noise): mean coverage {mean:.1f} % over {number} parameters in {settings}
settings. {inside} lie within 94 to 96 %; {chance} outside, but no farther than chance puts them ({probability:.0f} % of
the time, at 94 or 96 %); {beyond}.

**Which one?** Output error: with white noise its variance is {oe} times the bound, and its intervals hold the truth in
{oe_cover} % of the fits. Integral least squares (LS) needs no start values and no iterations, which makes it the start for
the others. By itself it has {ls} times the bound's variance, {ls_low} at the lowest noises; its bias is up to {ls_bias}
standard deviations and its intervals hold the truth in {ls_cover} %.
Instrumental variables (IV) have {iv} times the bound's variance, a bias of at most {iv_bias} standard deviations, and
intervals that hold the truth in {iv_cover} % of the fits, {iv_mean:.1f} % over all parameters and settings with white noise;
in every row {iv_converged} % of the fits converge or more. {iv_low} of {iv_number} intervals of IV hold the truth
in fewer and {iv_high} in more than 93 to 97 % of the fits, beyond chance ({probability:.0f} %): {iv_beyond}.
An integral least-squares result says itself which parameters noise in its regressors moves by more than half a standard
error, and names IV and output error. Which method suits which noise: [docs/methods.md](methods.md).

With coloured noise the bound of the table is that of white noise of the same variance, so that the variance ratio is above
one by what the colour takes away; the intervals of output error there are those of
`covariance="robust"`, which a fit takes by itself where its residual is not white. Instrumental variables' intervals hold
the truth in {iv_coloured} % of the fits there.
"""


def _range(values: list[float], factor: float = 1.0, digits: int = 2) -> str:
    return f"{factor * min(values):.{digits}f} to {factor * max(values):.{digits}f}"


def _ranges(rows: list[dict], method: str) -> tuple[str, str, str]:
    """Variance ratio, coverage and largest bias over all settings with white noise."""
    found = [row[method] for row in rows if "AR(1)" not in row["setting"] and method in row]
    cover = [f["coverage"][end] for f in found for end in ("lowest", "highest")]
    worst = max(f["bias_in_standard_errors"]["worst"] for f in found)
    return _range([f["variance_over_bound"]["mean"] for f in found]), _range(cover, 100, 1), f"{worst:.1f}"


_HEADER = " | ".join(
    ["setting", "fits", "judged", "**output error**: variance / bound", "bias", "covers %", "linear fits"]
    + ["**LS**: variance / bound", "bias", "covers %", "**IV**: variance / bound", "bias", "covers %"]
)


def _linear(rows: list[dict]) -> dict[str, object]:
    """What instrumental variables do over all settings with white noise."""
    white = [row for row in rows if "AR(1)" not in row["setting"] and "instrumental_variables" in row]
    shares = [
        share
        for row in white
        for share, judged in zip(row["instrumental_variables"]["coverage"]["each"], row["judged"], strict=True)
        if judged
    ]
    coloured = [
        row["instrumental_variables"]["coverage"][end]
        for row in rows
        if "AR(1)" in row["setting"] and "instrumental_variables" in row
        for end in ("lowest", "highest")
    ]
    out: dict[str, list[str]] = {"low": [], "high": []}
    for row in white:
        own = row["instrumental_variables"]
        for name, share, judged in zip(row["parameters"], own["coverage"]["each"], row["judged"], strict=True):
            held, fits = round(share * own["fits"]), own["fits"]
            if judged and stats.binom.cdf(held, fits, _TARGET[0]) < _CHANCE:
                out["low"].append(f'{name} in "{row["setting"]}" {100 * share:.1f} %')
            elif judged and stats.binom.sf(held - 1, fits, _TARGET[1]) < _CHANCE:
                out["high"].append(f'{name} in "{row["setting"]}" {100 * share:.1f} %')
    iv, cover, bias = _ranges(rows, "instrumental_variables")
    converged = [row["instrumental_variables"]["converged"] for row in white]
    return {
        "iv": iv,
        "iv_cover": cover,
        "iv_bias": bias,
        "iv_coloured": _range(coloured, 100, 1),
        "iv_number": len(shares),
        "iv_low": len(out["low"]),
        "iv_high": len(out["high"]),
        "iv_beyond": ", ".join(out["low"] + out["high"]) or "none",
        "iv_mean": 100 * sum(shares) / len(shares),
        "iv_converged": f"{100 * min(converged):.0f}",
    }


def _together(rows: list[dict]) -> dict[str, object]:
    """How many of output error's intervals hold the truth as often as they say, all settings with white noise."""
    inside, chance, beyond, all_of_them = 0, 0, [], []
    white = [row for row in rows if "AR(1)" not in row["setting"]]
    for row in white:
        fits, each = row["output_error"]["fits"], row["output_error"]["coverage"]["each"]
        for name, share, judged in zip(row["parameters"], each, row["judged"], strict=True):
            if not judged:
                continue
            all_of_them.append(share)
            held = round(share * fits)
            low, high = stats.binom.cdf(held, fits, _LOW), stats.binom.sf(held - 1, fits, _HIGH)
            if _LOW <= share <= _HIGH:
                inside += 1
            elif min(low, high) > _CHANCE:
                chance += 1
            else:
                beyond.append(f'{name} in "{row["setting"]}" {100 * share:.1f} %')
    return {
        "mean": 100 * sum(all_of_them) / len(all_of_them),
        "number": len(all_of_them),
        "settings": len(white),
        "inside": inside,
        "chance": chance,
        "probability": 100 * _CHANCE,
        "beyond": f"farther out: {', '.join(beyond)}" if beyond else "none farther out",
    }


def _cells(figures: dict | None) -> str:
    if figures is None:
        return "| | | "
    coverage = figures["coverage"]
    return (
        f"| {figures['variance_over_bound']['mean']:.2f} | {figures['bias_in_standard_errors']['worst']:.2f} "
        f"| {100 * coverage['lowest']:.1f} to {100 * coverage['highest']:.1f} "
    )


def write_page(rows: list[dict], path: Path) -> None:
    """The table and what it says."""
    fits = min(row["output_error"]["fits"] for row in rows)
    linear = min(row["instrumental_variables"]["fits"] for row in rows if "instrumental_variables" in row)
    text = _HEAD.format(
        fits=fits, half=196 * (0.95 * 0.05 / fits) ** 0.5, ratio=196 * (2 / fits) ** 0.5,
        linear=linear, linear_half=196 * (0.95 * 0.05 / linear) ** 0.5, header=f"| {_HEADER} |",
    )  # fmt: skip
    for row in rows:
        left = [name for name, judged in zip(row["parameters"], row["judged"], strict=True) if not judged]
        judged = f"{len(row['parameters']) - len(left)}" + (f" (not {', '.join(left)})" if left else "")
        text += f"| {row['setting']} | {row['output_error']['fits']:,} | {judged} "
        own = row.get("instrumental_variables")
        linear_fits = dict.fromkeys(
            row[method]["fits"] for method in ("least_squares", "instrumental_variables") if own
        )
        text += (
            f"{_cells(row['output_error'])}| {' (LS), '.join(map(str, linear_fits))}{' (IV)' * (len(linear_fits) > 1)} "
        )
        text += f"{_cells(row.get('least_squares'))}{_cells(own)}|\n"
    oe, oe_cover, _ = _ranges(rows, "output_error")
    ls, ls_cover, ls_bias = _ranges(rows, "least_squares")
    ls_low, _, _ = _ranges([row for row in rows if "noise x0." in row["setting"]], "least_squares")
    text += _TAIL.format(
        oe=oe,
        oe_cover=oe_cover,
        ls=ls,
        ls_low=ls_low,
        ls_cover=ls_cover,
        ls_bias=ls_bias,
        **_linear(rows),
        **_together(rows),
    )
    figured = [row for row in rows if "instrumental_variables" in row]
    newest = max((row["instrumental_variables"].get("run", "") for row in figured), default="")
    old = [row["setting"] for row in figured if newest and "run" not in row["instrumental_variables"]]
    if old:
        text += f"\nIV's figures of these rows are of earlier code than those of the others: {'; '.join(old)}.\n"
    path.write_text(text, encoding="utf-8")

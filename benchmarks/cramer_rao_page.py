"""docs/uncertainty.md from the figures of `benchmarks.cramer_rao`."""

from pathlib import Path

from scipy import stats

_HEAD = """# Are the uncertainties true? Least squares or output error?

Written by `python -m benchmarks.cramer_rao` (`--only NAME --fits N` runs some of the rows, with more or fewer fits). Every
row is a right model with many realisations of the noise, all fitted in one compiled batch. **Variance / bound**: scatter of
the estimates over the Cramér-Rao bound, mean over the parameters (1 is the best that any unbiased estimator can do).
**Bias**: the worst parameter's, in standard deviations of one fit. **Covers**: share of the reported 95 % intervals that
hold the truth, lowest and highest parameter. Judged are parameters at least four standard errors from their bounds; the
others are named. With {fits:,} fits, a coverage of 95 % is itself known to ±{half:.1f} % and a variance ratio of one
parameter to ±{ratio:.0f} %; rows with more fits know it better.

| setting | fits | judged | **output error**: variance / bound | bias | covers % | **LS**: variance / bound | bias | covers % |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""

_LOW, _HIGH = 0.94, 0.96
_CHANCE = 0.05
"""Probability of a share as far out as found at which chance is no longer blamed."""

_TAIL = """
**All intervals of output error together** (white noise): mean coverage {mean:.1f} % over {number} parameters in {settings}
settings. {inside} lie within 94 to 96 %; {chance} outside, but no farther than chance puts them ({probability:.0f} % of
the time, at 94 or 96 %); {beyond}.

**Which one?** Output error: with white noise its variance is {oe} times the bound, and its intervals hold the truth in
{oe_cover} % of the fits. Integral least squares needs no start values and no iterations, which makes it the start for output
error. By itself it has {ls} times the bound's variance, at low noise too, since stretches of half a second
forget what the whole record says; its bias is up to {ls_bias} standard deviations and its intervals hold the truth in
{ls_cover} %.

With coloured noise the bound of the table is that of white noise of the same variance, so that the variance ratio is above
one by what the colour takes away; the intervals of output error there are those of
`covariance="robust"`, which a fit takes by itself where its residual is not white.
"""


def _range(values: list[float], factor: float = 1.0, digits: int = 2) -> str:
    return f"{factor * min(values):.{digits}f} to {factor * max(values):.{digits}f}"


def _ranges(rows: list[dict], method: str) -> tuple[str, str, str]:
    """Variance ratio, coverage and largest bias over all settings with white noise."""
    found = [row[method] for row in rows if "AR(1)" not in row["setting"] and method in row]
    cover = [f["coverage"][end] for f in found for end in ("lowest", "highest")]
    worst = max(f["bias_in_standard_errors"]["worst"] for f in found)
    return _range([f["variance_over_bound"]["mean"] for f in found]), _range(cover, 100, 1), f"{worst:.1f}"


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
    text = _HEAD.format(fits=fits, half=196 * (0.95 * 0.05 / fits) ** 0.5, ratio=196 * (2 / fits) ** 0.5)
    for row in rows:
        left = [name for name, judged in zip(row["parameters"], row["judged"], strict=True) if not judged]
        judged = f"{len(row['parameters']) - len(left)}" + (f" (not {', '.join(left)})" if left else "")
        text += f"| {row['setting']} | {row['output_error']['fits']:,} | {judged} "
        text += f"{_cells(row['output_error'])}{_cells(row.get('least_squares'))}|\n"
    oe, oe_cover, _ = _ranges(rows, "output_error")
    ls, ls_cover, ls_bias = _ranges(rows, "least_squares")
    text += _TAIL.format(oe=oe, oe_cover=oe_cover, ls=ls, ls_cover=ls_cover, ls_bias=ls_bias, **_together(rows))
    path.write_text(text, encoding="utf-8")

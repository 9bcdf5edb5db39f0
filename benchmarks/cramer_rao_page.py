"""docs/uncertainty.md from the figures of `benchmarks.cramer_rao`."""

from pathlib import Path

_HEAD = """# Are the uncertainties true? Least squares or output error?

Written by `python -m benchmarks.cramer_rao`. Every row is a right model with many realisations of the noise, all fitted in
one compiled batch. **Variance / bound**: scatter of the estimates over the Cramér-Rao bound, mean over the parameters (1 is
the best that any unbiased estimator can do). **Bias**: the worst parameter's, in standard deviations of one fit.
**Coverage**: share of the reported 95 % intervals that hold the truth, lowest and highest parameter. Judged are parameters
at least four standard errors from their bounds; the others are named. With {fits} fits, a coverage of 95 % is itself known
to ±{half:.1f} % and a variance ratio of one parameter to ±{ratio:.0f} %.

| setting | judged | **output error**: variance / bound | bias | coverage % | **LS**: variance / bound | bias | coverage % |
| --- | --- | --- | --- | --- | --- | --- | --- |
"""

_TAIL = """
**Which one?** Output error, where its numbers matter: it sits on the bound and its intervals say what they mean. Integral
least squares needs no start values and no iterations, and at low noise it is nearly as good; as noise grows its regressors,
which are measured speeds, bias it by many of its standard errors, and no interval of its own can know that.

With coloured noise the bound of the table is that of white noise of the same variance, so that the variance ratio is above
one by what the colour takes away; the intervals there are those of `covariance="robust"`.
"""


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
        text += f"| {row['setting']} | {judged} {_cells(row['output_error'])}{_cells(row.get('least_squares'))}|\n"
    path.write_text(text + _TAIL, encoding="utf-8")

"""docs/speed.md from the results of `benchmarks/fit.py`."""

from typing import Any

_PAGE = """# Speed

Written by `python -m benchmarks.fit`; the numbers are those of one run on {processor} ({cores} cores, load {load:.1f}
at the start, one core a rival; jax {jax}, optimistix {optimistix}, SciPy {scipy}, numba {numba}).

## One output-error fit

Eight experiments of 1,000 samples at 50 Hz on the coupled Pioneer with true dry friction, four sub-steps between
samples, float64; unknown are seven physical parameters and three initial states of every experiment: 16,000 residuals,
31 unknowns. Start 10-20 % off. Every rival minimises the same cost with the same integrator and sees the same data.
Seconds are processor seconds of one thread, which other work on the machine disturbs least; elapsed seconds are in
brackets.

{table}

- *First* compiles, in a fresh process without a compilation cache (imports not counted); *tenth* is warm, on new data
  of the same shape (median of up to three, rivals alternating).
- *Cost* is half chi-squared at the point reached, evaluated by one simulator for all. Only rows whose costs agree
  within {same} stopped at the same optimum; the others stand in the table but are not compared.
- *To its own*, *to the best*: when a rival first stood within {close} of the cost at which it stopped itself, and of
  the lowest cost any of them reached (stopping rules set aside; - where it never did, or where the solver does not show
  its path).
- Dry friction makes the cost slightly rough, so that solvers stop in neighbouring dips.
- `output_error` with estimated initial states does more than the row "jaxid": it searches the caster's initial angle
  globally and estimates the noise too. With a known start it fits 7 unknowns instead of 31: another problem, and on
  these logs (caster up to 0.1 rad off) not a matching one.

{verdict}

## Six logs, both ways, from a cold process

The six fit logs of `jaxid/demo_logs/pioneer` (25 s each), read and fitted by integral least squares and then by output
error (eight parameters) in a new process: {cold:.1f} s elapsed, {cold_processor:.1f} s of processor time (median of
{runs}).

{stages}
"""


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _table(rows: list[dict[str, Any]]) -> str:
    lines = [
        "| | first fit | tenth fit | linearisations | cost | to its own | to the best | tenth / jaxid's |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        stopped = "" if "not converged" not in row["reason"] else ", not converged"
        cells = (
            row["name"],
            f"{row['first']:.1f} ({row['first_wall']:.1f})",
            f"{row['tenth']:.2f} ({row['tenth_wall']:.2f})",
            f"{row['linearisations']}{stopped}",
            f"{row['cost']:.2f}",
            _seconds(row["to_its_optimum"]),
            _seconds(row["to_best"]),
            f"{row['ratio']:.2f}",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _verdict(rows: list[dict[str, Any]], same: float) -> str:
    """Ratios at the same optimum, against the project's targets."""
    own = next(row for row in rows if row["name"] == "jaxid")
    lines = []
    for name, target in (("SciPy trf, dense differences, numba", 10), ("optimistix as it comes", 30)):
        row = next((row for row in rows if row["name"] == name), None)
        if row is None:
            continue
        if abs(row["cost"] - own["cost"]) > same:
            lines.append(
                f"- {name}: stopped at cost {row['cost']:.2f}, jaxid at {own['cost']:.2f}; not the same optimum, so no "
                f"ratio is claimed (target {target})."
            )
            continue
        met = "met" if row["ratio"] >= target else "not met"
        lines.append(f"- {name}: {row['ratio']:.1f} times jaxid's time at the same optimum; target {target}, {met}.")
    return "\n".join(lines)


def _stages(runs: list[dict[str, Any]]) -> str:
    middle = sorted(runs, key=lambda run: run["total"]["seconds"])[len(runs) // 2]
    lines = [
        "| stage | elapsed s | processor s | JAX tracing s | compiling s | programs |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for row in middle["stages"]:
        lines.append(
            f"| {row['stage']} | {row['seconds']:.2f} | {row['processor_seconds']:.2f} | {row['trace']:.2f} "
            f"| {row['lower'] + row['compile']:.2f} | {row['programs']} |"
        )
    return "\n".join(lines)


def page(results: dict[str, Any], same: float, close: float) -> str:
    """The documentation page."""
    runs = sorted(results["cold"], key=lambda run: run["total"]["seconds"])
    middle = runs[len(runs) // 2]
    facts = results["machine"]
    return _PAGE.format(
        **{key: facts[key] for key in ("processor", "cores", "jax", "optimistix", "scipy", "numba")},
        load=facts["load_at_start"] or 0.0,
        table=_table(results["rows"]),
        same=same,
        close=close,
        verdict=_verdict(results["rows"], same),
        cold=middle["total"]["seconds"],
        cold_processor=middle["total"]["processor_seconds"],
        runs=len(runs),
        stages=_stages(results["cold"]),
    )

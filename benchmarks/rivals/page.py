"""docs/speed.md from the results of `benchmarks/fit.py`."""

from typing import Any

from .targets import Met, targets

Row = dict[str, Any]
_PAGE = """# Speed

Written by `python -m benchmarks.fit`; the numbers are those of one run on {processor} ({cores} cores, load {load:.1f}
at the start, one core and one thread a rival;
{versions}).
Seconds are processor seconds, which other work on the machine disturbs least; elapsed ones are in brackets. What was asked
for, and what was found in this run:

{targets}

## One linearisation

Residual, derivatives by all parameters and initial states, and reduced blocks, {samples} samples of every experiment, float64;
milliseconds, the ways in turn, the least of several calls. The C++ (`benchmarks/rivals/cpp`) is written by hand with dual
numbers and compiled by g++ -O3 -march=native; "simd" takes eight experiments side by side in the compiler's vector types.
It sums normal blocks, jaxid makes orthogonal triangles. At the point compared all costs agree to {costs:.0e} of them.

{linearisations}

## One output-error fit

Eight experiments of 1,000 samples at 50 Hz on the coupled Pioneer with true dry friction, four sub-steps between
samples, float64; unknown are seven physical parameters and three initial states of every experiment: 16,000 residuals,
31 unknowns. Start 10-20 % off. Every rival minimises the same cost with the same integrator and sees the same data, but for
diffrax, whose vector field cannot stick: there dry friction is a tanh.

{table}

- *First* compiles, in a fresh process without a compilation cache (imports not counted, compilers that a rival calls are);
  *warm* is of new data of the same shape (the lesser of two, rivals alternating; the slow ones once).
- *Cost* is half chi-squared at the point reached, evaluated by one simulator for all. Only rows whose costs agree
  within {same} stopped at the same optimum; the others stand in the table but are not compared.
- *To its own*, *to the best*: when a rival first stood within {close} of the cost at which it stopped itself, and of
  the lowest cost any of them reached (stopping rules set aside; - where it never did, or where the solver does not show
  its path).
- Dry friction makes the cost slightly rough, so that solvers stop in neighbouring dips.
- `output_error` with estimated initial states does more than the row "jaxid": it searches the caster's initial angle
  globally and estimates the noise too. With a known start it fits 7 unknowns instead of 31: another problem, and on
  these logs (caster up to 0.1 rad off) not a matching one.
- IPOPT has a state at every sample, as in CasADi's own example, and twenty seconds of processor time.
{apart}

Left out: {left_out}.

## Other robots

Eight experiments of 1,000 samples, warm. Omni: seven parameters and all initial states; the pendulum is a `Custom` robot with
known starts, whose motion MuJoCo's hinge has to rounding (`benchmarks/rivals/mujoco_fit.py`). Costs are the scalar C++'s.

{others}

## Many small fits

The Pioneer with two experiments of 250 samples and 13 unknowns, every member a robot of its own, white noise. jaxid minimises
all together, in lanes, as a fleet does it before it judges; C++ one fit after another.

{small}

## Scaling

jaxid's linearisation of the Pioneer, microseconds of processor time an experiment and sample:

{scaling}

With the first 1, 2, 4 and 7 of the parameters free (eight experiments): {parameters} ms. Small fits a processor second by
how many are done together: {batches}.

## Six logs, both ways, from a cold process

The six fit logs of `jaxid/demo_logs/pioneer` (25 s each), read and fitted by integral least squares and then by output
error (eight parameters) in a new process: {cold:.1f} s elapsed, {cold_processor:.1f} s of processor time (median of
{runs}).

{stages}
"""
JAXTERITY = (
    "jaxterity (1.2.0 wants mujoco below 3.11, `mujoco.sysid` as used here 4, so that they do not share an environment; "
    "it was installed by itself and not compared)"
)
_PACKAGES = ("jax", "optimistix", "llvmlite", "scipy", "numba", "casadi", "diffrax", "mujoco", "g++")


def _lines(head: list[str], rows: list[list[str]]) -> str:
    cells = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in cells)


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _table(rows: list[Row]) -> str:
    head = ["", "first fit", "warm fit", "linearisations", "cost", "to its own", "to the best", "warm / jaxid's"]
    cells = []
    for row in rows:
        stopped = "" if "not converged" not in row["reason"] else ", not converged"
        cells.append(
            [
                row["name"],
                f"{row['first']:.1f} ({row['first_wall']:.1f})",
                f"{row['warm']:.2f} ({row['warm_wall']:.2f})",
                f"{row['linearisations']}{stopped}",
                f"{row['cost']:.2f}",
                _seconds(row["to_its_optimum"]),
                _seconds(row["to_best"]),
                f"{row['ratio']:.2f}",
            ]
        )
    return _lines(head, cells)


def _met(found: list[Met]) -> str:
    return _lines(["figure", "target", "found", ""], [[m.figure, m.target, m.found, m.verdict] for m in found])


def _linearisations(rows: list[Row]) -> str:
    ways = list(rows[0]["ways"])
    cells = []
    for row in rows:
        spent = [row["ways"][way] for way in ways]
        each = [f"{s['processor_ms']:.2f} ({s['elapsed_ms']:.2f})" for s in spent]
        ratios = [f"{s['processor_ms'] / spent[0]['processor_ms']:.2f}" for s in spent[1:]]
        cells.append([row["robot"], str(row["experiments"]), *each, *ratios])
    return _lines(["robot", "experiments", *ways, *(f"{way} / jaxid" for way in ways[1:])], cells)


def _others(rows: list[Row]) -> str:
    cells = []
    for row in rows:
        if "left_out" in row:
            cells.append([row["robot"], row["way"], f"left out: {row['left_out']}", "", ""])
            continue
        cost = "-" if row["cost"] is None else f"{row['cost']:.4f}"
        seconds = f"{row['processor_s']:.4f} ({row['elapsed_s']:.4f})"
        cells.append([row["robot"], row["way"], seconds, str(row["steps"]), cost])
    return _lines(["robot", "", "s", "linearisations", "cost"], cells)


def _small(rows: list[Row]) -> str:
    cells = [
        [
            row["way"],
            f"{row['fits']:,}",
            f"{row['processor_s']:.1f} ({row['elapsed_s']:.1f})",
            f"{row['fits_per_processor_second']:.1f}",
            f"{row['within_0.01_of_the_lowest_cost']} of {row['compared']}",
            f"{row['mean_above_the_lowest_cost']:.3f}",
        ]
        for row in rows
    ]
    head = [
        "",
        "fits",
        "s for all",
        "fits a second",
        "within 0.01 of the lowest cost of the three",
        "mean cost above it",
    ]
    return _lines(head, cells)


def _scaling(rows: list[Row]) -> str:
    cells = [[f"{r['experiments']}", f"{r['samples']:,}", f"{r['us_per_experiment_sample']:.2f}"] for r in rows]
    return _lines(["experiments", "samples", "µs"], cells)


def _stages(runs: list[Row]) -> str:
    middle = sorted(runs, key=lambda run: run["total"]["seconds"])[len(runs) // 2]
    cells = []
    for row in middle["stages"]:
        compiling = row["lower"] + row["compile"]
        times = [f"{row[key]:.2f}" for key in ("seconds", "processor_seconds", "trace")]
        cells.append([row["stage"], *times, f"{compiling:.2f}", str(row["programs"])])
    return _lines(["stage", "elapsed s", "processor s", "JAX tracing s", "compiling s", "programs"], cells)


def page(results: dict[str, Any], same: float, close: float) -> str:
    """The documentation page; empty tables where a trial left them out."""
    runs = sorted(results["cold"], key=lambda run: run["total"]["seconds"])
    middle = runs[len(runs) // 2]
    facts = results["machine"]
    linearised, missing = results.get("linearisations", []), results.get("left_out", {})
    return _PAGE.format(
        processor=facts["processor"],
        cores=facts["cores"],
        versions=", ".join(f"{name} {facts[name]}" for name in _PACKAGES if facts.get(name)),
        load=facts["load_at_start"] or 0.0,
        targets=_met(targets(results, same)),
        samples=f"{linearised[0]['samples']:,}" if linearised else "-",
        costs=max((row["relative_difference_of_costs"] for row in linearised), default=0.0),
        linearisations=_linearisations(linearised) if linearised else "-",
        table=_table(results["rows"]),
        same=same,
        close=close,
        left_out="; ".join([*(f"{name} ({why})" for name, why in missing.items()), JAXTERITY]),
        apart="\n".join(f"- {name}: {how}." for name, how in results.get("apart", {}).items()),
        others=_others(results.get("other_fits", [])),
        small=_small(results.get("small_fits", [])),
        scaling=_scaling(results.get("scaling", [])),
        parameters=", ".join(f"{row['processor_ms']:.2f}" for row in results.get("scaling_parameters", [])),
        batches=", ".join(
            f"{row['fits_per_processor_second']:.1f} ({row['fits']})" for row in results.get("scaling_batches", [])
        ),
        cold=middle["total"]["seconds"],
        cold_processor=middle["total"]["processor_seconds"],
        runs=len(runs),
        stages=_stages(results["cold"]),
    )

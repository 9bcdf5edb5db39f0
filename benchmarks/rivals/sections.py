"""The tables that need no process for every rival: `python -m benchmarks.rivals.sections FILE [--quick]`, results as JSON."""

import json
import os
import sys
from pathlib import Path
from typing import Any

PROBED = 256
"""Members that C++ fits, and whose costs are compared: it takes one after another, so that its pace needs no more."""


def small(count: int) -> list[dict[str, Any]]:
    """Many small fits: jaxid's together, C++ one after another."""
    from . import cpp_fit, small_fits

    problems = small_fits.members(count)
    small_fits.side_by_side(problems[:64])  # what there is to compile
    found = {"jaxid": small_fits.side_by_side(problems)}
    if cpp_fit.absent() is None:
        for kind in ("scalar", "simd"):
            found[f"C++, {kind}"] = small_fits.one_after_another(problems[:PROBED], kind)
    costs = {name: own.costs(problems[:PROBED]) for name, own in found.items()}
    best = [min(each) for each in zip(*costs.values(), strict=True)]
    rows = []
    for name, own in found.items():
        above = [float(c - b) for c, b in zip(costs[name], best, strict=True)]
        rows.append(
            {
                "way": name,
                "fits": len(own.points),
                "processor_s": own.processor_seconds,
                "elapsed_s": own.seconds,
                "fits_per_processor_second": len(own.points) / own.processor_seconds,
                "within_0.01_of_the_lowest_cost": sum(a < 0.01 for a in above),
                "mean_above_the_lowest_cost": sum(above) / len(above),
                "compared": len(best),
            }
        )
        print(f"small fits  {rows[-1]}", flush=True)
    return rows


def main() -> None:
    """Run all and write."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    from . import linearisations, other_fits, scaling
    from .pioneer_problem import make_problem

    quick = "--quick" in sys.argv
    problem = make_problem(10, 200 if quick else 1000)
    found = {
        "linearisations": linearisations.table(problem, (8,) if quick else (8, 128), quick),
        "other_fits": other_fits.table(200 if quick else 1000),
        "small_fits": small(16 if quick else 1024),
        "scaling": scaling.over_sizes(problem, quick),
        "scaling_parameters": scaling.over_parameters(problem),
        "scaling_batches": scaling.over_batches(quick),
    }
    Path(sys.argv[1]).write_text(json.dumps(found))


if __name__ == "__main__":
    main()

"""`jaxid demo`: both robots against their truth, and the papers' tables."""

from contextlib import ExitStack
from pathlib import Path
from time import perf_counter

from .. import demo
from .cache import keep_compiled_programs
from .console import say, show, step
from .fit import estimate, write_results
from .folder import results_in


def run_demo(out: Path, overwrite: bool = False) -> None:
    """Identify both demonstration robots into `out`/pioneer and `out`/omni, print them and the papers' tables."""
    keep_compiled_programs()
    began = perf_counter()
    with ExitStack() as folders:
        for name in demo.ROBOTS:
            folders.enter_context(results_in(out / name, "demo", name, overwrite))
        for name in demo.ROBOTS:
            with step(f"Reading the {name}'s demonstration logs"):
                case = demo.case(name)
            fits = estimate(case.robot, case.fit)
            show(f"\n{demo.title(name)}\n")
            write_results(out / name, fits, case.held_out, case.fit, case.truth)
    for title, tables in demo.PAPERS.items():
        with step(title):
            found = tables()
        show(f"\n{title}\n")
        for table in found:
            show(f"{table}\n")
    say(f"{out}: fit.json, model.toml, report.html and pictures of both robots; {perf_counter() - began:.0f} s in all")

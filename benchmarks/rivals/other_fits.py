"""Whole warm fits of the omni and of the pendulum: jaxid, C++, and `mujoco.sysid` on the pendulum."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from . import cpp_fit, mujoco_fit
from .other_robots import OtherProblem, omni_problem, pendulum_problem

_CALLS = 3
Found = tuple[np.ndarray, int]


def jaxid_fit(problem: OtherProblem) -> Found:
    """The compiled Levenberg-Marquardt, from the common start."""
    from jaxid import float64
    from jaxid.estimate.output_error.solvers import minimise_compiled

    with float64():
        structure, arrays, unknowns = problem.built()
        optimum = minimise_compiled(structure, arrays, unknowns)
        return problem.point_of(structure, arrays, optimum.unknowns), int(optimum.iterations)


def _by_mujoco(problem: OtherProblem) -> Found:
    theta, steps = mujoco_fit.fit(problem)
    x = problem.start_point()
    x[: len(theta)] = theta
    return x, steps


def _ways(name: str, problem: OtherProblem) -> tuple[dict[str, Callable[[], Found]], dict[str, str]]:
    ways: dict[str, Callable[[], Found]] = {"jaxid": lambda: jaxid_fit(problem)}
    missing = {}
    if (why := cpp_fit.absent()) is None:
        for kind in ("scalar", "simd"):
            ways[f"C++, {kind}"] = lambda kind=kind: problem.task(kind).fit(problem.start_point())
    else:
        missing["C++"] = why
    if name.startswith("pendulum"):
        if (why := mujoco_fit.absent()) is None:
            ways["mujoco.sysid"] = lambda: _by_mujoco(problem)
        else:
            missing["mujoco.sysid"] = why
    return ways, missing


def table(samples: int) -> list[dict[str, Any]]:
    """A row a robot and way: least seconds of the warm fit, the cost reached, evaluated by the scalar C++ for all, or, where
    there is no compiler, none."""
    rows = []
    for name, problem in (("omni", omni_problem(8, samples)), ("pendulum (Custom)", pendulum_problem(8, samples))):
        ways, missing = _ways(name, problem)
        judge = problem.task("scalar") if cpp_fit.absent() is None else None
        for way, run in ways.items():
            run()
            spent = []
            for _ in range(_CALLS):
                wall, processor = time.perf_counter(), time.process_time()
                x, steps = run()
                spent.append((time.process_time() - processor, time.perf_counter() - wall))
            row = {"robot": name, "way": way, "steps": steps, "cost": judge.cost(x) if judge else None}
            rows.append({**row, "processor_s": min(p for p, _ in spent), "elapsed_s": min(w for _, w in spent)})
            print(f"other fits  {rows[-1]}", flush=True)
        rows += [{"robot": name, "way": way, "left_out": why} for way, why in missing.items()]
    return rows

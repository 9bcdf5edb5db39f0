"""One linearisation (residual, derivatives, reduced blocks) of jaxid and of scalar and eight-lane C++, interleaved.

jaxid reduces by orthogonal triangles, the C++ by normal blocks. Least processor time of several calls, one thread.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from . import cpp_fit, jaxid_fit
from .other_robots import OtherProblem, omni_problem, pendulum_problem
from .pioneer_problem import FitProblem

CALLS = 8
Way = Callable[[], Any]


def least(ways: dict[str, Way], calls: int = CALLS) -> dict[str, dict[str, float]]:
    """Least processor and elapsed milliseconds of each way, called in turn; the first calls do not count."""
    found = {name: {"processor_ms": np.inf, "elapsed_ms": np.inf} for name in ways}
    for way in ways.values():
        way()
    for _ in range(calls):
        for name, way in ways.items():
            wall, processor = time.perf_counter(), time.process_time()
            way()
            spent = {"processor_ms": time.process_time() - processor, "elapsed_ms": time.perf_counter() - wall}
            found[name] = {key: min(found[name][key], 1e3 * value) for key, value in spent.items()}
    return found


def repeated(problem: FitProblem, experiments: int, samples: int | None = None) -> FitProblem:
    """The problem's experiments over and over, and every record over and over or cut, to these sizes."""
    E, T = problem.inputs.shape[:2]
    samples = samples or T

    def sized(x: np.ndarray) -> np.ndarray:
        x = np.tile(x, (-(-experiments // E), -(-samples // T), 1))
        return np.ascontiguousarray(x[:experiments, :samples])

    return FitProblem(sized(problem.inputs), sized(problem.outputs), problem.numbers, problem.scale, problem.start)


def pioneer_ways(problem: FitProblem) -> tuple[dict[str, Way], dict[str, float]]:
    """The ways to linearise at the start, and the costs that each finds there."""
    from jaxid import float64
    from jaxid.estimate.output_error.direct import linearised_directly
    from jaxid.estimate.output_error.laid_out import direct

    with float64():
        laid_out, there = _laid_out(*jaxid_fit.built(problem), direct)
    ways: dict[str, Way] = {"jaxid": lambda: linearised_directly(laid_out, there)}
    costs = {"jaxid": float(ways["jaxid"]().cost)}
    return _with_cpp(ways, costs, lambda kind: cpp_fit.pioneer_task(problem, kind), problem.start_point)


def other_ways(problem: OtherProblem) -> tuple[dict[str, Way], dict[str, float]]:
    """The same for the omni and the pendulum."""
    from jaxid import float64
    from jaxid.estimate.output_error.direct import linearised_directly
    from jaxid.estimate.output_error.laid_out import direct

    with float64():
        laid_out, there = _laid_out(*problem.built(), direct)
    ways: dict[str, Way] = {"jaxid": lambda: linearised_directly(laid_out, there)}
    costs = {"jaxid": float(ways["jaxid"]().cost)}
    return _with_cpp(ways, costs, problem.task, problem.start_point())


def _laid_out(structure: Any, arrays: Any, unknowns: Any, direct: Any) -> tuple[Any, Any]:
    from jaxid.estimate.output_error.what_counts import of_what_counts

    found = direct(structure, arrays)
    if found is None:
        raise RuntimeError("this robot has no machine code here")
    return of_what_counts(found)[0], unknowns  # as a fit does


def _with_cpp(ways: dict[str, Way], costs: dict[str, float], task: Callable, x: np.ndarray):
    if cpp_fit.absent() is None:
        for kind in ("scalar", "simd"):
            own = task(kind)
            name = f"C++, {kind}"
            ways[name] = lambda own=own: own.linearise(x)
            costs[name] = own.linearise(x)[0]
    return ways, costs


def table(problem: FitProblem, experiments: tuple[int, ...], quick: bool) -> list[dict[str, Any]]:
    """Rows by robot and number of experiments."""
    samples = problem.inputs.shape[1]
    rows = []
    for E in experiments:
        cases = {
            "pioneer": lambda E=E: pioneer_ways(repeated(problem, E)),
            "omni": lambda E=E: other_ways(omni_problem(E, samples)),
            "pendulum (Custom)": lambda E=E: other_ways(pendulum_problem(E, samples)),
        }
        for name, case in cases.items():
            ways, costs = case()
            spread = (max(costs.values()) - min(costs.values())) / min(costs.values())
            rows.append(
                {
                    "robot": name,
                    "experiments": E,
                    "samples": samples,
                    "relative_difference_of_costs": spread,
                    "ways": least(ways, 2 if quick or E > 8 else CALLS),
                }
            )
            said = {way: round(spent["processor_ms"], 2) for way, spent in rows[-1]["ways"].items()}
            print(f"linearisation  {name:<18} {E:4d} experiments  {said} ms", flush=True)
    return rows

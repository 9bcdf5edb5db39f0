"""Many small fits of the Pioneer: two experiments of 250 samples each, 13 unknowns (seven parameters, six initial states).

Every member is a robot of its own, its parameters 10 % about the published ones (one standard deviation), simulated by the
scalar loops of `pioneer_numba`, with white noise and inputs that change every half second. All start at the published
parameters, at rest with the caster trailing.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from . import cpp_fit, jaxid_fit, pioneer_numba
from .pioneer_problem import FREE, SIGMA, STATE_SCALE, FitProblem

SAMPLES, EXPERIMENTS, SPREAD, HELD = 250, 2, 0.1, 25


def members(count: int, seed: int = 5) -> list[FitProblem]:
    """`count` problems."""
    from reference.pioneer import PARAMETERS

    rng = np.random.default_rng(seed)
    scale = np.array([PARAMETERS[name] for name in FREE])
    found = []
    for _ in range(count):
        levels = rng.choice([-8.0, -4.0, 0.0, 4.0, 8.0], size=(EXPERIMENTS, SAMPLES // HELD, 2))
        inputs = np.repeat(levels, HELD, axis=1)
        problem = FitProblem(inputs, np.zeros((EXPERIMENTS, SAMPLES, 2)), dict(PARAMETERS), scale, scale)
        truth = np.concatenate([np.exp(SPREAD * rng.normal(size=len(FREE))), np.zeros(3 * EXPERIMENTS)])
        truth[len(FREE) :: 3] = 0.04 * rng.normal(size=EXPERIMENTS) / STATE_SCALE
        outputs = pioneer_numba.simulate(problem, truth) + SIGMA * rng.normal(size=problem.outputs.shape)
        found.append(replace(problem, outputs=outputs))
    return found


@dataclass(frozen=True)
class Small:
    """Processor and elapsed seconds of all fits, and the points reached."""

    processor_seconds: float
    seconds: float
    points: list[np.ndarray]

    def costs(self, problems: list[FitProblem]) -> np.ndarray:
        """Costs of the first of them, `problems`, by the one simulator."""
        pairs = zip(problems, self.points, strict=False)
        residuals = [pioneer_numba.residual(problem, x) for problem, x in pairs]
        return np.array([0.5 * float(r @ r) for r in residuals])


def one_after_another(problems: list[FitProblem], kind: str) -> Small:
    """C++, `kind` "scalar" or "simd", a fit at a time."""
    cpp_fit.library(kind)
    wall, processor = time.perf_counter(), time.process_time()
    points = [cpp_fit.pioneer_task(problem, kind).fit(problem.start_point)[0] for problem in problems]
    return Small(time.process_time() - processor, time.perf_counter() - wall, points)


def side_by_side(problems: list[FitProblem]) -> Small:
    """jaxid: all minimisations in lanes, as in a fleet, one minimisation a member."""
    import jax

    from jaxid import float64
    from jaxid.estimate.output_error.fleet import fit_lanes

    with float64():
        built = [jaxid_fit.built(problem) for problem in problems]
        structure, shared, _ = built[0]
        own = {name: np.stack([np.asarray(getattr(p, name)) for _, p, _ in built]) for name in ("inputs", "outputs")}
        starts = jax.tree.map(lambda *leaves: np.stack(leaves), *(start for _, _, start in built))
        wall, processor = time.perf_counter(), time.process_time()
        found = fit_lanes(structure, shared, own, starts, rounds=1)
        spent = time.process_time() - processor, time.perf_counter() - wall
        points = []
        for k, (_, arrays, _) in enumerate(built):
            unknowns = jax.tree.map(lambda leaf, k=k: np.asarray(leaf)[k], found.optimum.unknowns)
            points.append(jaxid_fit.point_of(problems[k], structure, arrays, unknowns))
    return Small(*spent, points)

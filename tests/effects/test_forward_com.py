"""jaxid/effects/body/forward_com.py: two bodies of SciPy's own, a mass carried ahead of the axle, explained by their logs."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import DifferentialDrive, Log, LogSet, output_error
from jaxid.effects import effect_by_id

MASS, INERTIA, AHEAD, HALF_TRACK, VISCOUS = 12.0, 0.4, 0.07, 0.2, 6.0


def _run(seed):
    """Newton and Euler for the centre of mass, which the axle's middle drags along without slip sideways."""
    random = np.random.default_rng(seed)
    time = 0.02 * np.arange(600)
    u = np.repeat(random.uniform(-12.0, 12.0, (40, 2)), 15, axis=0)
    found, state = [], np.zeros(2)
    for right, left in u:
        found.append(state)

        def rates(_, state, right=right, left=left):
            v, w = state
            forces = np.array([right - VISCOUS * (v + HALF_TRACK * w), left - VISCOUS * (v - HALF_TRACK * w)])
            # Unknowns: dv/dt, dw/dt and the sideways force of the axle's wheels, which acts AHEAD behind the centre of mass.
            # Along: M (dv - xc w^2); across: M (xc dw + v w); about the centre of mass: J dw.
            matrix = np.array([[MASS, 0.0, 0.0], [0.0, MASS * AHEAD, -1.0], [0.0, INERTIA, AHEAD]])
            known = [
                forces.sum() + MASS * AHEAD * w**2,
                -MASS * v * w,
                HALF_TRACK * (forces[0] - forces[1]),
            ]
            return np.linalg.solve(matrix, known)[:2]

        state = solve_ivp(rates, (0.0, 0.02), state, rtol=1e-9, atol=1e-10).y[:, -1]
    outputs = np.array(found) + random.normal(size=(600, 2)) * [0.002, 0.004]
    return Log.from_arrays(f"run {seed}", time, u, outputs, "differential")


def test_what_it_frees_is_the_distance():
    logs = LogSet([_run(seed) for seed in range(3)])
    known = (
        DifferentialDrive().with_values(M=MASS, J=INERTIA, Fv=VISCOUS, Fc=0.0, b=HALF_TRACK).change("Fc", free=False)
    )
    plain = output_error(known, logs)
    found = output_error(known + effect_by_id(known, "forward_com_offset"), logs)
    assert plain.judgement.verdict == "poor" and found.judgement.verdict == "sound"
    for name, true in (("xc", AHEAD), ("M", MASS), ("J", INERTIA), ("Fv", VISCOUS)):
        assert found[name].value == pytest.approx(true, abs=4.0 * found[name].std_error), name
    assert found["xc"].std_error < 0.002


def test_a_robot_that_estimates_it_lacks_nothing_of_it():
    free = DifferentialDrive().change("xc", free=True)
    assert effect_by_id(free, "forward_com_offset").there_already(free)

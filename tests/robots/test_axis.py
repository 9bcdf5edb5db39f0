"""The drive axis against its closed-form motion."""

import numpy as np
import pytest

from jaxid import Axis, Integrator, Log, LogSet, simulate


def test_rates_are_the_documented_equation():
    p = dict(M=2.0, Fv=3.0, Fc=0.7, offset=0.4, gain=5.0, back_emf=0.2)
    rates = Axis().rates(dict(q=1.0, v=0.5), (1.5,), (0.7,), p)
    assert rates["q"] == 0.5
    assert rates["v"] == pytest.approx((5.0 * (1.5 - 0.2 * 0.5) - 3.0 * 0.5 - 0.7 - 0.4) / 2.0)


def test_simulation_follows_the_exponential_with_back_emf_and_offset():
    robot = Axis().with_values(M=2.0, Fv=1.0, Fc=0.3, offset=0.2, gain=2.0, back_emf=0.5)
    time = 0.02 * np.arange(50)
    u, resistance = 3.0, 1.0 + 2.0 * 0.5
    final, tau = (2.0 * u - 0.3 - 0.2) / resistance, 2.0 / resistance
    v = final * (1 - np.exp(-time / tau))
    q = final * (time - tau * (1 - np.exp(-time / tau)))
    log = Log.from_arrays("step", time, np.full((50, 1), u), {"v": v, "q": q}, "axis")
    simulated = simulate(robot, LogSet([log]), integrator=Integrator(2))[0]
    np.testing.assert_allclose(simulated, np.stack([v, q], axis=1), atol=1e-8)


def test_start_values_are_marked_as_such_and_only_friction_is_bounded():
    table = Axis().parameters
    assert table.free_names == ("M", "Fv", "Fc", "offset")
    assert table["Fc"].lower == 0.0 and table["offset"].lower == -np.inf

"""What runs in machine code from NumPy, against the same problem's functions with XLA's own simulation."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxid.estimate.output_error.problem as by_xla
from jaxid import Axis, Integrator, LogSet
from jaxid.effects.actuator import InputDelay
from jaxid.estimate.output_error.direct import (
    costs_directly,
    direct,
    linearised_directly,
    linearised_now,
    sensitivities_directly,
    side_by_side,
    simulated_now,
)
from jaxid.estimate.output_error.problem import CLOCK_OFFSET, Unknowns
from jaxid.estimate.output_error.setup import build
from jaxid.simulation.rollout import rollout_in_xla

pytestmark = pytest.mark.usefixtures("double_precision")


@pytest.fixture
def xla(monkeypatch):
    """A function of `problem` as XLA's program, the simulation too."""
    monkeypatch.setattr(by_xla, "rollout", rollout_in_xla)
    return lambda function, *given: jax.jit(function, static_argnums=0)(*given)


def agree(found, expected, tolerance=1e-11):
    found, expected = (np.asarray(x) for x in (found, expected))
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=tolerance, atol=tolerance * max(1.0, np.abs(expected).max()))


def test_linearisation_simulation_and_sensitivities_are_xlas(problem, xla):
    structure, numbers, there = problem
    rng = np.random.default_rng(1)
    for weight in (None, jnp.asarray(rng.uniform(0.2, 1.0, numbers.mask.shape))):
        numbers = replace(numbers, weight=weight)
        d = direct(structure, numbers)
        expected = xla(by_xla.linearise, structure, numbers, there)
        found = linearised_directly(d, there)
        for name in expected._fields:
            agree(getattr(found, name), getattr(expected, name))
    agree(simulated_now(structure, numbers, there), xla(by_xla.simulate_all, structure, numbers, there))
    theta = by_xla.parameters_at(d.problem, np.asarray(there.z))
    for one, other in zip(
        sensitivities_directly(d, theta, np.asarray(there.states)),
        xla(by_xla.sensitivities, structure, numbers, there),
        strict=True,
    ):
        agree(one, other)


@pytest.mark.parametrize("times", [1, 5])
def test_costs_of_candidates_are_xlas(problem, xla, times):
    structure, numbers, there = problem
    factors = 1.0 + 0.05 * np.arange(5)
    candidates = jax.tree.map(lambda leaf: np.stack([f * np.asarray(leaf) for f in factors]), there)
    d = direct(structure, numbers)
    found = costs_directly(d, side_by_side(d, times), candidates)
    agree(
        found, [xla(by_xla.cost, structure, numbers, jax.tree.map(lambda x, k=k: x[k], candidates)) for k in range(5)]
    )


def test_a_log_on_which_the_simulation_diverges_harms_no_other(problem, xla):
    """Its residual is huge, its sensitivities are zero, and the others' triangles stay."""
    structure, numbers, there = problem
    wild = np.asarray(numbers.inputs).copy()
    wild[1, 50:] = 1e300
    numbers = replace(numbers, inputs=jnp.asarray(wild))
    steep = Unknowns(there.z * jnp.array([1e-12, 1.0, 1.0, 1.0]), there.states)
    expected = xla(by_xla.linearise, structure, numbers, steep)
    assert not np.isfinite(np.asarray(expected.squares)).all()
    found = linearised_directly(direct(structure, numbers), steep)
    for name in ("local", "crossed", "shared"):
        agree(getattr(found, name), getattr(expected, name), 1e-9)
    assert float(found.cost) == pytest.approx(float(expected.cost), rel=1e-9)


def test_what_acts_on_whole_records_takes_xla(axis_log):
    """Effects on commands or sensors, and offsets of clocks: nothing is left out, the same functions answer by XLA."""
    logs = LogSet([axis_log("one", np.repeat([1.0, -1.0], 50), noise=0.01)])
    late = Axis() + InputDelay()
    for robot, offset in ((late, False), (Axis(), True)):
        structure, numbers, there = build(robot, logs, start={}, integrator=Integrator(2), clock_offset=offset)
        assert direct(structure, numbers) is None
        assert offset == (CLOCK_OFFSET in structure.state_names)
        expected = jax.jit(by_xla.linearise, static_argnums=0)(structure, numbers, there)
        agree(linearised_now(structure, numbers, there).shared, expected.shared)

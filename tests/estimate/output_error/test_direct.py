"""What runs in machine code from NumPy, against the same problem's functions with XLA's own simulation."""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxid.estimate.output_error.direct as direct_module
import jaxid.estimate.output_error.problem as by_xla
from jaxid import Axis, Integrator, LogSet, Parameter
from jaxid.effects import effect_by_id
from jaxid.effects.actuator import DeadZone, InputDelay
from jaxid.effects.sensor import SensorLag
from jaxid.estimate.output_error.direct import (
    linearised_directly,
    linearised_now,
    sensitivities_directly,
    simulated_now,
)
from jaxid.estimate.output_error.direct_costs import costs_directly, side_by_side
from jaxid.estimate.output_error.evaluation import cost_at, costs_at
from jaxid.estimate.output_error.laid_out import direct
from jaxid.estimate.output_error.problem import CLOCK_OFFSET, Unknowns
from jaxid.estimate.output_error.setup import build
from jaxid.estimate.output_error.solvers import minimise_compiled
from jaxid.estimate.output_error.what_counts import of_what_counts
from jaxid.robots.effect import Effect
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


def agree_apart(found, each):
    """Costs by experiment and of priors at many unknowns, against those at each."""
    agree(found.own, np.stack([np.asarray(own.own) for own in each]))
    agree(found.shared, [float(own.shared) for own in each])


def test_costs_of_points_side_by_side_are_those_of_each(problem):
    structure, numbers, there = problem
    z, states = np.asarray(there.z), np.asarray(there.states)
    points = [Unknowns(z * (1.0 + 0.05 * k), states - 0.1 * k) for k in range(5)]
    expected = [float(by_xla.cost(structure, numbers, at)) for at in points]
    agree(costs_at(structure, numbers, points), expected)
    agree([cost_at(structure, numbers, at) for at in points], expected)


def test_what_no_log_measured_is_neither_simulated_nor_weighed(problem):
    structure, numbers, there = problem
    mask = np.array(numbers.mask)
    mask[:, :, 1] = False
    d = direct(structure, replace(numbers, mask=mask))
    less, places = of_what_counts(d)
    assert places == [0] and less.model.system.outputs == 1 < d.model.system.outputs
    whole, part = linearised_directly(d, there), linearised_directly(less, there)
    for name in set(whole._fields) - {"squares"}:
        agree(getattr(part, name), getattr(whole, name))
    agree(part.squares[:, 0], whole.squares[:, 0])
    assert not whole.squares[:, 1].any()
    optimum = minimise_compiled(structure, replace(numbers, mask=mask), there)
    assert optimum.triangle.squares.shape == whole.squares.shape


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
    each = [jax.tree.map(lambda x, k=k: x[k], candidates) for k in range(5)]
    agree_apart(found, [xla(by_xla.costs_apart, structure, numbers, own) for own in each])
    agree(found.own.sum(axis=1) + found.shared, [xla(by_xla.cost, structure, numbers, own) for own in each])


def test_many_directions_go_another_way_to_the_same_numbers(problem, monkeypatch):
    """Directions that are not written out by themselves, and outputs that are kept as long as the logs."""
    structure, numbers, there = problem
    d = direct(structure, numbers)
    alone = linearised_directly(d, there)
    theta = by_xla.parameters_at(d.problem, np.asarray(there.z))
    rows = sensitivities_directly(d, theta, np.asarray(there.states))
    monkeypatch.setattr(direct_module, "_MOST_ALONE", 0)
    for one, other in zip(linearised_directly(d, there), alone, strict=True):
        agree(one, other)
    for one, other in zip(sensitivities_directly(d, theta, np.asarray(there.states)), rows, strict=True):
        agree(one, other)


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


@dataclass(frozen=True)
class Weakened(Effect):
    """A user's own: commands fade with the robot's own viscous friction, and the sensors see it too."""

    id = "weakened"

    def parameters(self, robot):
        return {self.key("share"): Parameter(0.1, free=True)}

    def command(self, inputs, time, dt, p, robot):
        return inputs / (1.0 + p[self.key("share")] * p["Fv"] * jnp.cos(time)[:, None])

    def measure(self, outputs, time, p, robot):
        both = p | {"start": outputs[20]}  # asks for a record longer than a few samples, and for a dictionary
        return outputs * (1.0 + 0.1 * p["Fv"]) + p["M"] * p[self.key("share")] * (outputs**2 + both["start"])


def test_effects_on_commands_and_sensors_are_those_of_xla(axis_log, xla):
    """Several at once, beside one in the equations of motion; one reads the robot's own parameters in both places."""
    logs = LogSet([axis_log(f"{k}", np.roll(np.repeat([3.0, -2.0, 0.5], 20), 9 * k), noise=0.01) for k in range(2)])
    robot = Axis().with_values(M=1.0, Fv=2.0, Fc=0.5)
    for effect in (DeadZone(), InputDelay(), Weakened(), SensorLag()):
        robot = robot + effect
    for name in ("stribeck_friction", "sensor_bias"):
        robot = robot + effect_by_id(robot, name)
    values = {"actuator_dead_zone.threshold": 0.1, "input_delay.delay": 0.013, "sensor_lag.time_constant": 0.02}
    values["stribeck_friction.amplitude"] = 0.2
    given = robot.with_values(**values)
    start = {name: given.parameters[name].value for name in given.parameters.free_names}
    structure, numbers, there = build(given, logs, start=start, initial="estimate", integrator=Integrator(3))
    there = there._replace(states=there.states + 0.1)
    d = direct(structure, numbers)
    expected, found = xla(by_xla.linearise, structure, numbers, there), linearised_directly(d, there)
    for name in expected._fields:
        agree(getattr(found, name), getattr(expected, name))
    # Each of the last few directions moves what the sensors show, so that none was left out.
    assert np.all(np.abs(np.asarray(found.shared)).max(axis=0) > 1e-6)
    candidates = jax.tree.map(lambda leaf: np.stack([f * np.asarray(leaf) for f in (1.0, 1.1, 1.2)]), there)
    each = [jax.tree.map(lambda x, k=k: x[k], candidates) for k in range(3)]
    costs = [xla(by_xla.costs_apart, structure, numbers, own) for own in each]
    for times in (1, 3):
        agree_apart(costs_directly(d, side_by_side(d, times), candidates), costs)
    agree(simulated_now(structure, numbers, there), xla(by_xla.simulate_all, structure, numbers, there))


def test_robots_that_differ_in_their_signals_share_their_machine_code(axis_log):
    logs = LogSet([axis_log("one", np.repeat([1.0, -1.0], 50), noise=0.01)])
    models = []
    for added in ((), (InputDelay(),), (SensorLag(), DeadZone())):
        robot = Axis()
        for effect in added:
            robot = robot + effect
        structure, numbers, _ = build(robot, logs, start={}, integrator=Integrator(2))
        models.append(direct(structure, numbers).model)
    assert models[0].system == models[1].system == models[2].system
    assert [model.records.commands is None for model in models] == [True, False, False]
    assert [model.records.measures is None for model in models] == [True, True, False]


@dataclass(frozen=True)
class Leaning(Effect):
    """A force that reads the parameter of a sensor's effect: they share a cause."""

    id = "leaning"

    def force(self, forces, state, p, robot):
        return tuple(force + 3.0 * p["sensor_bias.bias_v"] for force in forces)


def test_a_force_may_read_the_parameter_of_a_sensors_effect(axis_log, xla):
    logs = LogSet([axis_log("one", np.repeat([1.0, -1.0], 50), noise=0.01)])
    robot = (Axis() + effect_by_id(Axis(), "sensor_bias") + Leaning()).with_values(**{"sensor_bias.bias_v": 0.1})
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    structure, numbers, there = build(robot, logs, start=start, integrator=Integrator(2))
    found = linearised_directly(direct(structure, numbers), there)
    expected = xla(by_xla.linearise, structure, numbers, there)
    for name in expected._fields:
        agree(getattr(found, name), getattr(expected, name))


def test_offsets_of_clocks_take_xla(axis_log):
    """Nothing is left out: the same functions answer by XLA."""
    logs = LogSet([axis_log("one", np.repeat([1.0, -1.0], 50), noise=0.01)])
    structure, numbers, there = build(Axis(), logs, start={}, integrator=Integrator(2), clock_offset=True)
    assert direct(structure, numbers) is None and CLOCK_OFFSET in structure.state_names
    expected = jax.jit(by_xla.linearise, static_argnums=0)(structure, numbers, there)
    agree(linearised_now(structure, numbers, there).shared, expected.shared)

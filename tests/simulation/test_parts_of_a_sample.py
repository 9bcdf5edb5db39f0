"""Late sensors behind commands that arrive between samples, against the linear system in closed form."""

import jax
import numpy as np
import pytest
from scipy.signal import cont2discrete

from jaxid import Axis, Log, LogSet
from jaxid._float64 import float64
from jaxid.effects import effect_by_id
from jaxid.estimate.output_error.direct import linearised_directly, simulated_now
from jaxid.estimate.output_error.direct_costs import costs_directly, side_by_side
from jaxid.estimate.output_error.laid_out import direct
from jaxid.estimate.output_error.problem import Unknowns, linearise, simulate_all
from jaxid.estimate.output_error.setup import build
from jaxid.simulation.rollout import Integrator, parts_of_a_sample
from jaxid.simulation.simulate import simulate

DT, FINE = 0.02, 40
M, FV = 250.0, 2580.0
DELAY, LAG = 0.053, 0.06


LATE = {"input_delay": ("constant", "delay", DELAY), "sensor_lag": ("first_order", "time_constant", LAG)}


def axis(*effects):
    robot = Axis().with_values(M=M, Fv=FV, Fc=0.0, offset=0.0)
    for identifier in effects:
        law, name, value = LATE[identifier]
        robot = (robot + effect_by_id(robot, identifier, law)).with_values(**{f"{identifier}.{name}": value})
    return robot


def commands(seed):
    return np.repeat(np.random.default_rng(seed).uniform(-3000.0, 3000.0, 60), 4)


def in_closed_form(u, delay=DELAY):
    """The speed behind the lag at the samples: both states exactly, with the command held for half a millisecond each."""
    a, b = np.array([[-FV / M, 0.0], [1.0 / LAG, -1.0 / LAG]]), np.array([[1.0 / M], [0.0]])
    A, B, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), DT / FINE)
    late = round(delay / (DT / FINE))
    fine = np.concatenate([np.zeros(late), np.repeat(u, FINE)])
    x, seen = np.zeros(2), []
    for k in range(len(u) * FINE):
        if k % FINE == 0:
            seen.append(x[1])
        x = A @ x + B[:, 0] * fine[k]
    return np.array(seen)


@pytest.mark.parametrize(
    ("effects", "delay", "substeps", "most"),
    [
        (("sensor_lag",), 0.0, 4, 5e-4),
        (("sensor_lag",), 0.0, 3, 2e-4),
        (("input_delay", "sensor_lag"), DELAY, 4, 7e-4),
        (("input_delay", "sensor_lag"), DELAY, 3, 3e-4),
    ],
)
def test_kinks_at_and_between_samples_are_seen(effects, delay, substeps, most):
    """With what is measured at samples alone the errors are 0.0027 and 0.010."""
    u = commands(0)
    log = Log.from_arrays("run", DT * np.arange(len(u)), u[:, None], np.zeros((len(u), 1)), Axis())
    true = in_closed_form(u, delay)
    (found,) = simulate(axis(*effects), LogSet([log]), integrator=Integrator(substeps))
    assert np.sqrt(np.mean((found[:, 0] - true) ** 2)) < most * np.std(true)


def test_late_sensors_need_more_looks_most_of_all_behind_commands_that_are_late():
    robot = Axis()
    delay, lag = effect_by_id(robot, "input_delay", "constant"), effect_by_id(robot, "sensor_lag", "first_order")
    limit = effect_by_id(robot, "voltage_saturation", "hard")
    bias = effect_by_id(robot, "sensor_bias", "constant")
    assert parts_of_a_sample(robot + delay + lag, 12) == 4 and parts_of_a_sample(robot + lag + delay, 3) == 3
    assert parts_of_a_sample(robot + delay + lag, 1) == 1
    assert parts_of_a_sample(robot + lag, 12) == parts_of_a_sample(robot + limit + lag, 4) == 2
    assert parts_of_a_sample(robot + lag, 3) == 3
    assert parts_of_a_sample(robot + delay, 12) == parts_of_a_sample(robot + delay + bias, 12) == 1


@pytest.mark.parametrize(
    ("effects", "substeps", "parts"),
    [(("sensor_lag",), 4, 2), (("input_delay", "sensor_lag"), 6, 3)],
)
def test_machine_code_and_xla_see_the_same(effects, substeps, parts):
    robot = axis(*effects)
    logs = []
    for k, length in enumerate((240, 180)):
        u = commands(k)[:length]
        y = in_closed_form(u) + 0.01 * np.random.default_rng([9, k]).normal(size=length)
        logs.append(Log.from_arrays(f"run {k}", DT * np.arange(length), u[:, None], y[:, None], Axis()))
    with float64():
        structure, problem, unknowns = build(robot, LogSet(logs), start={}, integrator=Integrator(substeps))
        d = direct(structure, problem)
        assert d is not None and d.parts == parts and d.substeps == substeps
        compiled = [jax.jit(f, static_argnums=0) for f in (simulate_all, linearise)]
        simulated, theirs = (f(structure, problem, unknowns) for f in compiled)
        np.testing.assert_allclose(simulated_now(structure, problem, unknowns), simulated, rtol=1e-9, atol=1e-10)
        ours = linearised_directly(d, unknowns)
        for name in ("shared", "crossed", "local"):
            a, b = (np.asarray(getattr(one, name)) for one in (ours, theirs))
            product = [np.swapaxes(x, -1, -2) @ x for x in (a, b)]
            np.testing.assert_allclose(*product, rtol=1e-7, atol=1e-9 * np.abs(product[1]).max(initial=1.0))
        many = Unknowns(np.asarray(unknowns.z)[None], np.asarray(unknowns.states)[None])
        cost = costs_directly(d, side_by_side(d, 1), many)
        np.testing.assert_allclose(cost.own[0].sum(), 0.5 * np.sum(theirs.squares), rtol=1e-7)

"""Effects on whole records, in NumPy and in XLA."""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxid
from jaxid._float64 import float64
from jaxid.kernel import in_numpy_or_xla
from jaxid.robots.signal_path import overrides
from jaxid.simulation import records
from jaxid.simulation.command_map import command_map
from jaxid.simulation.rollout import commanded


def test_what_computes_much_on_one_shape_is_compiled_and_stays_the_same():
    robot = (jaxid.Axis() + jaxid.effects.effect_by_id(jaxid.Axis(), "input_delay")).structure
    own = records.records_of(robot, ("input_delay.delay",))
    rng, dt = np.random.default_rng(0), np.full((1000, 40), 0.01)
    inputs = rng.normal(size=(1000, 40, 1))
    with float64():
        first = records.commanded(own, [0.03], inputs, dt, 2, np.zeros(len(dt)))
        for _ in range(100):
            last = records.commanded(own, [0.03], inputs, dt, 2, np.zeros(len(dt)))
    program = in_numpy_or_xla.in_xla(records._values, 3)
    assert program._outer._cache_size() >= 1
    np.testing.assert_allclose(last, first, rtol=0, atol=1e-13)
    np.testing.assert_allclose(
        last[:, 3:, :, 0], np.repeat(inputs[:, :-3], 2, axis=2), atol=1e-12
    )  # three samples later


@dataclass(frozen=True)
class PassedOn(jaxid.effects.Effect):
    """A sensor that reports what it is given."""

    id: ClassVar[str] = "passed_on"

    def measure(self, outputs, time, p):
        return outputs


def test_what_was_asked_before_is_kept_and_nobody_s_own_is_touched(monkeypatch):
    robot = (jaxid.Axis() + jaxid.effects.effect_by_id(jaxid.Axis(), "input_delay") + PassedOn()).structure
    own = records.records_of(robot, ("input_delay.delay",))
    rng, dt, count = np.random.default_rng(6), np.full((2, 30), 0.01), []
    once = in_numpy_or_xla._Runs.__call__
    monkeypatch.setattr(in_numpy_or_xla._Runs, "__call__", lambda self, *arrays: count.append(1) or once(self, *arrays))
    inputs, outputs = rng.normal(size=(2, 30, 1)), rng.normal(size=(2, 30, len(robot.channels.measured)))
    with float64():
        first, again = (records.commanded(own, [0.02], inputs, dt, 2, np.zeros(2)) for _ in range(2))
        assert len(count) == 1 and np.array_equal(first, again)
        other, moved = records.commanded(own, [0.03], inputs, dt, 2, np.zeros(2)), inputs + 1.0
        assert len(count) == 2 and not np.array_equal(first, other)
        assert not np.array_equal(first, records.commanded(own, [0.02], moved, dt, 2, np.zeros(2)))
        shown = records.measured(own, [0.02], outputs, dt, np.zeros(2))
        before = outputs.copy()
        outputs += 1.0  # the caller's own, which may still be written to
        assert np.array_equal(shown, before)


_OTHERS = [pytest.param(substeps, marks=pytest.mark.slow) for substeps in (6, 83)]


@pytest.mark.parametrize("substeps", [64, 192, *_OTHERS])
def test_a_delay_of_finer_steps_is_that_of_coarser_ones_on_average(substeps):
    """Beyond the pace at which steps suit a robot several share what arrives, where their number has such shares."""
    robot = (jaxid.Axis() + jaxid.effects.effect_by_id(jaxid.Axis(), "input_delay")).structure
    rng, dt = np.random.default_rng(1), np.full(30, 0.02)
    inputs = rng.normal(size=(30, 1))
    with float64():
        arrived = np.asarray(commanded(robot, {"input_delay.delay": 0.0313}, inputs, dt, substeps))[..., 0]
    # In closed form: the mean over every step of the command held 31.3 ms earlier, nothing before the first.
    edges = np.linspace(0.0, 0.6, 30 * substeps + 1) - 0.0313
    sums = np.concatenate([[0.0], np.cumsum(inputs[:, 0]) * 0.02])
    exact = np.diff(np.interp(edges, 0.02 * np.arange(31), sums, left=0.0)).reshape(30, substeps) * substeps / 0.02
    whole = np.abs(arrived.mean(axis=1) - exact.mean(axis=1))
    assert arrived.shape == exact.shape and whole.max() < 1e-9
    shared = np.abs(np.diff(arrived, axis=1)) < 1e-12
    if substeps in (6, 83):
        np.testing.assert_allclose(arrived, exact, atol=1e-9)
    else:
        assert shared[:, ::2].all() and np.abs(np.cumsum(arrived - exact, axis=1)).max() / substeps < 0.02


def laws_on_commands():
    robots = jaxid.Pioneer(), jaxid.Omni(), jaxid.Axis()
    for robot in robots:
        for effect in jaxid.catalogue(robot):
            for law in jaxid.effects.laws_of(robot, effect.id):
                if overrides(type(law), "command"):
                    yield robot, law


@pytest.mark.parametrize(
    ("robot", "law"),
    [
        pytest.param(*own, id=f"{own[0].name}-{own[1].title}", marks=[] if own[0].name == "axis" else pytest.mark.slow)
        for own in laws_on_commands()
    ],
)
def test_effects_without_memory_answer_every_command_alone(robot, law):
    """Whatever comes before a command and whenever it comes, they make the same of it; of the others that is not so."""
    rng, n = np.random.default_rng(3), 60
    model = robot + law
    free = [name for name in model.parameters if name.startswith(law.key("")) and model.parameters[name].free]
    size = model.scales.input
    values = {name: rng.uniform(0.5, 1.5) * (model.parameters[name].typical or 1.0) for name in free}
    model = model.with_values(**values)
    inputs = size * rng.uniform(-1.0, 1.0, (1, n, len(model.channels.inputs)))
    other, dt = rng.permutation(n), np.full((1, n), 0.05 * model.scales.time)
    names = tuple(sorted(model.parameters))
    own = records.records_of(model.structure, names)

    def sent(p, substeps):
        return commanded(model, dict(zip(names, p, strict=True)), inputs[0], dt[0], substeps)

    with float64():
        numbers = np.array([float(model.parameters[name].value) for name in names])
        once = records.commanded(own, numbers, inputs, dt, 4, np.zeros(1))
        again = records.commanded(own, numbers, inputs[:, other], 2.0 * dt, 4, np.zeros(1))
        fine = np.asarray(jax.jit(sent, static_argnums=1)(numbers, 4))
    same = np.allclose(again, once[:, other], rtol=1e-12, atol=1e-12 * size)
    assert same == law.memoryless
    assert once.shape[2] == (1 if law.memoryless else 4)
    np.testing.assert_allclose(np.broadcast_to(once[0], fine.shape), fine, rtol=1e-12, atol=1e-12 * size)
    if not law.memoryless:
        return
    # Machine code of one row, whose slopes are JAX's.
    assert command_map(own.robot, tuple(names[i] for i in own.commands)) is not None
    steps = np.eye(len(names))[list(own.commands)] * numbers[list(own.commands), None]
    with float64():
        slopes = records.command_slopes(own, numbers, inputs, dt, 4, np.zeros(1), steps)
        along = jax.jit(lambda step: jax.jvp(lambda p: sent(p, 1), (jnp.asarray(numbers),), (step,))[1])
        for found, step in zip(slopes, steps, strict=True):
            exact = along(jnp.asarray(step))
            np.testing.assert_allclose(found[0], exact, rtol=1e-10, atol=1e-10 * size)

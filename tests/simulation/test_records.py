"""Effects on whole records, in NumPy and in XLA."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxid
from jaxid._float64 import float64
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
        for _ in range(records._SELDOM // first.size + 2):
            last = records.commanded(own, [0.03], inputs, dt, 2, np.zeros(len(dt)))
    program = records._in_xla[records._command]
    assert program._outer._cache_size() >= 1
    np.testing.assert_allclose(last, first, rtol=0, atol=1e-13)
    np.testing.assert_allclose(
        last[:, 3:, :, 0], np.repeat(inputs[:, :-3], 2, axis=2), atol=1e-12
    )  # three samples later


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
    with float64():
        numbers = np.array([float(model.parameters[name].value) for name in names])
        once = records.commanded(own, numbers, inputs, dt, 4, np.zeros(1))
        again = records.commanded(own, numbers, inputs[:, other], 2.0 * dt, 4, np.zeros(1))
        fine = np.asarray(commanded(model, dict(zip(names, numbers, strict=True)), inputs[0], dt[0], 4))
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

        def sent(p):
            return commanded(model, dict(zip(names, p, strict=True)), inputs[0], dt[0], 1)

        for found, step in zip(slopes, steps, strict=True):
            exact = jax.jvp(sent, (jnp.asarray(numbers),), (jnp.asarray(step),))[1]
            np.testing.assert_allclose(found[0], exact, rtol=1e-10, atol=1e-10 * size)

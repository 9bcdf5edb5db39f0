"""JAX functions of arrays run in NumPy, held to the same functions run by JAX."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxid
from jaxid.effects.catalogue import catalogue, laws_of
from jaxid.kernel.in_numpy import in_numpy
from jaxid.kernel.symbolic import Untranslated
from jaxid.robots.signal_path import overrides
from jaxid.simulation import records
from jaxid.simulation.rollout import fine_clock


def _looked_up(x, y):
    return x[jnp.searchsorted(y[0], x[:, 0])] + jnp.take(x, jnp.arange(4)[::-1] // 2, axis=0)


FUNCTIONS = {
    "elementwise": lambda x, y: jnp.where(x > y, jnp.exp(-x) / (1.0 + y**2), jnp.tanh(x) * jnp.maximum(y, 0.1) ** -3),
    "logic": lambda x, y: jnp.where(
        (x > 0) & ~(y > 0) | jnp.isfinite(jnp.log(x)), jnp.sign(x), jnp.round(x, 0) * 0 + y
    ),
    "shapes": lambda x, y: jnp.concatenate([x, jnp.flip(y, 1)], axis=1).T[1:5:2, None] + jnp.tile(x[0], (2, 1))[:, :1],
    "sums": lambda x, y: jnp.cumsum(x, axis=0) + jax.lax.cumsum(y, axis=1, reverse=True) - jnp.max(x, axis=1)[:, None],
    "products": lambda x, y: jnp.tensordot(x, y, ((0,), (0,))) @ jnp.ones((3, 2)) + jnp.sum(x * y),
    "padded": lambda x, y: jax.lax.pad(x, 2.0, ((1, 0, 2), (0, 3, 0))),
    "stacked": lambda x, y: jnp.stack([x, y], axis=1).reshape(2, -1) + jnp.arange(12.0),
    "looked up": _looked_up,
    "each looked up": jax.vmap(lambda x, y: x[jnp.searchsorted(jnp.cumsum(jnp.abs(y)), x) - 1] + jnp.take(y, 3)),
    "whole numbers": lambda x, y: x[(jnp.arange(4) - 7) // 2 + 4] + jnp.floor_divide(x, y),
    "loop": lambda x, y: jax.lax.scan(lambda c, row: (c * 0.5 + row, c), y[0], x, reverse=True)[1],
}


@pytest.mark.parametrize("name", list(FUNCTIONS))
def test_the_same_numbers_as_jax(name):
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(2, 4, 3))
    function = FUNCTIONS[name]
    with jax.enable_x64(True):
        (found,) = in_numpy(function, x, y)(x, y)
        np.testing.assert_allclose(found, function(x, y), rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("name", ["elementwise", "sums", "looked up", "loop"])
def test_derivatives_in_many_directions(name):
    rng = np.random.default_rng(2)
    x, y, dx, dy = (rng.normal(size=shape) for shape in ((4, 3), (4, 3), (5, 4, 3), (5, 4, 3)))

    def moved(x, y, dx, dy):
        return jax.vmap(lambda a, b: jax.jvp(FUNCTIONS[name], (x, y), (a, b))[1])(dx, dy)

    with jax.enable_x64(True):
        (found,) = in_numpy(moved, x, y, dx, dy)(x, y, dx, dy)
        np.testing.assert_allclose(found, moved(x, y, dx, dy), rtol=1e-12, atol=1e-13)


def test_what_nobody_reads_is_not_run_and_need_not_be_known():
    def function(x):
        jax.lax.sort(x)  # no operation for it
        return 2.0 * x

    assert len(in_numpy(function, np.ones(3)).steps) == 1


def test_what_has_no_operation_or_turns_too_often_is_left_to_xla():
    with pytest.raises(Untranslated, match="sort"):
        in_numpy(jnp.sort, np.ones(3))
    with pytest.raises(Untranslated, match="1000 turns"):
        in_numpy(lambda x: jax.lax.scan(lambda c, row: (jnp.sin(c) + row, c), 0.0, x)[1], np.ones(1000))


def _values(effect, robot):
    return {name: p.typical or p.value or 0.1 for name, p in effect.parameters(robot).items()}


@pytest.mark.parametrize(
    ("robot", "most"),
    [
        pytest.param(jaxid.Axis(), 1, id="axis, first laws"),
        pytest.param(jaxid.Axis(), None, id="axis", marks=pytest.mark.slow),
        pytest.param(jaxid.Omni(), None, id="omni", marks=pytest.mark.slow),
    ],
)
def test_every_law_on_commands_and_sensors_against_xla(robot, most):
    """Values and derivatives, on uneven clocks, of every law (or the first `most`) of every mechanism that acts on whole
    records."""
    rng, E, T, tried = np.random.default_rng(3), 2, 30, 0
    U, Y = len(robot.channels.inputs), len(robot.channels.measured)
    dt = rng.uniform(0.008, 0.012, (E, T))
    held = np.array([0.0, 1.0])  # one log at rest, one in motion
    for effect in (law for first in catalogue(robot) for law in laws_of(robot, first.id)[:most]):
        if not any(overrides(type(effect), stage) for stage in ("command", "measure")):
            continue
        own = records.records_of((robot + effect).structure, tuple(sorted(effect.parameters(robot))))
        numbers = _values(effect, robot)
        q = np.array([numbers[name] for name in own.names])
        u, y = np.cumsum(rng.normal(size=(E, T, U)), 1), np.cumsum(rng.normal(size=(E, T, Y)), 1)
        dq, dy = rng.normal(size=(3, len(q))), rng.normal(size=(E, T, Y, 3))
        time, fine = fine_clock(dt, 2, np)
        cases = []
        for link in own.sending:
            record, du = np.repeat(u, 2, axis=1), rng.normal(size=(E, 2 * T, U, 3))
            cases += [(link, "command", (q[list(link.places)], record, time, fine, held), dq[:, list(link.places)], du)]
        for link in own.sensing:
            clock = fine_clock(dt, 1, np)
            cases += [(link, "measure", (q[list(link.places)], y, *clock, held), dq[:, list(link.places)], dy)]
        with jax.enable_x64(True):
            for link, stage, arrays, step, change in cases:
                fixed = link.robot, link.names, stage
                for function, more in (
                    (records._values, ()),
                    (records._slopes, (step,)),
                    (records._slopes, (step, change)),
                ):
                    found = in_numpy(partial(function, *fixed), *arrays, *more)(*arrays, *more)
                    known = jax.jit(partial(function, *fixed))(*arrays, *more)
                    for own, other in zip(found, known, strict=True):
                        scale = np.max(np.abs(other), initial=1e-300)
                        np.testing.assert_allclose(own, other, rtol=0, atol=1e-10 * scale, err_msg=effect.title)
                    tried += 1
    assert tried > (40 if most is None else 10)

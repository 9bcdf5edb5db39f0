"""What jaxid does to the process around its programs, and that it is undone."""

import gc

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import _compile
from jaxid._compile import Program, known_options, seldom_collected


@pytest.fixture
def thresholds():
    """Whatever a test sets, put back."""
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)


@pytest.mark.parametrize(
    ("own", "inside"),
    [((700, 10, 10), 50_000), ((90_000, 5, 5), 90_000), ((0, 10, 10), 0)],
    ids=["usual", "rare", "off"],
)
def test_garbage_is_looked_for_less_often_and_then_as_before(thresholds, own, inside):
    gc.set_threshold(*own)

    @seldom_collected()
    def failing():
        assert gc.get_threshold() == (inside, *own[1:])
        raise ValueError

    for _ in range(2):
        with pytest.raises(ValueError):
            failing()
        assert gc.get_threshold() == own


def test_options_that_the_installed_xla_does_not_know_are_left_out():
    assert known_options({"xla_cpu_no_such_option": False}) == {}
    assert known_options({"xla_embed_ir_in_executable": False}) == {"xla_embed_ir_in_executable": False}


def test_a_program_runs_whatever_xla_knows(monkeypatch):
    monkeypatch.setattr(_compile, "_compiler_options", lambda: known_options({"xla_cpu_no_such_option": False}))
    program = Program(lambda x, power: x**power, {"static_argnames": ("power",)})
    np.testing.assert_array_equal(program(jnp.arange(4.0), power=2), [0, 1, 4, 9])
    lowered = program.lower(jnp.arange(4.0), power=3)
    np.testing.assert_array_equal(lowered.compile()(jnp.arange(4.0)), [0, 1, 8, 27])


@pytest.mark.parametrize("around", [jax.jit, jax.vmap, lambda f: jax.jit(jax.vmap(f))])
def test_a_program_may_be_part_of_another(around):
    program = Program(lambda x: 3 * x + len(jax.tree.leaves(x)), {})
    np.testing.assert_array_equal(around(program)(jnp.arange(4.0)), [1, 4, 7, 10])
    np.testing.assert_array_equal(program(jnp.arange(4.0)), [1, 4, 7, 10])
    slope = jax.grad(lambda x: jnp.sum(around(program)(x)))(jnp.ones(4))
    np.testing.assert_array_equal(slope, [3, 3, 3, 3])

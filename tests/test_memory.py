"""jaxid/_memory.py: where there are too many programs they are forgotten, and what was compiled still gives the same."""

import jax
import jax.numpy as jnp

from jaxid import _memory
from jaxid._memory import bounded_memory, programs


def test_programs_are_forgotten_only_where_there_are_too_many(monkeypatch):
    double = jax.jit(lambda x: 2 * x)
    with bounded_memory():
        first = double(jnp.ones(3))
    kept = programs()
    assert kept > 0
    monkeypatch.setattr(_memory, "MOST_PROGRAMS", 0)
    with bounded_memory():
        assert programs() == kept
    assert programs() < kept
    assert (double(jnp.ones(3)) == first).all()

"""jaxid/_memory.py: where there are too many programs they are forgotten, and what was compiled still gives the same."""

import jax
import jax.numpy as jnp
import pytest

from jaxid import _memory
from jaxid._memory import bounded_memory, programs


@pytest.mark.slow
def test_programs_are_forgotten_only_where_explanations_left_too_many(monkeypatch):
    monkeypatch.setattr(_memory, "MOST_PROGRAMS", 1)
    monkeypatch.setattr(_memory, "_made", 0)
    mine = [jax.jit(lambda x, k=k: k * x) for k in range(5)]
    before = [f(jnp.ones(3)) for f in mine]
    double, triple = jax.jit(lambda x: 2 * x + 1), jax.jit(lambda x: 3 * x + 1)
    with bounded_memory():
        first = double(jnp.ones(3))
    kept = programs()
    assert kept > 5  # the user's own do not count
    with bounded_memory():
        triple(jnp.ones(3))
    assert programs() < kept
    assert (double(jnp.ones(3)) == first).all()
    assert all((f(jnp.ones(3)) == found).all() for f, found in zip(mine, before, strict=True))

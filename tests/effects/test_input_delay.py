"""Delays of commands against closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid.effects.actuator.input_delay import late


@pytest.mark.parametrize("rate", [0.0, 0.05, 0.3])
def test_a_command_that_comes_later_and_later_is_as_large(rate, double_precision):
    """`u'(t) = u((1 - rate) t)`: a step of 3 at 0.4 s arrives at 0.4 / (1 - rate) s, and is 3 from then on."""
    dt = np.full(100, 0.02)
    time = np.arange(100) * 0.02
    command = np.where(time[:, None] >= 0.4 - 1e-9, 3.0, 0.0)
    edges = np.append(time, 2.0)
    found = np.asarray(late(jnp.asarray(command), jnp.asarray(time), jnp.asarray(dt), jnp.asarray(rate * edges)))[:, 0]
    arrives = 0.4 / (1.0 - rate)
    expected = 3.0 * np.clip((edges[1:] - arrives) / 0.02, 0.0, 1.0)
    np.testing.assert_allclose(found, expected, atol=1e-9)

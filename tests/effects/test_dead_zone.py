"""jaxid/effects/actuator/dead_zone.py: a dead zone without an edge."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxid import Axis
from jaxid.effects import laws_of


def test_a_gradual_dead_zone_loses_its_threshold_in_the_end_and_has_slopes_everywhere():
    (effect,) = [law for law in laws_of(Axis(), "actuator_dead_zone") if law.law == "gradual"]
    key = effect.key("threshold")
    with jax.enable_x64(True):
        u = jnp.array([-4.0, -0.3, -1e-9, 0.0, 1e-9, 0.3, 4.0])[:, None]
        time, steps = 0.02 * jnp.arange(7.0), jnp.full(7, 0.02)

        def passed(threshold):
            return effect.command(u, time, steps, {key: threshold}, Axis())[:, 0]

        expected = u[:, 0] - 0.4 * jnp.sign(u[:, 0]) * (1.0 - jnp.exp(-jnp.abs(u[:, 0]) / 0.4))
        np.testing.assert_allclose(passed(0.4), expected, rtol=1e-6, atol=1e-15)
        np.testing.assert_allclose(passed(0.0), u[:, 0], rtol=1e-12)
        for threshold in (0.0, 0.4):
            slope = jax.jvp(passed, (threshold,), (1.0,))[1]
            assert np.all(np.isfinite(slope)) and slope[0] > 0.99 and slope[-1] < -0.99 and slope[3] == 0.0

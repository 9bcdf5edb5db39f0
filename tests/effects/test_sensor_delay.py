"""jaxid/effects/sensor/delay.py: stamps that are early."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis
from jaxid.effects import effect_by_id, laws_of
from tests.effects.at_once import measured


def test_what_is_stamped_early_is_what_will_be():
    """A cubic by parabolas between uneven samples, in the first and last interval and beyond it by lines."""
    (effect,) = [law for law in laws_of(Axis(), "sensor_delay") if law.law == "early"]
    time = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.03, 300))

    def speed(t):
        return t + 0.4 * t**2 - 0.05 * t**3

    outputs = jnp.stack([jnp.asarray(speed(time)), jnp.zeros(300)], axis=1)
    for lead in (0.0, 0.004, 0.0275):
        found = measured(effect, outputs, time, {effect.key("lead"): lead}, Axis())[:, 0]
        inner = (time + lead > time[1]) & (time + lead < time[-2])
        np.testing.assert_allclose(found[inner], speed(time + lead)[inner], atol=1e-5)
        np.testing.assert_allclose(
            found, speed(time + lead), atol=1e-2
        )  # held where the line has gone on for an interval


@pytest.mark.parametrize("mechanism", ["sensor_delay", "sensor_lag"])
def test_no_reading_hangs_on_what_comes_after_it(mechanism):
    """In a closed loop the next sample answers this reading's noise; a law that looked there would follow it."""
    time = 0.02 * np.arange(80)
    outputs = (time**2)[:, None] * [1.0, 0.0]
    other = outputs - 1e-4 * (time > time[50])[:, None] * [1.0, 0.0]  # bends half as much there
    laws = [law for law in laws_of(Axis(), mechanism) if law.law not in ("early", "centred_average", "shape")]
    assert len(laws) > 2
    for law in laws:
        (name,) = (n for n in law.parameters(Axis()) if n.split(".")[1] in ("delay", "rate", "window", "time_constant"))
        numbers = {n: p.value for n, p in law.parameters(Axis()).items()} | {name: 0.011}
        read = [measured(law, y, time, numbers, Axis())[:51] for y in (outputs, other)]
        np.testing.assert_array_equal(*read, err_msg=law.law)


def test_beside_a_lag_nothing_is_stamped_early():
    late = Axis() + effect_by_id(Axis(), "motor_lag")
    assert "early" in [law.law for law in laws_of(Axis(), "sensor_delay")]
    assert "early" not in [law.law for law in laws_of(late, "sensor_delay")]
    with pytest.raises(KeyError, match="'motor_lag' makes what 'axis' measures late already"):
        effect_by_id(late, "sensor_delay", "early")

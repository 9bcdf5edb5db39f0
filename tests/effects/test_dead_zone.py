"""jaxid/effects/actuator/dead_zone.py: dead zones without an edge."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, explain, output_error
from jaxid.effects import effect_by_id, laws_of

LEFT = {"gradual": lambda x: np.exp(-x), "hyperbolic": lambda x: np.sqrt(1.0 + x**2) - x}
"""What of the threshold is not lost yet at commands that are so many times as large."""
U = np.array([-4.0, -0.3, -1e-9, 0.0, 1e-9, 0.3, 4.0])


def passed(effect, **values):
    time, steps = 0.02 * jnp.arange(7.0), jnp.full(7, 0.02)
    return effect.command(jnp.asarray(U)[:, None], time, steps, {effect.key(n): v for n, v in values.items()}, Axis())[
        :, 0
    ]


def law(name):
    (effect,) = [law for law in laws_of(Axis(), "actuator_dead_zone") if law.law == name]
    return effect


@pytest.mark.parametrize("name", LEFT)
def test_it_loses_its_threshold_in_the_end_and_has_slopes_everywhere(name):
    effect = law(name)
    with jax.enable_x64(True):
        expected = U - 0.4 * np.sign(U) * (1.0 - LEFT[name](np.abs(U) / 0.4))
        np.testing.assert_allclose(passed(effect, threshold=0.4), expected, rtol=1e-6, atol=1e-15)
        np.testing.assert_allclose(passed(effect, threshold=0.0), U, rtol=1e-12)
        for threshold in (0.0, 0.4):
            slope = jax.jvp(lambda t: passed(effect, threshold=t), (threshold,), (1.0,))[1]
            low, high = max(threshold - 1e-6, 1e-12), threshold + 1e-6
            lost = [d * (1.0 - LEFT[name](np.abs(U) / d)) for d in (low, high)]
            large = np.abs(U) > 0.1  # beyond what such a difference resolves
            np.testing.assert_allclose(
                slope[large], (-np.sign(U) * np.subtract(*lost[::-1]) / (high - low))[large], atol=1e-4
            )
            np.testing.assert_allclose(slope[~large], 0.0, atol=1e-6 if threshold else 1.0)


@pytest.mark.parametrize("name", LEFT)
def test_the_freer_form_is_either_and_what_lies_between(name):
    effect = law(name).freer
    begun = effect.parameters(Axis())[effect.key("lingers")].value
    assert effect.restricts == {"lingers": begun} and effect.freer is None
    with jax.enable_x64(True):
        same = passed(law(name), threshold=0.4)
        np.testing.assert_allclose(passed(effect, threshold=0.4, lingers=begun), same, rtol=1e-6, atol=1e-15)
        both = [passed(law(own), threshold=0.4) for own in LEFT]
        np.testing.assert_allclose(
            passed(effect, threshold=0.4, lingers=0.5), np.mean(both, axis=0), rtol=1e-6, atol=1e-15
        )


def test_thresholds_that_differ_pass_what_exceeds_them_whole(double_precision):
    """Each way its own; nothing of a command is lost once it moves, and at a threshold of zero nothing at all."""
    robot, u = Axis(), np.array([-2.0, -0.35, -0.25, 0.0, 0.35, 0.65, 0.75, 2.0])
    time, steps = 0.02 * np.arange(8.0), np.full(8, 0.02)

    def left(effect, **values):
        numbers = {effect.key(name): value for name, value in values.items()}
        return effect.command(jnp.asarray(u)[:, None], time, steps, numbers, robot)[:, 0]

    effect = law("unequal_thresholds")
    np.testing.assert_allclose(
        left(effect, threshold_forward=0.7, threshold_backward=0.3), [-2.0, -0.35, 0.0, 0.0, 0.0, 0.0, 0.75, 2.0]
    )
    np.testing.assert_allclose(left(effect, threshold_forward=0.0, threshold_backward=0.0), u)
    same = left(effect, threshold_forward=0.3, threshold_backward=0.3)
    np.testing.assert_allclose(same, left(law("threshold"), threshold=0.3))
    assert effect.blurred.edge > effect.edge and effect.blurred.sharp == effect


GAIN, EMF, WINDING, DROP, FULL = 30.3, 11.3, 0.3, 0.7, 2.0
TRUE = {"M": 60.0, "Fv": 40.0, "Fc": 35.0, "offset": 0.0}


def conveyor(seed, full, seconds=12.0):
    """A belt by small steps, with dry friction that holds it, whose bridge loses `DROP` volts with its dead time, all of it
    from a current of `full` on: u = back-EMF + R i + DROP clip(i / full, -1, 1)."""
    rng, dt, fine = np.random.default_rng(seed), 0.02, 40
    volts = np.repeat(rng.uniform(-6.0, 6.0, int(seconds / 0.4) + 1), 20)[: int(seconds / dt)]
    v, seen = 0.0, np.zeros(len(volts))
    for k, u in enumerate(volts):
        seen[k] = v
        for _ in range(fine):
            x = u - EMF * v
            small = x / (WINDING + DROP / full)
            current = small if abs(small) < full else (x - np.sign(x) * DROP) / WINDING
            ahead = v + dt / fine * (GAIN * WINDING * current - TRUE["Fv"] * v) / TRUE["M"]
            held = dt / fine * TRUE["Fc"] / TRUE["M"]
            v = ahead - np.clip(ahead, -held, held)
    noisy = seen + 0.003 * rng.normal(size=len(seen))
    return Log.from_arrays(f"run {seed}", dt * np.arange(len(volts)), volts[:, None], {"v": noisy}, "axis")


BELT = Axis().with_values(gain=GAIN, back_emf=EMF, M=68.0, Fv=40.0, Fc=54.0, offset=0.0)


@pytest.mark.parametrize(("full", "name"), [(1e-3, "by_current"), (2.0, "by_current_gradual")])
def test_what_a_bridge_loses_by_the_sign_of_its_current_is_found_and_the_rest_comes_right(full, name):
    effect = effect_by_id(BELT, "actuator_dead_zone", name)
    logs = LogSet([conveyor(seed, full) for seed in range(3)])
    begun = {effect.key("drop"): 0.2}
    fit = output_error(BELT + effect, logs, start=begun)
    assert fit.judgement.verdict == "sound"
    for parameter, true in {**TRUE, effect.key("drop"): DROP}.items():
        assert abs(fit[parameter].value - true) < 4.0 * fit[parameter].std_error, parameter
    assert fit[effect.key("drop")].std_error < 0.05 * DROP
    # A robot whose drive knows no back-EMF has a dead zone of the command instead.
    assert effect.refusal(Axis()) and not effect.refusal(BELT)


@pytest.mark.slow
@pytest.mark.parametrize(("full", "name"), [(1e-3, "by_current"), (2.0, "by_current_gradual")])
def test_dead_time_is_named(full, name):
    fitted, held_out = (LogSet([conveyor(seed, full) for seed in seeds]) for seeds in (range(3), (7, 8)))
    story = explain(output_error(BELT, fitted), fitted, held_out)
    assert (story.verdict, [(e.id, e.law) for e in story.effects]) == ("named", [("actuator_dead_zone", name)])

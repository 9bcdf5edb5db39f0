"""Noise of the inputs, as they were measured or as they acted, told from what a model lacks: on a drive of two motors by
another integrator, with dry friction that sticks and constants of its own."""

import numpy as np
import pytest

from jaxid import DifferentialDrive, Log, LogSet, explain, output_error
from jaxid.effects import effect_by_id
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.left.noisy_inputs import noise_of_inputs
from jaxid.simulation.scaled import scaled_to, scales_of

DT, FINE, SAMPLES = 0.02, 10, 630
M, J, B, FV, FC, GAIN = 14.0, 0.5, 0.21, 4.0, 3.0, 2.2
NOISE = {"v": 0.006, "w": 0.012}


def motion(u, drag=0.0, push=0.0):
    """Speeds [T, 2] under commands [T, 2] of the right and the left motor, by semi-implicit steps of 2 ms; dry friction acts on
    each side where it moves, or holds it."""
    h, v, w, found = DT / FINE, 0.0, 0.0, []
    inverse = np.array([[1 / M + B**2 / J, 1 / M - B**2 / J], [1 / M - B**2 / J, 1 / M + B**2 / J]])
    for t, own in enumerate(u):
        found.append((v, w))
        for _ in range(FINE):
            sides = np.array([v + B * w, v - B * w])
            force = GAIN * own - FV / 2.0 * sides - drag * sides * np.abs(sides) + push * np.sin(0.7 * t * DT)
            sides = sides + h * inverse @ force
            # Gauss-Seidel for the friction of both sides: each takes as much of its speed as it may.
            held = np.zeros(2)
            for _ in range(6):
                for i in range(2):
                    free = sides[i] + inverse[i] @ held - inverse[i, i] * held[i]
                    held[i] = -np.sign(free) * min(abs(free) / inverse[i, i], h * FC / 2.0)
            sides = sides + inverse @ held
            v, w = sides.sum() / 2.0, (sides[0] - sides[1]) / (2.0 * B)
    return np.array(found)


def logs(measured, acting=lambda u, rng: u, **law):
    """Six logs to fit and two held out, whose commands are `measured(u, rng)`, and act as `acting(u, rng)`."""
    every, channels = [], DifferentialDrive().channels
    for seed in range(8):
        rng = np.random.default_rng([41, seed])
        levels = rng.uniform(2.0, 6.0, (18, 1)) * rng.choice([-1, 0, 1, 1], (18, 1)) + rng.uniform(-1.5, 1.5, (18, 2))
        u = np.repeat(levels, SAMPLES // 18, axis=0)
        u[:50] = 0.0
        seen = measured(u, rng)
        outputs = motion(acting(u, rng), **law) + rng.normal(size=(SAMPLES, 2)) * list(NOISE.values())
        every.append(Log.from_arrays(f"run {seed}", DT * np.arange(SAMPLES), seen, outputs, channels))
    return LogSet(every[:6]), LogSet(every[6:])


def robot():
    begin = DifferentialDrive().with_values(M=10.0, J=0.3, Fv=3.0, Fc=2.0, b=B, gain=GAIN)
    fixed = [name for name in begin.parameters.free_names if name not in ("M", "J", "Fv", "Fc")]
    for name in fixed:
        begin = begin.change(name, free=False)
    return begin


def told(fit_logs, held_out):
    """What is said of the noise of the inputs beside a fit, at the level of one in a thousand."""
    fit = output_error(robot(), fit_logs)
    own = scaled_to(fit.robot, fit_logs)
    states = [(held_out_state(own, some, NOISE), some) for some in (held_out, fit_logs)]
    return noise_of_inputs(own, states, NOISE, scales_of(own, fit_logs), 1e-3)


def in_proportion(size):
    return lambda u, rng: u * (1.0 + size * rng.normal(size=u.shape))


def of_the_supply(size):
    return lambda u, rng: u * (1.0 + size * rng.normal(size=(len(u), 1)))


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "kind", "size"), [(in_proportion(0.08), 1, 0.08), (of_the_supply(0.06), 2, 0.06)])
def test_noise_of_the_inputs_is_told_with_its_size(noise, kind, size):
    found = told(*logs(noise))
    assert found is not None
    assert found.sizes[kind] == pytest.approx(size, rel=0.25)
    assert np.hypot(*(own for k, own in enumerate(found.sizes) if k != kind)) < size / 2.0


@pytest.mark.slow
def test_a_lag_of_the_sensors_that_is_none_changes_nothing():
    """Every output is then a state of the filter of its own, which shows what the robot's states do."""
    some = LogSet(list(logs(in_proportion(0.08))[0])[:4])
    plain = scaled_to(output_error(robot(), some).robot, some)
    lag = effect_by_id(plain, "sensor_lag", "first_order")

    def found(own):
        return noise_of_inputs(own, [(held_out_state(own, some, NOISE), some)], NOISE, scales_of(own, some), 1e-3)

    late = found((plain + lag).with_values(**{lag.key("time_constant"): 1e-7}))
    assert late is not None and late.sizes == pytest.approx(found(plain).sizes, rel=0.02)
    assert late.sizes[1] == pytest.approx(0.08, rel=0.25)


@pytest.mark.parametrize(
    "law",
    [
        pytest.param({"drag": 1.5}, id="drag", marks=pytest.mark.slow),
        pytest.param({"push": 1.0}, id="a push that swings", marks=pytest.mark.slow),
    ],
)
def test_what_a_model_lacks_beside_it_is_not_taken_for_it(law):
    assert told(*logs(in_proportion(0.08), **law)) is None


@pytest.mark.slow
def test_a_robot_whose_commands_are_noisy_lacks_nothing():
    fit_logs, held_out = logs(lambda u, rng: u, acting=lambda u, rng: u + 0.5 * rng.normal(size=u.shape))
    found = explain(output_error(robot(), fit_logs), fit_logs, held_out, most=1)
    assert found.before.normalised_rms > 1.3
    assert found.verdict == "adequate" and not found.effects, found.sentence
    assert "what noise of the inputs makes of the motion" in found.sentence
    assert set(found.to_dict()["colour"]["noise_of_inputs"]) == {"of_usual_input", "of_each_input", "of_all_inputs"}

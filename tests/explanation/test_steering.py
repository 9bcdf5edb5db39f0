"""What goes wrong with steering is named on a car that a user wrote, simulated here by small steps with true dry friction."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxid
from jaxid import Channels, Custom, Log, LogSet, Parameter
from jaxid.effects import effect_by_id
from jaxid.robots.probe import Seen

CHANNELS = Channels(
    inputs=("throttle", "steering"),
    outputs=("v", "w"),
    units={"throttle": "V", "steering": "rad", "v": "m/s", "w": "rad/s"},
)
INTERVAL, STEPS = 0.02, 40
FASTEST = 3.0
"""Largest speed of a servo [rad/s]."""
TRUE = {"push": 4.0, "mass": 3.2, "viscous": 1.7, "coulomb": 0.9, "wheelbase": 0.26, "yaw_time": 0.12}


def _steered(kind: str, size: float, steering: np.ndarray) -> np.ndarray:
    """What the wheels are steered to, one row a small step, by commands [T]."""
    fine, dt = np.repeat(steering, STEPS), INTERVAL / STEPS
    if kind == "delay":
        late = round(size / dt)
        return np.concatenate([np.zeros(late), fine])[: len(fine)]
    if kind == "trim":
        return fine + size
    if kind == "linkage":  # the ideal angle of an inner wheel, of which the command is the middle one
        return np.arctan(np.tan(fine) / (1.0 + size * np.tan(fine)))
    found, at = np.zeros(len(fine)), 0.0
    for k, wanted in enumerate(fine):
        if kind == "rate":
            step = np.clip(wanted - at, -dt / size, dt / size)
        else:
            step = (wanted - at) * (1.0 - np.exp(-dt / size))
            step = np.clip(step, -FASTEST * dt, FASTEST * dt) if kind == "limited servo" else step
        at += step
        found[k] = at
    return found


def _log(kind: str, size: float, seed: int) -> Log:
    rng, samples, p, dt = np.random.default_rng(seed), 700, TRUE, INTERVAL / STEPS
    throttle = np.repeat(rng.uniform(0.2, 2.5, 40) * np.where(rng.random(40) < 0.2, -1.0, 1.0), 18)[:samples]
    steering = np.repeat(rng.uniform(-0.45, 0.45, 50), 15)[:samples]
    angle, v, w, seen = _steered(kind, size, steering), 0.0, 0.0, np.zeros((samples, 2))
    for k in range(samples):
        seen[k] = v, w
        for a in angle[k * STEPS : (k + 1) * STEPS]:
            force = p["push"] * throttle[k] - p["viscous"] * v
            if v == 0.0 and abs(force) <= p["coulomb"]:
                after = 0.0
            else:
                after = v + dt * (force - p["coulomb"] * np.sign(v if v != 0.0 else force)) / p["mass"]
                after = 0.0 if v * after < 0.0 else after
            w += dt * (v * np.tan(a) / p["wheelbase"] - w) / p["yaw_time"]
            v = after
    noisy = seen + rng.normal(size=seen.shape) * [0.01, 0.03]
    return Log.from_arrays(
        f"run {seed}", INTERVAL * np.arange(samples), np.stack([throttle, steering], 1), noisy, CHANNELS
    )


def _rates(state, u, p, friction):
    wanted = state["v"] * jnp.tan(u["steering"]) / p["wheelbase"]
    return {
        "v": (p["push"] * u["throttle"] - p["viscous"] * state["v"] - friction["wheels"]) / p["mass"],
        "w": (wanted - state["w"]) / p["yaw_time"],
    }


CAR = Custom(
    dynamics=_rates,
    state_names=("v", "w"),
    own_channels=CHANNELS,
    dry_friction={"wheels": ("v", "coulomb")},
    velocities=("v",),
    title="car",
    table={
        "push": Parameter(4.0, "N/V"),
        "mass": Parameter(3.0, "kg", free=True, lower=0.1),
        "viscous": Parameter(1.0, "N s/m", free=True, lower=0.0),
        "coulomb": Parameter(0.5, "N", free=True, lower=0.0),
        "wheelbase": Parameter(0.3, "m", free=True, lower=0.01),
        "yaw_time": Parameter(0.1, "s", free=True, lower=0.001),
    },
)


@pytest.mark.parametrize(
    ("kind", "size", "named"),
    [
        pytest.param("servo", 0.12, "steering_lag", marks=pytest.mark.slow),
        pytest.param("limited servo", 0.06, "steering_lag", marks=pytest.mark.slow),
        pytest.param("delay", 0.08, "steering_delay", marks=pytest.mark.slow),
        ("trim", 0.04, "steering_error"),
        pytest.param("rate", 0.5, "steering_lag", marks=pytest.mark.slow),
        pytest.param("linkage", 0.3, "steering_error", marks=pytest.mark.slow),
    ],
)
def test_what_is_wrong_with_steering_is_named_and_nothing_else(kind, size, named):
    fitted, held_out = (LogSet([_log(kind, size, seed) for seed in seeds]) for seeds in (range(4), (10, 11)))
    story = jaxid.explain(jaxid.output_error(CAR, fitted), fitted, held_out)
    assert (story.verdict, [effect.id for effect in story.effects]) == ("named", [named])
    assert story.before.normalised_rms > 4.0 and story.after.normalised_rms < 1.03
    wheelbase = story.final.parameters[
        "wheelbase"
    ]  # a curve of the command may take up some of it, and its error says so
    assert abs(wheelbase.value - TRUE["wheelbase"]) < 3.0 * wheelbase.std_error


@pytest.mark.slow  # twelve seconds
def test_a_servo_of_a_largest_speed_is_looked_for_at_times_from_which_a_slope_leads_on():
    """At a time of zero there is none: a refit from there ends at the speed alone."""
    law = effect_by_id(CAR, "steering_lag", "servo")
    probes = law.probes(CAR + law, Seen(1.0, 10.0, lambda: None, lambda by_torque: ((), 0)))
    assert len(probes) > 3
    for probe in probes:
        assert all(value > 0.0 for value in (*probe.shape.values(), *probe.strengths.values()))
    steered, time = "steering_lag.time_per_unit_steering", "steering_lag.time_constant"
    logs = LogSet([_log("limited servo", 0.06, seed) for seed in range(2)])
    fit = jaxid.output_error(CAR + law, logs, start={**probes[0].shape, **probes[0].strengths})
    assert abs(fit[time].value - 0.06) < max(4.0 * fit[time].std_error, 0.001)
    assert abs(fit[steered].value - 1.0 / FASTEST) < max(4.0 * fit[steered].std_error, 0.005)

"""A robot with motors that is integrated in one step a sample: no law of its motors may spoil what the others promise."""

import numpy as np
import pytest

from jaxid import Channels, Custom, DriveAxis, Log, LogSet, Parameter
from jaxid.effects import laws_of
from jaxid.explanation.screening.screen import screen
from jaxid.simulation.scaled import scaled_to
from jaxid.simulation.simulate import integrator_for

NOMINAL, WINDING, CONSTANT, MASS, VISCOUS, RESISTANCE = 24.0, 0.55, 0.9, 20.0, 3.0, 0.2
NOISE = 0.005


def current(state, u, p):
    return {"u": (u["u"] - p["k"] * state["v"]) / p["R"]}


def dynamics(state, u, p, friction):
    return {"v": (p["k"] * current(state, u, p)["u"] - p["fv"] * state["v"] - friction["wheel"]) / p["mass"]}


def cart():
    table = {
        "mass": Parameter(MASS, "kg", free=True, lower=0.1), "fv": Parameter(VISCOUS, "N s/m", free=True, lower=0.0),
        "fc": Parameter(0.0, "N", lower=0.0), "R": Parameter(WINDING, "ohm"), "k": Parameter(CONSTANT, "V s/m"),
    }  # fmt: skip
    wheel = DriveAxis(
        speed=lambda s, p: s["v"], coulomb="fc", viscous="fv", torque=lambda s, u, p: p["k"] * current(s, u, p)["u"]
    )
    return Custom(
        dynamics=dynamics, state_names=("v",), table=table, axes={"wheel": wheel}, forces={"v": "mass"},
        own_channels=Channels(inputs=("u",), outputs=("v",), units={"u": "V", "v": "m/s"}), velocities=("v",),
        motor_currents=current, winding="R", supply_voltage=NOMINAL, title="cart",
    )  # fmt: skip


def driven(seed, samples=1500, dt=0.02, fine=100):
    """A log whose battery has an inner resistance, by small steps of Euler's method."""
    random = np.random.default_rng(seed)
    volts, speed, v = np.repeat(random.uniform(-12, 12, samples // 25), 25), np.zeros(samples), 0.0
    for k, duty in enumerate(volts / NOMINAL):
        speed[k] = v
        for _ in range(fine):
            supply = (NOMINAL + RESISTANCE * duty * CONSTANT * v / WINDING) / (1.0 + RESISTANCE * duty**2 / WINDING)
            force = CONSTANT * (duty * supply - CONSTANT * v) / WINDING - VISCOUS * v
            v += dt / fine * force / MASS
    seen = speed + NOISE * random.normal(size=samples)
    return Log.from_arrays(f"{seed}", dt * np.arange(samples), volts[:, None], seen[:, None], cart())


@pytest.mark.filterwarnings("ignore::jaxid.LogWarning")
def test_a_sagging_battery_is_seen_beside_the_other_laws_of_motors():
    logs = LogSet([driven(seed) for seed in range(2)])
    robot = scaled_to(cart(), logs)
    assert integrator_for(robot, logs).substeps == 1
    motors = ("battery_sag", "motor_heating", "freewheeling_driver", "motor_lag", "voltage_saturation")
    effects = [law for name in motors for law in laws_of(robot, name)]
    found = screen(robot, logs, effects, {"v": NOISE}, {})
    assert {candidate.effect.id for candidate in found} == set(motors)
    assert found[0].effect.id == "battery_sag" and found[0].share > 0.9

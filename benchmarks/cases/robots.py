"""The families of built-in robots, and all families by name."""

from functools import cache

import numpy as np

import jaxid
from benchmarks.cases.family import Family, Numbers, Rng, Units, between, signal
from benchmarks.cases.other_robots import BELT_FAMILY, CART_FAMILY, UNICYCLE_FAMILY
from benchmarks.cases.own_robots import (
    CRANE_FAMILY,
    DRIVE_FAMILY,
    PENDULUM_FAMILY,
    RIM_FAMILY,
    TWO_FAMILY,
    VELOCITY_FAMILY,
)
from reference import mechanisms as me
from reference.axis import AXIS
from reference.effects import complete, kernel_vector
from reference.omni import OMNI
from reference.pioneer import PIONEER
from reference.robot import Robot as Simulated


# -- simulators ------------------------------------------------------------------------------------------------------
def _robot_states(robot: Simulated):
    def states(p: Numbers, effects: dict, start, time, inputs, forces):
        e = kernel_vector(complete(effects, robot.name))
        vector = np.array([p[name] for name in robot.parameters])
        layout = robot.first, len(robot.speeds), robot.n_axes
        return me.states_at(robot.dynamics, vector, e, start, time, np.hstack([inputs, forces]), layout)

    return states


# -- axis ------------------------------------------------------------------------------------------------------------
def _axis_draw(rng: Rng) -> Numbers:
    Cv = between(rng, 0.5, 4.0)
    return {"J": 1.0, "k": 1.0, "Cv": Cv, "Cs": between(rng, 0.1, 1.0), "offset": float(rng.choice([0.0, 0.1, -0.1]))}


def _axis_model(p: Numbers, u: Units) -> jaxid.Robot:
    return jaxid.Axis().with_values(
        M=p["J"] * u.mass, Fv=p["Cv"] * u.mass / u.time, Fc=p["Cs"] * u.force, offset=-p["offset"] * u.force,
        gain=p["k"] * u.force / u.input,
    )  # fmt: skip


AXIS_FAMILY = Family(
    name="axis",
    share=0.2,
    draw=_axis_draw,
    excite=lambda rng, n, kind, p: signal(rng, n, kind, 4.0, p["Cs"])[:, None],
    states=_robot_states(AXIS),
    see=lambda x, p: x[:, [1]],
    move=lambda rng, p: np.array([0, rng.uniform(0.3, 1.0), 0, 0, 0, 0, 0]),
    rest=lambda p: np.zeros(7),
    model=_axis_model,
    output_units=lambda u: (u.speed,),
    input_units=lambda u: (u.input,),
    forces=lambda p: (2.0,),
    effects={
        "drag": lambda rng, p: {"quadratic_drag": {"coefficient": between(rng, 0.2, 2.0)}},
        "stribeck": lambda rng, p: {"stribeck_friction": {"amplitude": p["Cs"] * rng.uniform(0.5, 1.5), "speed": 0.1}},
        "lag": lambda rng, p: {"motor_lag": {"time_constant": between(rng, 0.03, 0.3)}},
        "asymmetric": lambda rng, p: {"asymmetric_friction": {"asymmetry": rng.uniform(0.1, 0.5)}},
    },
)


# -- Pioneer ---------------------------------------------------------------------------------------------------------
def _pioneer_draw(rng: Rng) -> Numbers:
    p = dict(PIONEER.parameters)
    for name in ("I0", "Ir1", "Ir", "Ip1", "Cs1", "Cv1", "Cs", "Cv"):
        p[name] *= between(rng, 0.5, 2.0)
    p["Cs"] = PIONEER.parameters["Cs"] * between(rng, 0.4, 1.3)
    return p


def _pioneer_model(p: Numbers, u: Units) -> jaxid.Robot:
    factor = dict.fromkeys(("R", "R1", "L", "l1", "d", "xm", "ym"), u.length)
    factor |= dict.fromkeys(("M", "m", "m1"), u.mass) | dict.fromkeys(("I0", "Ir", "Ir1", "Ip", "Ip1"), u.inertia)
    factor |= dict.fromkeys(("Cs", "Cs1", "tau_fr"), u.torque) | dict.fromkeys(("Cv", "Cv1"), u.torque * u.time)
    factor |= {"KT": u.torque / u.input, "KE": u.input * u.time, "Ra": 1.0, "tr": 1.0, "mu": 1.0}
    return jaxid.Pioneer().with_values(**{name: p[name] * factor[name] for name in p})


def _pioneer_excite(rng: Rng, n: int, kind: str, p: Numbers) -> np.ndarray:
    common = signal(rng, n, kind, 7.0, 0.7)
    turn = signal(rng, n, "good" if kind == "one way" else kind, 2.0, 0.2)
    common[:25], turn[:25] = 4.0, 0.0  # the caster trails
    return np.stack([common + turn, common - turn], 1)


def _pioneer_move(rng: Rng, p: Numbers) -> np.ndarray:
    x = np.zeros(17)
    x[4], x[5] = rng.uniform(0.1, 0.4), rng.uniform(-0.5, 0.5)
    return x


PIONEER_FAMILY = Family(
    name="pioneer",
    share=0.1,
    draw=_pioneer_draw,
    excite=_pioneer_excite,
    states=_robot_states(PIONEER),
    see=lambda x, p: x[:, 4:6],
    move=_pioneer_move,
    rest=lambda p: np.zeros(17),
    model=_pioneer_model,
    output_units=lambda u: (u.speed, 1 / u.time),
    input_units=lambda u: (u.input, u.input),
    forces=lambda p: (5.0, 0.5),
    effects={
        "drag": lambda rng, p: {"quadratic_drag": {"coefficient": between(rng, 2.0, 30.0)}},
        "stribeck": lambda rng, p: {"stribeck_friction": {"amplitude": p["Cs"] * rng.uniform(0.5, 1.5), "speed": 0.1}},
        "slope": lambda rng, p: {"ground_slope": {"angle": rng.uniform(0.01, 0.05), "direction": 1.0}},
    },
)


# -- omni ------------------------------------------------------------------------------------------------------------
def _omni_draw(rng: Rng) -> Numbers:
    p = dict(OMNI.parameters)
    for name in ("J", "Bv", "Bvn", "Bw", "Cv", "Cvn", "Cw"):
        p[name] *= between(rng, 0.5, 1.6)
    return p


def _omni_model(p: Numbers, u: Units) -> jaxid.Robot:
    factor = {"M": u.mass, "J": u.inertia, "b": u.length, "r": u.length, "l": 1.0, "Ra": 1.0}
    factor |= {"Kt": u.torque / u.input, "Kv": u.input * u.time}
    factor |= {"Bv": u.mass / u.time, "Bvn": u.mass / u.time, "Bw": u.torque * u.time}
    factor |= {"Cv": u.force, "Cvn": u.force, "Cw": u.torque}
    return jaxid.Omni().with_values(supply=100 * u.input, **{name: p[name] * f for name, f in factor.items()})


def _omni_excite(rng: Rng, n: int, kind: str, p: Numbers) -> np.ndarray:
    ahead, side = signal(rng, n, kind, 5.0, 2.2), signal(rng, n, kind, 5.0, 2.2)
    turn = signal(rng, n, kind, 2.0, 1.0)
    return np.stack([side + turn, -ahead + turn, -side + turn, ahead + turn], 1)


def _omni_move(rng: Rng, p: Numbers) -> np.ndarray:
    x = np.zeros(28)
    x[3:6] = rng.uniform(0.1, 0.4), rng.uniform(-0.3, 0.3), rng.uniform(-0.5, 0.5)
    return x


OMNI_FAMILY = Family(
    name="omni",
    share=0.12,
    draw=_omni_draw,
    excite=_omni_excite,
    states=_robot_states(OMNI),
    see=lambda x, p: x[:, 3:6],
    move=_omni_move,
    rest=lambda p: np.zeros(28),
    model=_omni_model,
    output_units=lambda u: (u.speed, u.speed, 1 / u.time),
    input_units=lambda u: (u.input,) * 4,
    forces=lambda p: (20.0, 2.0),
    effects={
        "drag": lambda rng, p: {"quadratic_drag": {"coefficient": between(rng, 3.0, 50.0)}},
        "stribeck": lambda rng, p: {"stribeck_friction": {"amplitude": p["Cv"] * rng.uniform(0.3, 1.0), "speed": 0.1}},
        "slope": lambda rng, p: {"ground_slope": {"angle": rng.uniform(0.01, 0.05), "direction": 1.0}},
        "lag": lambda rng, p: {"motor_lag": {"time_constant": between(rng, 0.03, 0.2)}},
    },
)


@cache
def families() -> dict[str, Family]:
    """The families of the plain draw by name."""
    every = (
        AXIS_FAMILY,
        PIONEER_FAMILY,
        OMNI_FAMILY,
        PENDULUM_FAMILY,
        CRANE_FAMILY,
        TWO_FAMILY,
        VELOCITY_FAMILY,
        RIM_FAMILY,
        DRIVE_FAMILY,
    )
    return {family.name: family for family in every}


@cache
def all_families() -> dict[str, Family]:
    """Those and the ones of the wide draw, by name."""
    return families() | {family.name: family for family in (BELT_FAMILY, UNICYCLE_FAMILY, CART_FAMILY)}

"""The families: built-in robots, and robots as users write them with `jaxid.Custom`."""

from dataclasses import replace
from functools import cache

import jax.numpy as jnp
import numpy as np

import jaxid
from benchmarks.cases.family import Family, Numbers, Rng, Units, signal
from jaxid import Channels, Custom, Parameter
from reference import mechanisms as me
from reference.axis import AXIS
from reference.effects import complete, kernel_vector
from reference.omni import OMNI
from reference.pioneer import PIONEER
from reference.robot import Robot as Simulated


def between(rng: Rng, low: float, high: float) -> float:
    """A number in [low, high], every magnitude as likely as the other."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


# -- simulators ------------------------------------------------------------------------------------------------------
def _mechanism_states(mechanism: me.Mechanism):
    def states(p: Numbers, effects: dict, start, time, inputs, forces):
        e = np.zeros(len(me.E))
        e[me.E.stribeck_speed] = 1.0
        for name, value in effects.items():
            e[me.E[name]] = value
        vector = np.array([p[symbol.name] for symbol in mechanism.symbols])
        layout = mechanism.first, mechanism.speeds, mechanism.n_axes
        return me.states_at(mechanism.dynamics, vector, e, start, time, np.hstack([inputs, forces]), layout)

    return states


def _robot_states(robot: Simulated):
    def states(p: Numbers, effects: dict, start, time, inputs, forces):
        e = kernel_vector(complete(effects, robot.name))
        vector = np.array([p[name] for name in robot.parameters])
        layout = robot.first, len(robot.speeds), robot.n_axes
        return me.states_at(robot.dynamics, vector, e, start, time, np.hstack([inputs, forces]), layout)

    return states


def free(value: float, positive: bool = True) -> Parameter:
    """A free parameter as users write them."""
    return Parameter(value, free=True, lower=0.0 if positive else -np.inf)


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


# -- Custom: pendulum ------------------------------------------------------------------------------------------------
def _pendulum_rates(state, inputs, p, friction):
    torque = p["k"] * inputs["u"] - p["b"] * state["w"] - p["mgl"] * jnp.sin(state["q"]) - friction["pivot"]
    return {"q": state["w"], "w": torque / p["J"]}


_PENDULUM_CHANNELS = Channels(inputs=("u",), outputs=("q",), units={"q": "rad", "u": "N m"})


def _pendulum_model(p: Numbers, u: Units) -> jaxid.Robot:
    table = {
        "J": free(p["J"] * u.inertia), "b": free(p["b"] * u.torque * u.time), "mgl": free(p["mgl"] * u.torque),
        "tau": free(p["tau"] * u.torque), "k": Parameter(p["k"] * u.torque / u.input),
    }  # fmt: skip
    return Custom(
        dynamics=_pendulum_rates, state_names=("q", "w"), own_channels=_PENDULUM_CHANNELS, table=table,
        dry_friction=(("pivot", "w", "tau"),), title="pendulum",
    )  # fmt: skip


def _pendulum_draw(rng: Rng) -> Numbers:
    mgl = (2 * np.pi * rng.uniform(0.5, 1.3)) ** 2
    b = 2 * between(rng, 0.03, 0.4) * np.sqrt(mgl)
    return {"J": 1.0, "k": 1.0, "b": b, "mgl": mgl, "tau": mgl * between(rng, 0.01, 0.12)}


def _mechanism_effects(drag: tuple[float, float], stribeck_speed: float, friction: str, slope: float) -> dict:
    return {
        "drag": lambda rng, p: {"drag": between(rng, *drag)},
        "stribeck": lambda rng, p: {
            "stribeck": p.get(friction, 0.3) * rng.uniform(0.5, 1.5),
            "stribeck_speed": stribeck_speed,
        },
        "slope": lambda rng, p: {"slope": slope * rng.uniform(0.3, 1.0)},
    }


PENDULUM_FAMILY = Family(
    name="pendulum",
    share=0.14,
    draw=_pendulum_draw,
    excite=lambda rng, n, kind, p: signal(rng, n, kind, rng.uniform(0.3, 1.0) * p["mgl"], p["tau"])[:, None],
    states=_mechanism_states(me.PENDULUM),
    see=lambda x, p: x[:, [0]],
    move=lambda rng, p: np.array([rng.uniform(-1.5, 1.5), rng.uniform(-2, 2)]),
    rest=lambda p: np.zeros(2),
    model=_pendulum_model,
    output_units=lambda u: (1.0,),
    input_units=lambda u: (u.input,),
    forces=lambda p: (0.3 * p["mgl"],),
    effects=_mechanism_effects((0.05, 1.0), 0.5, "tau", 3.0),
    has_length=False,
    angle_outputs=(0,),
)


# -- Custom: crane ---------------------------------------------------------------------------------------------------
def _crane_rates(state, inputs, p, friction):
    sin, cos = jnp.sin(state["phi"]), jnp.cos(state["phi"])
    m, rod, v, w = p["m"], p["l"], state["v"], state["w"]
    force = inputs["u"] - p["b"] * v + m * rod * w * w * sin - friction["rail"]
    moment = -m * p["g"] * rod * sin - p["c"] * w
    a, c, d = p["M"] + m, m * rod * cos, m * rod * rod
    det = a * d - c * c
    return {"q": v, "phi": w, "v": (d * force - c * moment) / det, "w": (a * moment - c * force) / det}


_CRANE_CHANNELS = Channels(inputs=("u",), outputs=("q", "phi"), units={"q": "m", "phi": "rad", "u": "N"})


def _crane_model(p: Numbers, u: Units) -> jaxid.Robot:
    # The input of this family is a force: its unit is that of forces.
    table = {
        "M": free(p["M"] * u.mass), "m": free(p["m"] * u.mass), "b": free(p["b"] * u.mass / u.time),
        "Fc": free(p["Fc"] * u.force), "c": free(p["c"] * u.torque * u.time),
        "l": Parameter(p["l"] * u.length), "g": Parameter(p["g"] * u.length / u.time**2),
    }  # fmt: skip
    return Custom(
        dynamics=_crane_rates, state_names=("q", "phi", "v", "w"), own_channels=_CRANE_CHANNELS, table=table,
        dry_friction=(("rail", "v", "Fc"),), title="crane",
    )  # fmt: skip


CRANE_FAMILY = Family(
    name="crane",
    share=0.1,
    draw=lambda rng: {
        "M": between(rng, 0.5, 2.0),
        "m": between(rng, 0.2, 1.0),
        "l": between(rng, 0.15, 0.6),
        "g": 9.81,
        "b": between(rng, 0.5, 3.0),
        "Fc": between(rng, 0.2, 1.0),
        "c": between(rng, 0.003, 0.03),
    },  # fmt: skip
    excite=lambda rng, n, kind, p: signal(rng, n, kind, 6.0, p["Fc"])[:, None],
    states=_mechanism_states(me.CRANE),
    see=lambda x, p: x[:, [0, 1]],
    move=lambda rng, p: np.array([rng.uniform(-1, 1), rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), 0.0]),
    rest=lambda p: np.zeros(4),
    model=_crane_model,
    output_units=lambda u: (u.length, 1.0),
    input_units=lambda u: (u.force,),
    forces=lambda p: (2.0,),
    effects=_mechanism_effects((0.3, 3.0), 0.15, "Fc", 0.5),
    angle_outputs=(1,),
)


# -- Custom: two masses ----------------------------------------------------------------------------------------------
def _two_rates(state, inputs, p, friction):
    between_ = p["s"] * (state["x1"] - state["x2"]) + p["d"] * (state["v1"] - state["v2"])
    force = p["k"] * inputs["u"] - p["b"] * state["v1"] - between_ - friction["slide"]
    return {"x1": state["v1"], "x2": state["v2"], "v1": force / p["m1"], "v2": between_ / p["m2"]}


_TWO_CHANNELS = Channels(inputs=("u",), outputs=("v1", "x2"), units={"v1": "m/s", "x2": "m", "u": "V"})


def _two_model(p: Numbers, u: Units) -> jaxid.Robot:
    rate = u.mass / u.time
    table = {
        "m1": free(p["m1"] * u.mass), "m2": free(p["m2"] * u.mass), "s": free(p["s"] * u.mass / u.time**2),
        "d": free(p["d"] * rate), "b": free(p["b"] * rate), "Fc": free(p["Fc"] * u.force),
        "k": Parameter(p["k"] * u.force / u.input),
    }  # fmt: skip
    return Custom(
        dynamics=_two_rates, state_names=("x1", "x2", "v1", "v2"), own_channels=_TWO_CHANNELS, table=table,
        dry_friction=(("slide", "v1", "Fc"),), title="two masses",
    )  # fmt: skip


TWO_FAMILY = Family(
    name="two masses",
    share=0.12,
    draw=lambda rng: {
        "m1": between(rng, 0.5, 1.5),
        "m2": between(rng, 0.2, 1.0),
        "s": between(rng, 20.0, 150.0),
        "d": between(rng, 0.1, 1.0),
        "b": between(rng, 0.5, 3.0),
        "Fc": between(rng, 0.1, 0.8),
        "k": 1.0,
    },  # fmt: skip
    excite=lambda rng, n, kind, p: signal(rng, n, kind, 4.0, p["Fc"])[:, None],
    states=_mechanism_states(me.TWO_MASSES),
    see=lambda x, p: x[:, [2, 1]],
    move=lambda rng, p: np.array([0.0, rng.uniform(-0.05, 0.05), *rng.uniform(-0.5, 0.5, 2)]),
    rest=lambda p: np.zeros(4),
    model=_two_model,
    output_units=lambda u: (u.speed, u.length),
    input_units=lambda u: (u.input,),
    forces=lambda p: (1.5,),
    effects=_mechanism_effects((0.2, 2.0), 0.1, "Fc", 0.5),
)


# -- Custom: velocity-commanded drive --------------------------------------------------------------------------------
def _velocity_rates(state, inputs, p):
    return {
        "v": (p["Kv"] * inputs["vc"] - state["v"]) / p["Tv"],
        "w": (p["Kw"] * inputs["wc"] - state["w"]) / p["Tw"],
    }


_VELOCITY_CHANNELS = Channels(inputs=("vc", "wc"), outputs=("v", "w"), units={"v": "m/s", "w": "rad/s"})


def _velocity_model(p: Numbers, u: Units) -> jaxid.Robot:
    table = {
        "Tv": free(p["Tv"] * u.time), "Kv": free(p["Kv"] * u.speed / u.input),
        "Tw": free(p["Tw"] * u.time), "Kw": free(p["Kw"] / u.time / u.input),
    }  # fmt: skip
    return Custom(
        dynamics=_velocity_rates, state_names=("v", "w"), own_channels=_VELOCITY_CHANNELS, table=table,
        title="velocity drive",
    )  # fmt: skip


VELOCITY_FAMILY = Family(
    name="velocity drive",
    share=0.1,
    draw=lambda rng: {
        "Tv": between(rng, 0.05, 0.8),
        "Kv": between(rng, 0.7, 1.2),
        "Tw": between(rng, 0.05, 0.5),
        "Kw": between(rng, 0.7, 1.2),
    },  # fmt: skip
    excite=lambda rng, n, kind, p: np.stack([signal(rng, n, kind, 1.0, 0.0), signal(rng, n, kind, 1.5, 0.0)], 1),
    states=_mechanism_states(me.VELOCITY_DRIVE),
    see=lambda x, p: x,
    move=lambda rng, p: np.array([rng.uniform(0.2, 0.6), rng.uniform(-0.5, 0.5)]),
    rest=lambda p: np.zeros(2),
    model=_velocity_model,
    output_units=lambda u: (u.speed, 1 / u.time),
    input_units=lambda u: (u.input, u.input),
    forces=lambda p: (0.5, 0.5),
    effects=_mechanism_effects((0.1, 1.0), 0.1, "none", 0.2),
)


# -- plain differential drive ----------------------------------------------------------------------------------------
def _drive_rates(state, inputs, p, friction):
    right, left = state["vr"], state["vl"]
    f_right = p["kf"] * (inputs["ur"] - p["ke"] * right) - p["B"] * right - friction["right"]
    f_left = p["kf"] * (inputs["ul"] - p["ke"] * left) - p["B"] * left - friction["left"]
    ahead, spin = (f_right + f_left) / p["M"], p["L"] * (f_right - f_left) / p["J"]
    return {"vr": ahead + p["L"] * spin, "vl": ahead - p["L"] * spin}


def _drive_output(state, inputs, p):
    return {"v": 0.5 * (state["vr"] + state["vl"]), "w": 0.5 * (state["vr"] - state["vl"]) / p["L"]}


_DRIVE_CHANNELS = Channels(
    inputs=("ur", "ul"), outputs=("v", "w"), units={"v": "m/s", "w": "rad/s", "ur": "V", "ul": "V"}
)


def _drive_model(p: Numbers, u: Units) -> jaxid.Robot:
    table = {
        "M": free(p["M"] * u.mass), "J": free(p["J"] * u.inertia), "B": free(p["B"] * u.mass / u.time),
        "Fc": free(p["Fc"] * u.force), "L": Parameter(p["L"] * u.length), "kf": Parameter(p["kf"] * u.force / u.input),
        "ke": Parameter(p["ke"] * u.input / u.speed),
    }  # fmt: skip
    return Custom(
        dynamics=_drive_rates, output=_drive_output, state_names=("vr", "vl"), own_channels=_DRIVE_CHANNELS,
        table=table, dry_friction=(("right", "vr", "Fc"), ("left", "vl", "Fc")), title="differential drive",
    )  # fmt: skip


def _drive_excite(rng: Rng, n: int, kind: str, p: Numbers) -> np.ndarray:
    least = p["Fc"] / p["kf"]
    common, turn = signal(rng, n, kind, 4.0, least), signal(rng, n, "good" if kind == "one way" else kind, 2.0, 0.2)
    return np.stack([common + turn, common - turn], 1)


def _plain_model(p: Numbers, u: Units) -> jaxid.Robot:
    return jaxid.DifferentialDrive().with_values(
        M=p["M"] * u.mass, J=p["J"] * u.inertia, Fv=p["B"] * u.mass / u.time, Fc=p["Fc"] * u.force, b=p["L"] * u.length,
        gain=p["kf"] * u.force / u.input, back_emf=p["ke"] * u.input / u.speed,
    )  # fmt: skip


RIM_FAMILY = Family(
    name="differential drive, own",
    share=0.06,
    draw=lambda rng: {
        "M": between(rng, 5.0, 20.0),
        "J": between(rng, 0.1, 0.5),
        "L": 0.17,
        "kf": between(rng, 3.0, 8.0),
        "ke": between(rng, 2.0, 6.0),
        "B": between(rng, 2.0, 10.0),
        "Fc": between(rng, 0.8, 4.0),
    },  # fmt: skip
    excite=_drive_excite,
    states=_mechanism_states(me.DIFFERENTIAL_DRIVE),
    see=lambda x, p: x,
    move=lambda rng, p: np.array([rng.uniform(0.2, 0.5), rng.uniform(-0.6, 0.6)]),
    rest=lambda p: np.zeros(2),
    model=_drive_model,
    output_units=lambda u: (u.speed, 1 / u.time),
    input_units=lambda u: (u.input, u.input),
    forces=lambda p: (8.0, 1.0),
    effects=_mechanism_effects((3.0, 30.0), 0.08, "Fc", 3.0),
)
DRIVE_FAMILY = replace(RIM_FAMILY, name="differential drive", model=_plain_model)


@cache
def families() -> dict[str, Family]:
    """All families by name."""
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

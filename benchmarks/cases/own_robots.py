"""The families of robots as users write them with `jaxid.Custom`, and the built-in differential drive beside one."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

import jaxid
from benchmarks.cases.family import Family, Numbers, Rng, Units, between, free, signal
from jaxid import Channels, Custom, Parameter
from reference import mechanisms as me


def mechanism_states(mechanism: me.Mechanism):
    def states(p: Numbers, effects: dict, start, time, inputs, forces):
        e = me.NOTHING.copy()
        for name, value in effects.items():
            e[me.E[name]] = value
        vector = np.array([p[symbol.name] for symbol in mechanism.symbols])
        layout = mechanism.first, mechanism.speeds, mechanism.n_axes
        return me.states_at(mechanism.dynamics, vector, e, start, time, np.hstack([inputs, forces]), layout)

    return states


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
    states=mechanism_states(me.PENDULUM),
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
    states=mechanism_states(me.CRANE),
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
def two_masses(title: str, states: tuple[str, ...], symbols: tuple[str, str, str], channels: Channels, *, rotary: bool):
    """A user's model of two masses, or inertias, with a spring and a damper between them, the first driven and rubbing.

    `states`: both positions, then both speeds. `symbols`: both masses and the dry friction.
    """
    (x1, x2, v1, v2), (m1, m2, dry) = states, symbols

    def rates(state, inputs, p, friction):
        through = p["s"] * (state[x1] - state[x2]) + p["d"] * (state[v1] - state[v2])
        force = p["k"] * inputs["u"] - p["b"] * state[v1] - through - friction["driven"]
        return {x1: state[v1], x2: state[v2], v1: force / p[m1], v2: through / p[m2]}

    def model(p: Numbers, u: Units) -> jaxid.Robot:
        mass, force, length = (u.inertia, u.torque, 1.0) if rotary else (u.mass, u.force, u.length)
        rate = force * u.time / length
        table = {
            m1: free(p[m1] * mass), m2: free(p[m2] * mass), "s": free(p["s"] * force / length), "d": free(p["d"] * rate),
            "b": free(p["b"] * rate), dry: free(p[dry] * force), "k": Parameter(p["k"] * force / u.input),
        }  # fmt: skip
        return Custom(
            dynamics=rates, state_names=states, own_channels=channels, table=table, dry_friction=(("driven", v1, dry),),
            title=title,
        )  # fmt: skip

    return model


_TWO_CHANNELS = Channels(inputs=("u",), outputs=("v1", "x2"), units={"v1": "m/s", "x2": "m", "u": "V"})
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
    states=mechanism_states(me.TWO_MASSES),
    see=lambda x, p: x[:, [2, 1]],
    move=lambda rng, p: np.array([0.0, rng.uniform(-0.05, 0.05), *rng.uniform(-0.5, 0.5, 2)]),
    rest=lambda p: np.zeros(4),
    model=two_masses("two masses", ("x1", "x2", "v1", "v2"), ("m1", "m2", "Fc"), _TWO_CHANNELS, rotary=False),
    output_units=lambda u: (u.speed, u.length),
    input_units=lambda u: (u.input,),
    forces=lambda p: (1.5,),
    effects=_mechanism_effects((0.2, 2.0), 0.1, "Fc", 0.5),
)


# -- Custom: velocity-commanded drive --------------------------------------------------------------------------------
def velocity_rates(state, inputs, p):
    return {
        "v": (p["Kv"] * inputs["vc"] - state["v"]) / p["Tv"],
        "w": (p["Kw"] * inputs["wc"] - state["w"]) / p["Tw"],
    }


_VELOCITY_CHANNELS = Channels(inputs=("vc", "wc"), outputs=("v", "w"), units={"v": "m/s", "w": "rad/s"})


def lags(p: Numbers, u: Units) -> dict[str, Parameter]:
    """Gains and lags of commanded speeds."""
    return {
        "Tv": free(p["Tv"] * u.time), "Kv": free(p["Kv"] * u.speed / u.input),
        "Tw": free(p["Tw"] * u.time), "Kw": free(p["Kw"] / u.time / u.input),
    }  # fmt: skip


def _velocity_model(p: Numbers, u: Units) -> jaxid.Robot:
    return Custom(
        dynamics=velocity_rates, state_names=("v", "w"), own_channels=_VELOCITY_CHANNELS, table=lags(p, u),
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
    states=mechanism_states(me.VELOCITY_DRIVE),
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
    states=mechanism_states(me.DIFFERENTIAL_DRIVE),
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

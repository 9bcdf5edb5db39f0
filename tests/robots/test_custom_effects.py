"""Effects on a user's own robot: they act as SciPy says, and are refused in a sentence where they cannot."""

from dataclasses import dataclass, replace
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import (
    AXIS,
    Axis,
    Channels,
    Custom,
    DriveAxis,
    Effect,
    EffectError,
    Integrator,
    Log,
    LogSet,
    Parameter,
    ParameterError,
    Pioneer,
    simulate,
)
from jaxid.effects import catalogue, effect_by_id
from jaxid.simulation import simulate as simulation

N, DT = 200, 0.02
P = {"inertia": 0.02, "weight": 0.6, "damping": 0.03, "coulomb": 0.08}
CHANNELS = Channels(("voltage",), ("angle",), units={"voltage": "V", "angle": "rad", "rate": "rad/s"})


def pendulum(state, u, p, friction):
    torque = 0.1 * u["voltage"] - p["weight"] * jnp.sin(state["angle"]) - p["damping"] * state["rate"]
    return {"angle": state["rate"], "rate": (torque - friction["bearing"]) / p["inertia"]}


def smooth_pendulum(state, u, p):
    return pendulum(state, u, p, {"bearing": 0.0})


def robot(**more):
    units = {"coulomb": "N m"}
    table = {name: Parameter(value, units.get(name, ""), free=True, lower=0.0) for name, value in P.items()}
    settings = {"axes": {"bearing": DriveAxis("rate", "coulomb", "damping")}, "dynamics": pendulum} | more
    return Custom(state_names=("angle", "rate"), own_channels=CHANNELS, table=table, title="pendulum", **settings)


@dataclass(frozen=True)
class Wind(Effect):
    """A user's own force: a torque that grows with the angle's cosine."""

    id: ClassVar[str] = "wind"

    def parameters(self, robot):
        return {self.key("torque"): Parameter(0.05, free=True)}

    def force(self, forces, state, p):
        return (forces[0] + p[self.key("torque")] * jnp.cos(state["angle"]),)


def voltage():
    return np.repeat(np.random.default_rng(1).uniform(-5, 5, N // 20), 20)


def ours(model):
    log = Log.from_arrays("a", DT * np.arange(N), voltage()[:, None], np.zeros((N, 1)), CHANNELS)
    return simulate(model, LogSet([log]), integrator=Integrator(8))[0][:, 0]


def exact(level, push):
    """The pendulum by SciPy, stopped at every standstill: `level(rate)` rubs, `push(angle, rate)` is a further torque."""
    y, rows = np.zeros(2), []
    for u in voltage():
        rows.append(y[0])
        t = 0.0
        while t < DT:
            pull = 0.1 * u - P["weight"] * np.sin(y[0]) + push(y[0], 0.0)
            moving = abs(y[1]) > 1e-9
            way = np.sign(y[1]) if moving else np.sign(pull) * (abs(pull) > level(0.0))
            if way == 0:
                y = np.array([y[0], 0.0])
                break

            def rate(_, y, way=way, u=u):
                free = 0.1 * u - P["weight"] * np.sin(y[0]) - P["damping"] * y[1] + push(y[0], y[1])
                return [y[1], (free - way * level(y[1])) / P["inertia"]]

            def stop(_, y, way=way):
                return way * y[1]

            stop.terminal, stop.direction = True, -1
            solution = solve_ivp(rate, (t, DT), y, "DOP853", events=stop, rtol=1e-9, atol=1e-11)
            y, t = solution.y[:, -1], solution.t[-1]
            if solution.status == 1:
                y[1] = 0.0
    return np.array(rows)


def coulomb(rate):
    return P["coulomb"]


def none(angle, rate):
    return 0.0


WAYS_IN = {
    "both": {"forces": {"rate": "inertia"}},
    "friction argument": {},
    "forces": {"forces": {"rate": "inertia"}, "dynamics": smooth_pendulum},
}


@pytest.mark.parametrize("way", WAYS_IN)
def test_force_and_friction_act_as_scipy_says(way):
    """The ways into the dynamics: a friction argument of theirs, forces over a declared inertia, or both."""
    model = robot(**WAYS_IN[way])
    plain = exact(coulomb, none)
    np.testing.assert_allclose(ours(model), plain, atol=5e-4)

    def level(rate):
        return P["coulomb"] + 0.06 * np.exp(-((rate / 0.8) ** 2))

    def drag(angle, rate):
        return -0.02 * rate * abs(rate)

    def wind(angle, rate):
        return 0.05 * np.cos(angle)

    stribeck = model + effect_by_id(model, "stribeck_friction")
    stribeck = stribeck.with_values(**{"stribeck_friction.amplitude": 0.06, "stribeck_friction.speed": 0.8})
    dragged = (model + effect_by_id(model, "quadratic_drag")).with_values(**{"quadratic_drag.coefficient": 0.02})
    for changed, truth in ((model + Wind(), exact(coulomb, wind)), (dragged, exact(coulomb, drag))):
        assert np.max(np.abs(truth - plain)) > 0.02
        np.testing.assert_allclose(ours(changed), truth, atol=1e-3)
    truth = exact(level, none)
    assert np.max(np.abs(truth - plain)) > 0.02
    np.testing.assert_allclose(ours(stribeck), truth, atol=2e-3)


def like_an_axis():
    """The drive axis written by a user, everything declared."""
    defaults = Axis().parameters
    return Custom(
        dynamics=lambda s, u, p, friction: {
            "q": s["v"],
            "v": (p["gain"] * u["u"] - p["Fv"] * s["v"] - p["offset"] - friction["slide"]) / p["M"],
        },
        state_names=("q", "v"),
        own_channels=AXIS,
        table=dict(defaults),
        axes={"slide": DriveAxis("v", "Fc", "Fv", torque=lambda s, u, p: p["gain"] * u["u"], angle="q")},
        forces={"v": "M"},
        motor_currents=lambda s, u, p: u,
        mechanisms={"payload_change": ("M",)},
        title="like an axis",
    )


def test_every_effect_acts_on_a_users_axis_as_on_the_built_in_one():
    u = np.repeat(np.random.default_rng(3).uniform(-3, 3, 20), 10)
    values = {
        "stribeck_friction.amplitude": 0.3,
        "cogging_torque.sine_q": 0.4,
        "traction_limit.inverse_limit": 0.5,
        "quadratic_drag.coefficient": 0.2,
        "asymmetric_viscous_friction.asymmetry": 0.3,
        "sublinear_viscous_friction.deficit": 0.2,
        "sensor_bias.bias_v": 0.1,
        "motor_lag.time_constant": 0.05,
        "actuator_dead_zone.threshold": 0.2,
        "backlash.impulse": 0.1,
        "payload_change.mass": 0.5,
        "payload_change.moment": 2.0,
    }
    mine, theirs = like_an_axis(), Axis()
    shared = [effect.id for effect in catalogue(theirs)]
    assert set(shared) | {"asymmetric_friction"} == {effect.id for effect in catalogue(mine)}
    for name in shared:
        mine, theirs = mine + effect_by_id(mine, name), theirs + effect_by_id(theirs, name)
    log = Log.from_arrays("a", DT * np.arange(N), u[:, None], np.zeros((N, 2)), AXIS)
    # First guesses may differ where a robot has nominal sizes of its own: the same numbers for both.
    numbers = theirs.parameters.numbers | values | {"Fc": 0.4, "offset": 0.1}
    theirs, mine = theirs.with_values(**numbers), mine.with_values(**numbers)
    outputs = [simulate(model, LogSet([log]), integrator=Integrator(2))[0] for model in (theirs, mine)]
    assert np.ptp(outputs[0][:, 0]) > 0.2
    np.testing.assert_allclose(outputs[1], outputs[0], atol=1e-10)


def test_two_axes_that_rub_at_one_speed_are_pushed_once():
    def two(state, u, p, friction):
        return pendulum(state, u, p, {"bearing": friction["bearing"] + friction["seal"]})

    axes = {"bearing": DriveAxis("rate", "coulomb", "damping"), "seal": DriveAxis("rate", driven=False)}
    np.testing.assert_allclose(ours(robot(dynamics=two, axes=axes) + Wind()), ours(robot() + Wind()), atol=1e-9)


def test_weight_pulls_at_a_tricycle_whose_plane_is_a_function_of_its_steering():
    """Speed `s` of the steered front wheel, `plane` a function of it: the weight's power on a slope, by SciPy."""
    mass, drag, slope = 30.0, 12.0, (0.02, -0.03)

    def dynamics(state, u, p):
        return {"s": (u["force"] - drag * state["s"]) / p["mass"], "d": u["rate"]}

    def plane(state, p):
        return state["s"] * jnp.cos(state["d"]), 0.0, state["s"] * jnp.sin(state["d"]) / 0.8

    units = {"force": "N", "rate": "rad/s", "s": "m/s"}
    tricycle = Custom(
        dynamics=dynamics,
        state_names=("s", "d"),
        own_channels=Channels(("force", "rate"), ("s",), units=units),
        table={"mass": Parameter(mass, "kg", free=True, lower=1.0)},
        forces={"s": "mass"},
        plane=plane,
        mass="mass",
    )
    tilted = tricycle + effect_by_id(tricycle, "ground_slope")
    tilted = tilted.with_values(**{"ground_slope.slope_x": slope[0], "ground_slope.slope_y": slope[1]})
    t = np.arange(N) * DT
    inputs = np.stack([np.full(N, 20.0), np.where(t < 1.0, 0.8, -0.3)], axis=1)

    def rates(time, state, force, rate):
        s, d, heading = state
        along = 9.81 * mass * (slope[0] * np.cos(heading) + slope[1] * np.sin(heading))
        return [(force - drag * s + along * np.cos(d)) / mass, rate, s * np.sin(d) / 0.8]

    state, expected = np.zeros(3), []
    for row in inputs:
        expected.append(state[0])
        state = solve_ivp(rates, (0.0, DT), state, args=tuple(row), rtol=1e-10, atol=1e-12).y[:, -1]
    log = Log("tilted", t, inputs, np.array(expected)[:, None], tricycle.channels)
    (found,) = simulate(tilted, LogSet([log]), integrator=Integrator(4))
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-7)
    assert abs(simulate(tricycle, LogSet([log]))[0][-1, 0] - expected[-1]) > 0.2


def test_what_cannot_act_is_refused_in_a_sentence():
    bare = robot(dynamics=smooth_pendulum, axes={}, velocities=("rate",))
    with pytest.raises(EffectError, match="'pendulum' cannot have the effect 'wind': it does not say .*`forces=`"):
        bare + Wind()
    with pytest.raises(KeyError, match="how it moves in the plane"):
        effect_by_id(bare, "ground_slope")
    with pytest.raises(EffectError, match="several|more than one drive input"):
        from jaxid.effects.actuator import MotorGainMismatch

        bare + MotorGainMismatch()
    names = {effect.id for effect in catalogue(bare)}
    assert {"input_delay", "sensor_lag"} <= names
    assert not names & {"stribeck_friction", "quadratic_drag", "cogging_torque", "traction_limit", "motor_heating"}
    with pytest.raises(ParameterError, match="has no way into the dynamics; let them take a fourth argument"):
        robot(dynamics=smooth_pendulum)


def test_units_of_effects_are_those_of_the_users_axis():
    """A joint that turns, whose speed is no channel; and a trolley with wheels."""
    bearing = DriveAxis("rate", "coulomb", "damping", torque=lambda s, u, p: 0.1 * u["voltage"], angle="angle")
    joint = robot(axes={"bearing": bearing}, forces={"rate": "inertia"})
    channels = Channels(("u",), ("v",), units={"v": "m/s"})
    trolley = Custom(
        dynamics=lambda s, u, p, friction: {"v": (u["u"] - friction["wheel"]) / p["m"]},
        state_names=("v",),
        own_channels=channels,
        table={"m": Parameter(2.0, "kg"), "Fc": Parameter(0.4, "N")},
        axes={"wheel": DriveAxis("v", "Fc", torque=lambda s, u, p: u["u"], angle="way")},
        forces={"v": "m"},
    )
    names = ("quadratic_drag.coefficient", "stribeck_friction.speed")
    names += ("cogging_torque.periods", "traction_limit.inverse_limit")
    for model, units in (
        (joint, ("N m s^2/rad^2", "rad/s", "1/rad", "1/N m")),
        (trolley, ("N s^2/m^2", "m/s", "1/m", "1/N")),
    ):
        for name, unit in zip(names, units, strict=True):
            assert (model + effect_by_id(model, name.split(".")[0])).parameters[name].unit == unit
    assert joint.force_unit("rate") == "N m" and trolley.force_unit("v") == "N"
    # By the axis' own name, as pictures of its friction ask.
    assert joint.force_unit("bearing") == joint.friction_unit and trolley.force_unit("wheel") == "N"
    # Grams and millimetres: kg mm/s^2 are mN, and so is what is added to them.
    small = replace(
        trolley,
        own_channels=Channels(("u",), ("v",), units={"v": "mm/s"}),
        table={"m": Parameter(2.0, "kg"), "Fc": Parameter(400.0, "mN")},
    )
    assert small.force_unit("wheel") == small.force_unit("v") == "mN"
    dragged = small + effect_by_id(small, "quadratic_drag")
    assert dragged.parameters["quadratic_drag.coefficient"].unit == "mN s^2/mm^2"


def test_an_effect_gives_rates_of_its_own_states_only():
    @dataclass(frozen=True)
    class Overwriting(Effect):
        id: ClassVar[str] = "overwriting"

        def rates(self, state, currents, p):
            return {"v": 0.0}

    @dataclass(frozen=True)
    class Clashing(Effect):
        id: ClassVar[str] = "clashing"
        states: ClassVar[tuple[str, ...]] = ("v",)

        def rates(self, state, currents, p):
            return {"v": 0.0}

    log = Log.from_arrays("a", DT * np.arange(N), np.ones((N, 1)), np.zeros((N, 2)), AXIS)
    with pytest.raises(EffectError, match="gives a rate of v, which is no state of its own"):
        simulate(Axis() + Overwriting(), LogSet([log]))
    with pytest.raises(EffectError, match="brings a state 'v', which the robot 'axis' already has"):
        Axis() + Clashing()


def test_a_model_built_by_two_routes_is_one_and_compiles_once():
    first = effect_by_id(Pioneer(), "stribeck_friction")
    one = Pioneer() + first
    one = one + effect_by_id(one, "sensor_bias")
    two = Pioneer() + effect_by_id(Pioneer() + effect_by_id(Pioneer(), "motor_heating"), "stribeck_friction")
    two = two + effect_by_id(Pioneer(), "sensor_bias")
    assert one == two and hash(one) == hash(two)
    n = 40
    log = Log.from_arrays("a", DT * np.arange(n), np.ones((n, 2)), np.zeros((n, 2)), one.channels)
    simulate(one, LogSet([log]))
    before = simulation._simulate._outer._cache_size()
    simulate(two.with_values(**{"sensor_bias.bias_eta1": 0.1}), LogSet([log]))
    assert simulation._simulate._outer._cache_size() == before
    assert replace(one, effects=one.effects[::-1]).structure != one.structure

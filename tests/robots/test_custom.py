"""A user's own robots, none of the built-in ones, from simulation to identified parameters."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import (
    Channels,
    Custom,
    DriveAxis,
    Integrator,
    Log,
    LogSet,
    Parameter,
    ParameterError,
    output_error,
    simulate,
)
from jaxid.robots.given import check_free
from jaxid.robots.scales import time_constant

CHANNELS = Channels(inputs=("voltage",), outputs=("angle",), units={"voltage": "V", "angle": "rad"})
TRUTH = {"inertia": 0.02, "weight": 0.6, "damping": 0.03, "coulomb": 0.08}


UNITS = {"inertia": "kg m^2", "weight": "N m", "damping": "N m s", "coulomb": "N m"}


def pendulum(state, u, p, friction):
    """A pendulum on a direct-drive motor of 0.1 N m/V."""
    torque = 0.1 * u["voltage"] - p["weight"] * jnp.sin(state["angle"]) - p["damping"] * state["rate"]
    return {"angle": state["rate"], "rate": (torque - friction["bearing"]) / p["inertia"]}


def robot(**values):
    table = {name: Parameter(TRUTH[name], unit, free=True, lower=0.0) for name, unit in UNITS.items()}
    made = Custom(
        dynamics=pendulum,
        state_names=("angle", "rate"),
        own_channels=CHANNELS,
        table=table,
        dry_friction={"bearing": ("rate", "coulomb")},  # type: ignore[arg-type]
        title="pendulum",
    )
    return made.with_values(**values)


def exact(voltage, dt, coulomb, angle=0.0):
    """The pendulum by SciPy, stopping at every standstill: an event starts sliding again or ends in rest."""
    p = TRUTH | {"coulomb": coulomb}
    y, rows = np.array([angle, 0.0]), []
    for u in voltage:
        rows.append(y[0])
        t = 0.0
        while t < dt:
            pull = 0.1 * u - p["weight"] * np.sin(y[0])
            moving = abs(y[1]) > 1e-9
            way = np.sign(y[1]) if moving else np.sign(pull) * (abs(pull) > p["coulomb"])
            if way == 0:
                y = np.array([y[0], 0.0])
                break

            def rate(_, y, way=way, u=u):
                pull = 0.1 * u - p["weight"] * np.sin(y[0]) - p["damping"] * y[1]
                return [y[1], (pull - way * p["coulomb"]) / p["inertia"]]

            def stop(_, y, way=way):
                return way * y[1]

            stop.terminal, stop.direction = True, -1
            solution = solve_ivp(rate, (t, dt), y, "DOP853", events=stop, rtol=1e-9, atol=1e-11)
            y, t = solution.y[:, -1], solution.t[-1]
            if solution.status == 1:
                y[1] = 0.0
    return np.array(rows)


def excitation(n, seed):
    return np.repeat(np.random.default_rng(seed).uniform(-5, 5, -(-n // 20)), 20)[:n]


def log(name, voltage, angles, dt=0.02):
    return Log.from_arrays(name, dt * np.arange(len(voltage)), voltage[:, None], angles[:, None], CHANNELS)


@pytest.fixture(scope="module")
def experiments():
    """Two swinging runs, stick-slip included."""
    runs = [excitation(200, seed) for seed in (1, 2)]
    return [(u, exact(u, 0.02, TRUTH["coulomb"])) for u in runs]


def test_simulation_with_stick_slip_is_scipys(experiments):
    logs = LogSet([log(f"{k}", u, angles) for k, (u, angles) in enumerate(experiments)])
    for (_, angles), outputs in zip(experiments, simulate(robot(), logs, integrator=Integrator(4)), strict=True):
        assert np.ptp(angles) > 0.5
        np.testing.assert_allclose(outputs[:, 0], angles, atol=1e-3)


def test_dry_friction_holds_it_at_an_angle_where_it_would_swing_without():
    # 0.6 N m * sin(0.1) = 0.06 N m against 0.08 N m of friction
    held = log("held", np.zeros(200), np.full(200, 0.1))
    start = {"angle": np.array([0.1]), "rate": np.array([0.0])}
    two = LogSet([held])
    stuck = simulate(robot(), two, start=start, integrator=Integrator(4))[0]
    assert np.abs(stuck - 0.1).max() < 1e-12
    swinging = simulate(robot(coulomb=0.0), two, start=start, integrator=Integrator(4))[0]
    assert swinging.min() < -0.05
    np.testing.assert_allclose(swinging[:, 0], exact(np.zeros(200), 0.02, 0.0, angle=0.1), atol=1e-5)


def test_output_error_finds_its_parameters(experiments):
    rng = np.random.default_rng(3)
    logs = LogSet([log(f"{k}", u, y + 0.005 * rng.normal(size=y.shape)) for k, (u, y) in enumerate(experiments)])
    start = {name: 1.3 * value for name, value in TRUTH.items()}
    fit = output_error(robot(), logs, start=start, initial_states="known", integrator=Integrator(4))
    assert fit.converged
    for name, value in TRUTH.items():
        assert fit[name].status == "identified"
        assert abs(fit[name].value - value) < 3 * fit[name].std_error, name
    assert fit.noise["angle"] == pytest.approx(0.005, rel=0.12)  # 400 samples: one standard error is 3.5 %


def test_outputs_may_be_functions_of_the_state():
    made = Custom(
        dynamics=lambda state, u, p: {"angle": u["speed"] * p["gain"]},
        state_names=("angle",),
        own_channels=Channels(inputs=("speed",), outputs=("height",)),
        table={"gain": Parameter(2.0), "arm": Parameter(0.5)},
        output=lambda state, u, p: {"height": p["arm"] * jnp.sin(state["angle"])},
        start={"angle": 0.3},
    )
    time = 0.1 * np.arange(30)
    logs = LogSet([Log.from_arrays("a", time, np.ones((30, 1)), np.zeros((30, 1)), made.channels)])
    outputs = simulate(made, logs, integrator=Integrator(1))[0]
    np.testing.assert_allclose(outputs[:, 0], 0.5 * np.sin(0.3 + 2.0 * time), atol=1e-12)


def test_what_does_not_fit_together_is_refused_by_name():
    base = dict(
        dynamics=pendulum, state_names=("angle", "rate"), own_channels=CHANNELS, table={"weight": Parameter(1.0)}
    )
    with pytest.raises(ParameterError, match="outputs angle are not states; pass `output=`"):
        Custom(**(base | dict(state_names=("phi", "rate"))))
    with pytest.raises(ParameterError, match="'bearing' names speed 'omega' and level 'weight'"):
        Custom(**base, dry_friction={"bearing": ("omega", "weight")})
    with pytest.raises(ParameterError, match="level 'coulomb'; the first must be a state and the second a parameter"):
        Custom(**base, dry_friction={"bearing": ("rate", "coulomb")})
    with pytest.raises(ParameterError, match="'radius' is not a parameter; use one of weight"):
        Custom(**base, axes={"wheel": DriveAxis(speed="rate", lever="radius")}, forces={"rate": "weight"})
    with pytest.raises(
        ParameterError, match=r"no parameter is free; free at least one \(`robot.change\('weight', free=True"
    ):
        free = {"dynamics": lambda state, inputs, p: {"angle": state["rate"], "rate": -p["weight"] * state["angle"]}}
        check_free(Custom(**(base | free)))


def test_a_mass_of_zero_in_a_denominator_raises_nothing():
    """A fit may end at one. The equation of motion is plain Python here: only Python's own numbers refuse the division."""
    cart = Custom(
        dynamics=lambda s, u, p: {"x": s["v"], "v": u["force"] / p["m"]},
        state_names=("x", "v"),
        own_channels=Channels(inputs=("force",), outputs=("x",), units={"force": "N", "x": "m"}),
        table={"m": Parameter(1.0, "kg", free=True, lower=0.0)},
        velocities=("v",),
    )
    assert cart.positions == cart.with_values(m=0.0).positions == {"v": "x"}
    log = Log.from_arrays("a", 0.02 * np.arange(50), np.ones(50), 0.01 * np.arange(50.0), cart)
    assert not np.isfinite(simulate(cart.with_values(m=0.0), LogSet([log]), integrator=Integrator(2))[0][-1]).all()


def test_a_root_of_a_speed_and_a_quotient_of_speeds_are_asked_as_jax_would():
    """Python's own numbers make a complex number of the one and an error of the other, in the branch that is not taken."""

    def root(v):
        return jnp.where(v > 0, v**1.5, -((-v) ** 1.5))

    def slip(state):
        return jnp.where(jnp.abs(state["v"]) > 0.01, state["side"] / state["v"], 0.0)

    def torque(state, u, p):
        return u["u"] - state["v"] + 0.0 * slip(state)

    def rates(state, u, p, friction):
        pull = torque(state, u, p) - p["drag"] * root(state["v"]) - friction["axle"]
        return {"v": pull / p["mass"], "side": -state["side"] - slip(state)}

    axle = DriveAxis(speed=lambda state, p: state["v"] + 0.0 * root(state["v"]), coulomb="coulomb", torque=torque)
    own = Custom(
        dynamics=rates,
        output=lambda state, u, p: {"v": state["v"] + 0.0 * slip(state)},
        state_names=("v", "side"),
        own_channels=Channels(inputs=("u",), outputs=("v",), units={"u": "N", "v": "m/s"}),
        table={name: Parameter(0.5, free=True, lower=0.0) for name in ("mass", "drag", "coulomb")},
        axes={"axle": axle},
        forces={"v": lambda state, p: p["mass"] + 0.0 * slip(state), "side": 1.0},
        plane=lambda state, p: (state["v"], state["side"], slip(state)),
    )
    rest, numbers = {"v": -0.1, "side": 0.0}, own.parameters.numbers
    still = dict.fromkeys(rest, 0.0)
    assert own.rates(rest, (0.0,), (0.0,), numbers)["v"] == pytest.approx((0.1 + 0.5 * 0.1**1.5) / 0.5)
    assert own.observe(still, (0.0,), numbers) == (0.0,) and own.planar(still, numbers) == (0.0, 0.0, 0.0)
    assert own.drive_torques((1.0,), still, numbers) == (1.0,) and own.rubbing(rest, numbers) == (-0.1,)
    assert time_constant(own) == pytest.approx(0.5, rel=0.01)  # the sideways speed's is 1 s

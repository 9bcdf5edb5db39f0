"""Effects with memory on irregular time stamps, the first interval an odd one, against SciPy's own integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import AXIS, Axis, Channels, Custom, Integrator, Log, LogSet, Parameter, simulate
from jaxid.effects import effect_by_id

M, FV, N = 1.3, 2.6, 160
DELAY, LAG = 0.047, 0.06


def stamps(n=N, seed=4):
    """0.02 s apart, give or take 40 %, but for a first interval eight times as long."""
    steps = 0.02 * np.random.default_rng(seed).uniform(0.6, 1.4, n - 1)
    steps[0] = 0.16
    return np.concatenate([[0.0], np.cumsum(steps)])


def inputs(n=N, seed=5):
    return np.repeat(np.random.default_rng(seed).uniform(-3, 3, -(-n // 8)), 8)[:n]


def held(time, u):
    """The zero-order hold of u as a function of any time; nothing before the first stamp."""
    return lambda t: u[np.searchsorted(time, t, side="right") - 1] if t >= time[0] else 0.0


def exact(time, u, delay=0.0, lag=0.0, at=None):
    """Speed of M dv/dt = u'(t) - Fv v at the times `at`, integrated from one change of the input to the next."""
    command = held(time, u)
    at = time if at is None else at
    edges = np.unique(np.concatenate([time, time + delay, [max(at[-1], time[-1])]]))
    state, found = np.zeros(2), np.zeros(len(at))  # speed, what arrives of the input
    for start, end in zip(edges[:-1], edges[1:], strict=True):
        now = command(0.5 * (start + end) - delay)

        def rate(_, x, now=now):
            arrives = x[1] if lag else now
            return [(arrives - FV * x[0]) / M, (now - x[1]) / lag if lag else 0.0]

        inside = (at >= start) & (at < end)
        solved = solve_ivp(rate, (start, end), state, "DOP853", rtol=1e-11, atol=1e-13, dense_output=True)
        found[inside] = solved.sol(at[inside])[0] if inside.any() else 0.0
        state = solved.y[:, -1]
    found[at >= edges[-1]] = state[0]
    return found


def speeds(name, **values):
    time, u = stamps(), inputs()
    robot = Axis().with_values(M=M, Fv=FV, Fc=0.0)
    robot = robot + effect_by_id(robot, name)
    robot = robot.with_values(**{f"{name}.{key}": value for key, value in values.items()})
    log = Log.from_arrays("a", time, u[:, None], np.zeros((N, 2)), AXIS)
    return time, u, simulate(robot, LogSet([log]), integrator=Integrator(4))[0][:, 0]


def test_the_input_arrives_a_delay_later():
    time, u, ours = speeds("input_delay", delay=DELAY)
    theirs = exact(time, u, delay=DELAY)
    plain = exact(time, u)
    assert np.max(np.abs(plain - theirs)) > 0.1
    # Within a step the change of the late input counts by its mean: an error of second order in the step.
    np.testing.assert_allclose(ours, theirs, atol=3e-4)


def test_the_motor_lags():
    time, u, ours = speeds("motor_lag", time_constant=LAG)
    theirs = exact(time, u, lag=LAG)
    assert np.max(np.abs(exact(time, u) - theirs)) > 0.1
    np.testing.assert_allclose(ours, theirs, atol=5e-4)


def test_the_sensor_is_stamped_late():
    time, u, ours = speeds("sensor_delay", delay=DELAY)
    then = time - DELAY
    theirs = np.where(then > 0, exact(time, u, at=np.maximum(then, 0.0)), 0.0)
    assert np.max(np.abs(exact(time, u) - theirs)) > 0.1
    late = time > time[1] + DELAY  # inside the long first interval the speed is no parabola
    np.testing.assert_allclose(ours[late], theirs[late], atol=3e-3)
    assert np.sqrt(np.mean((ours - theirs)[late] ** 2)) < 5e-4


def test_the_sensor_lags():
    time, u, ours = speeds("sensor_lag", time_constant=LAG)
    dense = np.linspace(0.0, time[-1], 40001)
    v = exact(time, u, at=dense)
    filtered = solve_ivp(
        lambda t, y: (np.interp(t, dense, v) - y) / LAG, (0, time[-1]), [0.0], "RK45", time, rtol=1e-8, max_step=2e-3
    )
    assert np.max(np.abs(exact(time, u) - filtered.y[0])) > 0.1
    late = time > time[1] + 3 * LAG
    np.testing.assert_allclose(ours[late], filtered.y[0][late], atol=2e-3)


@pytest.fixture(scope="module")
def motor():
    """A motor with winding R and constant k as a user writes it, its currents declared."""
    table = {"J": 0.02, "k": 0.3, "R": 0.8, "B": 0.05}
    units = {"J": "kg m^2", "k": "V s", "R": "ohm", "B": "N m s"}

    def dynamics(state, u, p):
        return {"w": (p["k"] * (u["u"] - p["k"] * state["w"]) / p["R"] - p["B"] * state["w"]) / p["J"]}

    robot = Custom(
        dynamics=dynamics,
        state_names=("w",),
        own_channels=Channels(("u",), ("w",), units={"u": "V", "w": "rad/s"}),
        table={name: Parameter(value, units[name], free=True, lower=0.0) for name, value in table.items()},
        motor_currents=lambda state, u, p: {"u": (u["u"] - p["k"] * state["w"]) / p["R"]},
        winding="R",
        supply_voltage=6.0,
    )
    return robot, table


def test_a_users_motor_warms_up(motor):
    robot, p = motor
    time, u = stamps(), 2.0 * inputs()
    warm = (robot + effect_by_id(robot, "motor_heating")).with_values(**{"motor_heating.coefficient": 0.05})
    log = Log.from_arrays("a", time, u[:, None], np.zeros((N, 1)), robot.channels)
    ours = simulate(warm, LogSet([log]), integrator=Integrator(8))[0][:, 0]
    state, theirs = np.zeros(2), []
    for k, (now, start) in enumerate(zip(u, time, strict=True)):
        theirs.append(state[0])
        if k + 1 == N:
            break

        def rate(_, x, now=now):
            R = p["R"] * (1 + 0.05 * x[1])
            i = (now - p["k"] * x[0]) / R
            return [(p["k"] * i - p["B"] * x[0]) / p["J"], R * i * i]

        state = solve_ivp(rate, (start, time[k + 1]), state, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    cold = simulate(robot, LogSet([log]), integrator=Integrator(8))[0][:, 0]
    assert np.max(np.abs(cold - theirs)) > 0.3
    np.testing.assert_allclose(ours, theirs, atol=2e-4)

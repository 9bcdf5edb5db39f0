"""Which robot shows a mechanism, how strong it is there, and what the missing force or the wrong reading is drawn over."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from jaxid import Axis, DifferentialDrive, Omni, Robot
from jaxid.effects import effect_by_id

from .mecanum import MECANUM
from .missing import INTERVAL, Array, Run, driven, levels
from .steered import CAR, STEER, WHEELBASE

AXIS = Axis().with_values(M=10.0, Fv=5.0, Fc=3.0, gain=2.0, back_emf=4.0)
DRIVE = DifferentialDrive().with_values(M=12.0, J=0.4, Fv=3.0, Fc=2.0, b=0.2, gain=1.5, back_emf=4.0)
OMNI = Omni().with_values(coriolis=0.0)
_SECONDS = 48.0
_LIMIT = 10.0
_AHEAD = np.array([0.0, -1.0, 0.0, 1.0])
"""Commands of the omni's motors that drive it straight ahead."""


def independent(robot: Robot) -> Array:
    """Every command on its own."""
    return levels(robot, _SECONDS, _LIMIT, 0.4, seed=1)


def small(robot: Robot) -> Array:
    """Commands that hardly overcome friction."""
    return levels(robot, _SECONDS, 0.6 * _LIMIT, 0.5, seed=2)


def straight(robot: Robot) -> Array:
    """The same command on both sides."""
    return levels(robot, _SECONDS, _LIMIT, 0.6, seed=3, together=True)


def settling(robot: Robot) -> Array:
    """The same command everywhere, long enough for the speed to settle."""
    return levels(robot, 2 * _SECONDS, _LIMIT, 2.0, seed=7, together=True)


def ahead(robot: Robot) -> Array:
    """The omni forwards and backwards."""
    return levels(robot, _SECONDS, _LIMIT, 0.4, seed=4)[:, :1] * _AHEAD


def to_and_fro(robot: Robot) -> Array:
    """One level forwards and one backwards."""
    return 8.0 * np.sign(levels(robot, _SECONDS, 1.0, 0.5, seed=5)[:, :1])


def steering(robot: Robot) -> Array:
    """A car ahead at a changing throttle, steered to either side."""
    throttle = 1.5 + 0.6 * levels(robot, _SECONDS, 1.0, 1.0, seed=8)[:, :1]
    return np.concatenate([throttle, levels(robot, _SECONDS, 0.4, 0.6, seed=9)[:, 1:]], axis=1)


def with_pauses(robot: Robot) -> Array:
    """The omni forwards and backwards, with no command in between."""
    found = levels(robot, _SECONDS, _LIMIT, 0.3, seed=6)[:, :1]
    return np.where(np.abs(found) < 0.5 * _LIMIT, 0.0, found) * _AHEAD


def speed(name: str) -> Callable[[Run], Array]:
    """A speed, in the middle of the sampling interval."""
    return lambda run: _middle(run, run.real[:, run.column(name)])


def _middle(run: Run, values: Array) -> Array:
    return 0.5 * (values[run.moments] + values[run.moments + 1])


def acceleration(name: str) -> Callable[[Run], Array]:
    """The rate of a speed."""

    def rate(run: Run) -> Array:
        own = run.model[:, run.column(name)]
        return np.gradient(own, INTERVAL)[run.moments]

    return rate


def way(name: str) -> Callable[[Run], Array]:
    """The integral of a speed."""
    return lambda run: INTERVAL * np.cumsum(run.real[:, run.column(name)])[run.moments]


def heading(run: Run) -> Array:
    """The heading in degrees, within a turn."""
    return np.degrees(np.angle(np.exp(1j * way("w")(run))))


def command(number: int) -> Callable[[Run], Array]:
    """A command."""
    return lambda run: run.inputs[run.moments, number]


def drive_force(run: Run) -> Array:
    """The force with which the axis is driven."""
    p = run.robot.parameters.numbers
    return p["gain"] * (run.inputs[run.moments, 0] - p["back_emf"] * speed("v")(run))


def currents(run: Run) -> Array:
    """The omni's motor currents [n, 4]."""
    state = {name: _middle(run, run.real[:, run.column(name)]) for name in run.robot.states}
    found = run.robot.currents(state, tuple(run.inputs[run.moments].T), run.robot.parameters.numbers)
    return np.stack([np.broadcast_to(np.asarray(i), state["V"].shape) for i in found], axis=1)


def drawn(run: Run) -> Array:
    """The current that the omni's motors draw from the supply."""
    return np.sum(run.inputs[run.moments] / run.robot.parameters["supply"].value * currents(run), axis=1)


def pushed(run: Run) -> Array:
    """The force with which the omni's motors push it ahead."""
    p = run.robot.parameters.numbers
    return p["l"] * p["Kt"] / p["r"] * (currents(run) @ _AHEAD)


def since(run: Run) -> Array:
    """Seconds since the command changed."""
    return run.held()[0]


def settled(run: Run) -> Array:
    """One where the command has not changed for more than a second, else nothing."""
    return np.where(since(run) > 1.2, 1.0, np.nan)


def moment_of_time(run: Run) -> Array:
    """Seconds since the start."""
    return run.time[run.moments]


def everywhere(run: Run) -> Array:
    """Ones."""
    return np.ones(len(run.moments))


def per_angle(run: Run) -> Array:
    """The moment that a steering angle [rad] more makes of a car, at small angles."""
    ahead = speed("v")(run)
    return np.where(ahead > 0.3, STEER * ahead / WHEELBASE, np.nan)


def since_steered(run: Run) -> Array:
    """Seconds since the steering command changed."""
    return run.held(1)[0]


def per_change(run: Run) -> Array:
    """The moment that the last change of the steering command makes."""
    since, change = run.held(1)
    before = run.inputs[run.moments, 1] - change
    swing = np.tan(run.inputs[run.moments, 1]) - np.tan(before)
    return np.where(np.abs(change) > 0.15, per_angle(run) * swing, np.nan)


@dataclass(frozen=True)
class Case:
    """One mechanism's picture.

    - `values` of the effect on `robot`, driven by `inputs`.
    - `over`: what the picture's right half is drawn over, and `label` of it.
    - `channel`: the speed that is drawn, and whose force is missing; with `reading` it is the sensor that is wrong.
    - `per`: what the missing force is divided by, and `quantity`, what is drawn then.
    - `apart` (words, condition): moments that are drawn in another colour.
    - `seconds` of the motion that are shown, `within` of the right half.
    """

    robot: Robot
    values: Mapping[str, float]
    over: Callable[[Run], Array]
    label: str
    channel: str = "v"
    inputs: Callable[[Robot], Array] = independent
    reading: bool = False
    per: Callable[[Run], Array] = everywhere
    quantity: str = "missing force [N]"
    apart: tuple[str, Callable[[Run], Array]] | None = None
    seconds: tuple[float, float] = (0.0, 6.0)
    within: tuple[float, float] = (-np.inf, np.inf)

    def run(self, identifier: str) -> Run:
        """The robot driven with the mechanism and without."""
        having = (self.robot + effect_by_id(self.robot, identifier)).with_values(**self.values)
        return driven(self.robot, having, self.inputs(self.robot))

    def seen(self, run: Run) -> tuple[Array, Array]:
        """What the right half shows: [n] across, [n] upwards; NaN where it says nothing."""
        column, x = run.column(self.channel), self.over(run)
        if self.reading:
            y = (run.real - run.model)[run.moments, column]
        else:
            turning = self.channel in ("w", "W")
            inertia = self.robot.parameters["J" if turning else "M"].value
            own = run.real[:, column]
            # Friction turns round within the sample, or holds the robot and takes up whatever is missing.
            unclear = own[run.moments] * own[run.moments + 1] <= 1e-18
            y = np.where(unclear, np.nan, inertia * run.acceleration[:, column])
        with np.errstate(divide="ignore", invalid="ignore"):
            y = y / self.per(run)
        return x, np.where((x >= self.within[0]) & (x <= self.within[1]), y, np.nan)


def _direction(of: Callable[[Run], Array]) -> Callable[[Run], Array]:
    """The sign of something; nothing where it is zero."""
    return lambda run: np.sign(of(run))


def _large(of: Callable[[Run], Array], least: float) -> Callable[[Run], Array]:
    """Something where it is large enough to divide by."""
    return lambda run: np.where(np.abs(of(run)) > least, of(run), np.nan)


_SPEED, _VOLTS = "speed [m/s]", "command [V]"
_MOMENT = "missing moment [N m]"
_AFTER = "time since the command changed [s]"
_PER_VOLT = "missing force\nper volt of change [N/V]"
_CHANGE = _large(lambda run: run.held()[1], 1.0)

CASES: Mapping[str, Case] = {
    "actuator_dead_zone": Case(AXIS, {"actuator_dead_zone.threshold": 1.5}, command(0), _VOLTS),
    "voltage_saturation": Case(AXIS, {"voltage_saturation.inverse_limit": 1 / 6.0}, command(0), _VOLTS),
    "motor_lag": Case(
        AXIS, {"motor_lag.time_constant": 0.08}, since, _AFTER, per=_CHANGE, quantity=_PER_VOLT, within=(0, 0.4)
    ),
    "input_delay": Case(
        AXIS, {"input_delay.delay": 0.08}, since, _AFTER, per=_CHANGE, quantity=_PER_VOLT, within=(0, 0.4)
    ),
    "freewheeling_driver": Case(
        OMNI,
        {"freewheeling_driver.share": 1.0, "freewheeling_driver.threshold": 1.0},
        speed("V"),
        _SPEED,
        channel="V",
        inputs=with_pauses,
        apart=("no command", lambda run: np.abs(run.inputs[run.moments]).max(axis=1) < 1.0),
    ),
    "steering_delay": Case(
        CAR,
        {"steering_delay.delay": 0.08},
        since_steered,
        "time since steering changed [s]",
        channel="w",
        inputs=steering,
        per=per_change,
        quantity="missing moment,\nshare of the change",
        within=(0, 0.4),
    ),
    "steering_error": Case(
        CAR,
        {"steering_error.offset_steering": 0.05},
        command(1),
        "steering command [rad]",
        channel="w",
        inputs=steering,
        per=per_angle,
        quantity="missing steering [rad]",
    ),
    "steering_lag": Case(
        CAR,
        {"steering_lag.time_constant": 0.08},
        since_steered,
        "time since steering changed [s]",
        channel="w",
        inputs=steering,
        per=per_change,
        quantity="missing moment,\nshare of the change",
        within=(0, 0.4),
    ),
    "sensor_bias": Case(
        AXIS, {"sensor_bias.bias_v": 0.05}, speed("v"), _SPEED, reading=True, quantity="wrong by [m/s]"
    ),
    "sensor_scale": Case(
        AXIS, {"sensor_scale.error_v": 0.1}, speed("v"), _SPEED, reading=True, quantity="wrong by [m/s]"
    ),
    "sensor_cross_talk": Case(
        DRIVE,
        {"sensor_cross_talk.share_v_of_w": 0.08},
        speed("w"),
        "yaw rate [rad/s]",
        reading=True,
        quantity="speed wrong by [m/s]",
    ),
    "sensor_lag": Case(
        AXIS,
        {"sensor_lag.time_constant": 0.08},
        acceleration("v"),
        "acceleration [m/s²]",
        reading=True,
        quantity="wrong by [m/s]",
    ),
    "sensor_delay": Case(
        AXIS,
        {"sensor_delay.delay": 0.08},
        acceleration("v"),
        "acceleration [m/s²]",
        reading=True,
        quantity="wrong by [m/s]",
    ),
    "coulomb_friction": Case(
        AXIS.with_values(Fc=0.0).change("Fc", free=False),
        {"coulomb_friction.level": 3.0},
        speed("v"),
        _SPEED,
        inputs=small,
    ),
    "stribeck_friction": Case(
        AXIS,
        {"stribeck_friction.amplitude": 3.0, "stribeck_friction.speed": 0.06},
        speed("v"),
        _SPEED,
        inputs=small,
        within=(-0.3, 0.3),
    ),
    "asymmetric_friction": Case(DRIVE, {"asymmetric_friction.asymmetry": 0.5}, speed("v"), _SPEED, inputs=straight),
    "asymmetric_viscous_friction": Case(AXIS, {"asymmetric_viscous_friction.asymmetry": 0.6}, speed("v"), _SPEED),
    "sublinear_viscous_friction": Case(AXIS, {"sublinear_viscous_friction.deficit": 0.5}, speed("v"), _SPEED),
    "load_dependent_friction": Case(
        AXIS,
        {"load_dependent_friction.share": 0.25},
        drive_force,
        "drive force [N]",
        apart=("backwards", lambda run: speed("v")(run) < 0),
    ),
    "cogging_torque": Case(
        AXIS,
        {"cogging_torque.sine_q": 3.0, "cogging_torque.periods": 20.0},
        way("v"),
        "way [m]",
        within=(-0.6, 0.6),
    ),
    "traction_limit": Case(AXIS, {"traction_limit.inverse_limit": 1 / 9.0}, drive_force, "drive force [N]"),
    "turning_friction": Case(
        DRIVE,
        {"turning_friction.coulomb": 0.5, "turning_friction.viscous": 0.2},
        speed("w"),
        "yaw rate [rad/s]",
        channel="w",
        quantity=_MOMENT,
    ),
    "sideways_friction": Case(
        MECANUM,
        {"sideways_friction.coulomb_vy": 1.5, "sideways_friction.viscous_vy": 4.0},
        speed("vy"),
        "sideways speed [m/s]",
        channel="vy",
    ),
    "quadratic_drag": Case(AXIS, {"quadratic_drag.coefficient": 8.0}, speed("v"), _SPEED),
    "battery_sag": Case(
        OMNI,
        {"battery_sag.resistance": 0.3},
        drawn,
        "current drawn from the supply [A]",
        channel="V",
        inputs=ahead,
        per=_direction(lambda run: run.inputs[run.moments, 3]),
        quantity="missing force\nalong the command [N]",
    ),
    "motor_gain_mismatch": Case(
        DRIVE,
        {"motor_gain_mismatch.gain_u_right": 0.15},
        command(0),
        "command of the right side [V]",
        channel="w",
        quantity=_MOMENT,
    ),
    "motor_cross_talk": Case(
        DRIVE,
        {"motor_cross_talk.share_u_right_of_u_left": 0.2},
        command(1),
        "command of the left side [V]",
        channel="w",
        quantity=_MOMENT,
    ),
    "motor_heating": Case(
        OMNI,
        {"motor_heating.coefficient": 2e-4},
        moment_of_time,
        "time [s]",
        channel="V",
        inputs=ahead,
        per=_large(lambda run: 0.01 * pushed(run), 0.4),
        quantity="missing force [% of the drive]",
        seconds=(40.0, 46.0),
    ),
    "wheel_radius_mismatch": Case(
        DRIVE,
        {"radius_mismatch": 0.06},
        speed("v"),
        "forward speed, settled [m/s]",
        channel="w",
        inputs=settling,
        reading=True,
        per=settled,
        quantity="turns by itself [rad/s]",
        seconds=(0.0, 12.0),
    ),
    "effective_track": Case(
        OMNI,
        {"b": 0.23},
        lambda run: run.model[run.moments, run.column("W")],
        "yaw rate without, settled [rad/s]",
        channel="W",
        inputs=settling,
        reading=True,
        per=settled,
        quantity="turns faster by [rad/s]",
        seconds=(0.0, 12.0),
    ),
    "surface_change": Case(
        DRIVE,
        {"surface_change.coulomb": 1.5, "surface_change.angle": np.pi, "surface_change.offset": 1.0},
        way("v"),
        "way across the floor [m]",
        inputs=straight,
        per=_direction(speed("v")),
        quantity="missing force\nalong the motion [N]",
        seconds=(6.0, 16.0),
    ),
    "ground_slope": Case(DRIVE, {"ground_slope.slope_x": 0.04}, heading, "heading [degrees]"),
    "lateral_com_offset": Case(
        DRIVE, {"yc": 0.05}, acceleration("v"), "acceleration [m/s²]", channel="w", quantity=_MOMENT
    ),
    "forward_com_offset": Case(
        DRIVE,
        {"xc": 0.08},
        lambda run: speed("v")(run) * speed("w")(run),
        "speed times yaw rate [m/s²]",
        channel="w",
        quantity=_MOMENT,
    ),
    "coriolis_coupling": Case(
        OMNI,
        {"coriolis": 1.0},
        lambda run: speed("W")(run) * speed("Vn")(run),
        "yaw rate times sideways speed [m/s²]",
        channel="V",
    ),
    "backlash": Case(
        AXIS,
        {"backlash.impulse": 2.5},
        since,
        "time since the command reversed [s]",
        inputs=to_and_fro,
        per=_direction(command(0)),
        quantity="missing force\nalong the command [N]",
        within=(0, 0.4),
    ),
    "payload_change": Case(
        AXIS,
        {"payload_change.mass": 4.0, "payload_change.moment": 24.0},
        acceleration("v"),
        "acceleration [m/s²]",
        apart=("after 24 s", lambda run: run.time[run.moments] > 24.0),
        seconds=(21.0, 27.0),
    ),
}
"""One case for every mechanism of the catalogue, by its identifier."""

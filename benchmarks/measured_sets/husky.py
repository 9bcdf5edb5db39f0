"""Husky: a skid-steer robot under speed control, on wet grass and with its wheels off the ground (Norlab's DRIVE runs).

Torques are in amperes of motor current, since nothing in the logs tells the motors' constant:

    M d(eta1)/dt = sum of (i - B s - C sgn s),        J d(eta2)/dt = (b/2) (right less left of the same)
    i = Kp e + 20 A z,  dz/dt = Ki e,                 e = commanded less actual rim speed s of the side

eta1 and eta2 are the wheels' mean rim speed and their difference over the robot's width b, not the motion over ground. The
robot clips the commanded turning rate at 1 rad/s and follows it to the encoders' step (0.02 m/s) within a second, so that
the steady currents are friction alone. Inertias and gains, which the slow updates (0.15 s) do not tell, are taken as
known, and the first 1.5 s after a command are left out. A current is logged without its sign, and as nothing where the
ground drives the wheel.
"""

import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pandas as pd

from jaxid import Channels, Effect, Log, LogSet, Parameter
from jaxid.parameters import ParameterTable, parameter
from jaxid.robots.effect import Levels, Numbers, State
from jaxid.robots.effect import Scalars as Side
from jaxid.robots.robot import Robot

from . import table

RADIUS, WIDTH = 0.15875, 0.5385  # m, wheel radius and the width that the robot's own controller takes
FASTEST_TURN = 1.0  # rad/s, at which the controller clips the command: (right - left) R / b never exceeds it
_STRIDE = 3  # rows: speeds and currents are new every 0.15 s, rows come every 0.05 s
_GAP = 0.3  # s without rows beyond which a new log begins
_SECONDS = 24.0  # about four commands of six seconds
_SETTLED = 1.5  # s after a command (or the start of a log) from which currents count
_CLASSES = (0.0, 0.15, 0.3, 0.5, 0.7, 1.01)
_INTEGRAL = 20.0  # A, unit of the controller's integral state
_CHANNELS = Channels(
    ("command_eta1", "command_eta2"),
    ("left", "right"),
    units={"command_eta1": "m/s", "command_eta2": "rad/s", "eta1": "m/s", "eta2": "rad/s", "left": "A", "right": "A"},
)


@dataclass(frozen=True)
class SkidSteer(Robot):
    """Two driven sides under proportional-integral speed control; the currents of both are measured."""

    name: ClassVar[str] = "skid_steer"
    channels: ClassVar[Channels] = _CHANNELS
    velocities: ClassVar[tuple[str, ...]] = ("eta1", "eta2")
    drive_axes: ClassVar[tuple[int, ...]] = (0, 1)
    angles: ClassVar[tuple[str, ...]] = ("phi_left", "phi_right")
    turning: ClassVar[str] = "eta2"
    friction_unit: ClassVar[str] = "A"
    torque_unit: ClassVar[str] = "A"
    max_step: ClassVar[float] = 0.025

    def defaults(self) -> ParameterTable:
        start, known = "start value", "a loop that settles within half a second"
        return ParameterTable(
            {
                "C_left": parameter(3.0, "A", "Coulomb friction, left", start, free=True),
                "C_right": parameter(3.0, "A", "Coulomb friction, right", start, free=True),
                "B_left": parameter(1.0, "A s/m", "viscous friction, left", start, free=True),
                "B_right": parameter(1.0, "A s/m", "viscous friction, right", start, free=True),
                "M": parameter(10.0, "A s^2/m", "inertia forwards", known),
                "J": parameter(0.73, "A m s^2/rad", "inertia in turning", known),
                "Kp": parameter(60.0, "A s/m", "proportional gain", known),
                "Ki": parameter(15.0, "1/m", "integral gain over 20 A", known),
            }
        )

    @property
    def own_states(self) -> tuple[str, ...]:
        return ("eta1", "eta2", "z_left", "z_right")

    def rubbing(self, state: State, p: Numbers) -> Side:
        return sides(state["eta1"], state["eta2"])

    def own_coulomb(self, state: State, p: Numbers) -> Levels:
        return (p["C_left"], p["C_left"]), (p["C_right"], p["C_right"])

    def own_viscous(self, speeds: Side, state: State, p: Numbers) -> Side:
        return p["B_left"] * speeds[0], p["B_right"] * speeds[1]

    def _control(self, state: State, inputs: Side, p: Numbers) -> tuple[Side, Side]:
        """Errors of the sides' rim speeds [m/s] and the currents [A] of the controller."""
        wanted = sides(inputs[0], jnp.clip(inputs[1], -FASTEST_TURN, FASTEST_TURN))
        errors = tuple(w - s for w, s in zip(wanted, self.rubbing(state, p), strict=True))
        integrals = (state["z_left"], state["z_right"])
        return errors, tuple(p["Kp"] * e + _INTEGRAL * z for e, z in zip(errors, integrals, strict=True))

    def motor(self, volts: Side, state: State, p: Numbers) -> Side:
        return self._control(state, volts, p)[1]

    def motion(self, state: State, volts: Side, torques: Side, resisting: Side, forces: Side, p: Numbers) -> State:
        errors, _ = self._control(state, volts, p)
        left, right = (t - r for t, r in zip(torques, resisting, strict=True))
        return {
            "eta1": (left + right + forces[0]) / p["M"],
            "eta2": (0.5 * WIDTH * (right - left) + forces[1]) / p["J"],
            "z_left": p["Ki"] * errors[0],
            "z_right": p["Ki"] * errors[1],
        }

    def angle_rates(self, state: State, p: Numbers) -> Side:
        return tuple(speed / RADIUS for speed in self.rubbing(state, p))

    def observe(self, state: State, inputs: Side, p: Numbers) -> Side:
        speeds, (_, currents) = self.rubbing(state, p), self._control(state, inputs, p)
        seen: Side = tuple(jnp.where(i * s < 0.0, 0.0, jnp.abs(i)) for i, s in zip(currents, speeds, strict=True))
        return seen


def sides(ahead, turning):
    """Rim speeds (left, right) [m/s]."""
    return ahead - 0.5 * WIDTH * turning, ahead + 0.5 * WIDTH * turning


@dataclass(frozen=True)
class Scrub(Effect):
    """Torque of wheels that are dragged sideways in a turn: it opposes turning and does not grow with its rate.

    `level` over the width b is the current that it takes on each side.
    """

    id: ClassVar[str] = "turn_scrub"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "torque' = torque - level * tanh(eta2 / 0.05 rad/s)"
    width: ClassVar[float] = 0.05

    def parameters(self, robot) -> dict[str, Parameter]:
        return {self.key("level"): Parameter(0.0, "A m", free=True, typical=1.0)}

    def force(self, forces: Side, state: State, p: Numbers, robot: Robot) -> Side:
        return forces[0], forces[1] - p[self.key("level")] * jnp.tanh(state["eta2"] / self.width)


@dataclass(frozen=True)
class TurningDrag(Effect):
    """Torque against turning that grows with its rate."""

    id: ClassVar[str] = "turning_drag"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "torque' = torque - coefficient * eta2"

    def parameters(self, robot) -> dict[str, Parameter]:
        return {self.key("coefficient"): Parameter(0.0, "A m s/rad", free=True, typical=1.0)}

    def force(self, forces: Side, state: State, p: Numbers, robot: Robot) -> Side:
        return forces[0], forces[1] - p[self.key("coefficient")] * state["eta2"]


def table_of(folder: Path, ground: str) -> pd.DataFrame:
    """The rows of a run ("wetgrass" or "wheels_up") in which the protocol was driven."""
    rows = pd.read_csv(folder / f"husky_{ground}.csv.gz")
    return rows[rows["calib_state"] == "calib"].reset_index(drop=True)


def load(folder: Path, ground: str) -> LogSet:
    """A run as logs of about 24 s, every third row, cut where rows are missing."""
    rows = table_of(folder, ground)
    logs = []
    for _, piece in rows.groupby((rows["t"].diff() > _GAP).cumsum()):
        parts = max(1, round((piece["t"].iloc[-1] - piece["t"].iloc[0]) / _SECONDS))
        for part in np.array_split(np.arange(len(piece))[::_STRIDE], parts):
            own = piece.iloc[part]
            if len(own) * 0.15 < 0.5 * _SECONDS:
                continue
            left, right = (RADIUS * own[f"meas_{side}_vel"].to_numpy() for side in ("left", "right"))
            commands = own[["cmd_vel_x", "cmd_vel_omega"]].to_numpy()
            time = own["t"].to_numpy()
            changed = np.any(np.diff(commands, axis=0, prepend=np.nan) != 0, axis=1)
            since = time - np.maximum.accumulate(np.where(changed, time, -np.inf))
            currents = own[["left_wheel_current", "right_wheel_current"]].to_numpy()
            currents = np.where(since[:, None] >= _SETTLED, currents, np.nan)
            speeds = pd.DataFrame({"eta1": 0.5 * (left + right), "eta2": (right - left) / WIDTH})
            log = Log.from_arrays(f"{ground} {time[0]:.0f} s", time - time[0], commands, currents, _CHANNELS)
            logs.append(replace(log, extra=speeds))
    return LogSet(logs)


def turning_costs(folder: Path, ground: str) -> list[dict[str, float]]:
    """What turning costs, without any model: the mean current of both sides together [A] over the last two seconds of each
    command, by `turning`, the share |difference| / (|sum| + |difference|) of the rim speeds (0 straight, 1 on the spot).

    Each class with its `commands`, mean rim speed [m/s], `current` [A] and its standard error. Commands slower than 0.06 m/s
    (three steps of the encoder) are left out.
    """
    rows = table_of(folder, ground)
    steady = []
    for _, own in rows.groupby((rows["calib_step"].diff() != 0).cumsum()):
        end = own[own["t"] > own["t"].iloc[-1] - 2.0]
        left, right = (RADIUS * end[f"meas_{side}_vel"].mean() for side in ("left", "right"))
        current = end["left_wheel_current"].mean() + end["right_wheel_current"].mean()
        turning = abs(right - left) / max(abs(right - left) + abs(right + left), 1e-9)
        steady.append((turning, 0.5 * (abs(left) + abs(right)), current))
    values = np.array([row for row in steady if row[1] > 0.06])
    classes = []
    for low, high in itertools.pairwise(_CLASSES):
        own = values[(values[:, 0] >= low) & (values[:, 0] < high)]
        classes.append(
            {
                "from": low,
                "to": min(high, 1.0),
                "commands": len(own),
                "rim_speed": float(own[:, 1].mean()),
                "current": float(own[:, 2].mean()),
                "std_error": float(own[:, 2].std(ddof=1) / np.sqrt(len(own))),
            }
        )
    return classes


def text(classes: list[dict[str, float]]) -> str:
    """`turning_costs` as a table with a sentence."""
    rows = [
        (
            f"{c['from']:.2g} to {c['to']:.2g}",
            c["commands"],
            f"{c['rim_speed']:.2f}",
            f"{c['current']:.1f} ± {c['std_error']:.1f}",
        )
        for c in classes
    ]
    header = ("turning share", "commands", "mean rim speed [m/s]", "current, both sides [A] ± standard error")
    return f"""Without any model, the mean current of both sides together over the last two seconds of each command, by the
share of turning in the wheels' motion (0 straight, 1 on the spot):

{table(header, rows)}"""

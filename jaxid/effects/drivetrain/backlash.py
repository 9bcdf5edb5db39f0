"""Play between motor and wheel: Nordin and Gutman, Automatica 38 (2002).

While the teeth do not touch no torque passes, and the motor, whose own inertia is small, turns at once as fast as it would
without a load: faster than the wheel by torque over d, where d is the slope of torque by speed. The play is crossed when
the time integral of that torque reaches d times the width of the play, the `impulse`. Robots whose motors' inertia counts more
than their back-EMF cross it a little later.
"""

from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import jax
import jax.numpy as jnp

from ...kernel.recurrence import clipped
from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen, one_by_one
from ...robots.robot import Robot
from ..actuator.drives import drive_names, input_unit, on_drives, one_torque_each
from ..effect_parameters import positive, shape, shortest

_SOFT = 0.4
"""Share of half the play within which the teeth take up the torque, so that it differentiates."""
_FASTEST = 0.25
"""Sampling intervals that half the play takes at least."""
_TINY = 1e-30
_MEETING = 0.05
"""Share of half the play over which teeth that meet take up their damping, so that it differentiates."""
_STIFFEST = 0.1
"""Sampling intervals of a radian of the oscillation of the stiffest teeth."""
_RATIO = 0.6180339887
_RINGS = 0.3
"""Damping ratio of teeth that have met."""
_LATE = ("motor_lag", "input_delay", "sensor_lag", "sensor_delay")
"""What a motor with an inertia of its own, behind its play, looks like."""
_OWN_INERTIA = (
    "a motor with an inertia of its own on the near side of the play, or teeth that give; the robot's inertia found here is "
    "then that of the far side alone. Commands that never reverse, which leave the teeth in touch, would show no lag then"
)
_SHARES = (0.01, 0.03, 0.1, 0.3)
"""Impulses that are tried, in units of the largest torque for one time constant of the robot, and widths in units of the
largest input."""


@dataclass(frozen=True)
class GearPlay(Effect):
    """Every drive has a play, which a torque crosses by an `impulse` [torque times s] before it arrives.

    The states are where in its play each drive is: -1 and 1 where the teeth touch, the middle at the start.
    """

    id: ClassVar[str] = "backlash"
    law: ClassVar[str] = "gear_play"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "torque' = torque where |q| = 1, else 0; impulse * dq/dt = 2 torque within |q| < 1"
    finer: ClassVar[float] = 2.0
    also_seen_as: ClassVar[tuple[str, ...]] = _LATE
    why_also: ClassVar[str] = _OWN_INERTIA

    def refusal(self, robot: Robot) -> str | None:
        if one_torque_each(robot):
            return None
        return (
            f"{robot.name!r} has not one drive torque for every drive input, so that {self.title} has none to hold back"
        )

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return tuple(self.own(f"play_{name}") for name in drive_names(robot))

    def names(self, robot: Robot) -> list[str]:
        """The parameter that is each drive's impulse."""
        return [self.key("impulse") for _ in drive_names(robot)]

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.1 * robot.scales.torque * robot.scales.time
        found: dict[str, Parameter] = {}
        for name in self.names(robot):
            found |= positive(self, name.removeprefix(self.key("")), f"{robot.torque_unit} s", typical)
        return found | shortest(self, _FASTEST * robot.scales.interval)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names, impulse = dict.fromkeys(self.names(robot)), robot.scales.torque * robot.scales.time
        return tuple(Probe(dict.fromkeys(names, share * impulse), out_of=len(_SHARES)) for share in _SHARES)

    def _crossing(self, torque: Scalar, place: Scalar, impulse: Scalar, p: Numbers) -> tuple[Scalar, Scalar, Scalar]:
        """Whether the teeth touch in the torque's direction, the rate of the place in the play, and how much of a play there
        is: none where it is crossed within a step."""
        least = 2.0 * jnp.abs(torque) * p[self.key("shortest")] + _TINY
        touch = jnp.clip((place * jnp.sign(torque) - (1.0 - _SOFT)) / _SOFT, 0.0, 1.0)
        return touch, 2.0 * torque / (impulse + least) * (1.0 - touch), impulse / (impulse + least)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed = []
        for t, name, place in zip(torques, self.names(robot), self.states_on(robot), strict=True):
            touch, _, play = self._crossing(t, state[place], p[name], p)
            changed.append(t * (1.0 - play * (1.0 - touch)))
        return tuple(changed)

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot, torques: Scalars = ()) -> State:
        found = {}
        for t, name, place in zip(torques, self.names(robot), self.states_on(robot), strict=True):
            found[place] = self._crossing(t, state[place], p[name], p)[1]
        return found


@dataclass(frozen=True)
class PlayOfEach(GearPlay):
    """Every drive with a play of its own."""

    law: ClassVar[str] = "per_drive"
    formula: ClassVar[str] = (
        "torque_i' = torque_i where |q_i| = 1, else 0; impulse_i * dq_i/dt = 2 torque_i within |q_i| < 1"
    )

    def refusal(self, robot: Robot) -> str | None:
        if len(robot.drive_inputs) < 2:
            return f"{robot.name!r} has one drive, of which {self.id} has a law"
        return super().refusal(robot)

    def names(self, robot: Robot) -> list[str]:
        return [self.key(f"impulse_{name}") for name in drive_names(robot)]

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        impulse = robot.scales.torque * robot.scales.time
        sizes = [share * impulse for share in _SHARES]
        return tuple(Probe(dict.fromkeys(self.names(robot), size), out_of=len(sizes)) for size in sizes)


@dataclass(frozen=True)
class MotorBehindPlay(Effect):
    """A motor with an inertia of its own, which runs through the play and meets teeth that give: two masses and a spring.

    The states of a drive are where the motor is ahead of its wheel, from the middle of the play, and how fast it turns. The
    inertia of a wheel with what turns with it, and the mass of a robot of one drive, stay those of both sides together, where
    the robot says which parameters they are; any other inertia is that beyond the play.
    """

    id: ClassVar[str] = "backlash"
    law: ClassVar[str] = "motor_behind_play"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = (
        "inertia * dw/dt = torque(w) - torque', dq/dt = w - wheel's speed, torque' = inertia ((|q| - width / 2) sign(q) / "
        "ring^2 + 2 damping dq/dt / ring) where |q| > width / 2, else 0, pushing only; an inertia of a wheel with its rotor "
        "and the mass of a robot of one drive, are those of both sides, any other that beyond the play"
    )
    finer: ClassVar[float] = 2.0

    def refusal(self, robot: Robot) -> str | None:
        if len(robot.angles) != len(robot.drive_inputs):
            return f"{robot.name!r} has not one wheel's angle for every drive input, which {self.title} asks for"
        return GearPlay().refusal(robot)

    def _places(self, robot: Robot) -> tuple[str, ...]:
        return tuple(self.own(f"play_{name}") for name in drive_names(robot))

    def _speeds(self, robot: Robot) -> tuple[str, ...]:
        return tuple(self.own(f"motor_speed_{name}") for name in drive_names(robot))

    def states_on(self, robot: Robot) -> tuple[str, ...]:
        return self._places(robot) + self._speeds(robot)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        scales, angle = robot.scales, robot.angle_unit
        rate = _turning(robot)
        # What is crossed within a sample hardly shows, however quick the robot is.
        width = rate * max(0.05 * scales.time, scales.interval)
        inertia = self._of_a_wheel(robot) or 0.05 * scales.torque * scales.time / rate
        found = positive(self, "width", angle, width)
        found |= shape(self, "inertia", f"{robot.torque_unit} s^2/{angle}", inertia)
        found |= shape(self, "ring", "s", 2.0 * scales.interval)
        found |= shape(self, "damping", "", _RINGS)
        found |= shape(self, "least", f"{robot.torque_unit} s^2", 1e-3 * inertia * width, free=False)
        return found | shortest(self, _STIFFEST * scales.interval)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        width, inertia, ring = (self.key(name) for name in ("width", "inertia", "ring"))
        typical = robot.parameters[width].typical or 1.0
        light_and_heavy = (0.5, 1.6) if self._of_a_wheel(robot) else (1.0, 4.0)
        tried = list(product((0.4, 1.6), light_and_heavy, (0.25, 1.0)))
        return tuple(
            Probe(
                {width: typical * wide},
                {inertia: robot.parameters[inertia].value * heavy, ring: robot.parameters[ring].value * soft},
                out_of=len(tried),
            )
            for wide, heavy, soft in tried
        )

    def _of_a_wheel(self, robot: Robot) -> float:
        """Half the inertia of what turns with a wheel, of which the motor's is a part; zero where no table says it."""
        named = robot.wheel_inertia in robot.parameters
        return 0.5 * robot.parameters[robot.wheel_inertia].value if named else 0.0

    def _there(self, p: Numbers) -> Scalar:
        """0 without a play, which passes on the torque as it is, 1 with any that counts."""
        size = p[self.key("inertia")] * p[self.key("width")]
        return size / (size + p[self.key("least")])

    def _passed(self, place: Scalar, ahead: Scalar, p: Numbers) -> Scalar:
        """What the teeth pass on."""
        ring, half = jnp.maximum(p[self.key("ring")], p[self.key("shortest")]), 0.5 * p[self.key("width")]
        beyond, side = jnp.maximum(jnp.abs(place) - half, 0.0), jnp.sign(place)
        touch = jnp.clip(beyond / (_MEETING * half + _TINY), 0.0, 1.0)
        pushed = beyond / ring**2 + 2.0 * p[self.key("damping")] * touch * side * ahead / ring
        return p[self.key("inertia")] * side * jnp.maximum(pushed, 0.0)

    def _ahead(self, state: State, p: Numbers, robot: Robot) -> Scalars:
        turning = robot.angle_rates(state, p)
        return tuple(state[name] - w for name, w in zip(self._speeds(robot), turning, strict=True))

    def numbers(self, p: Numbers, state: State, robot: Robot) -> Numbers:
        near, mechanism = self._there(p) * p[self.key("inertia")], robot.mechanisms.get("payload_change", ())
        if robot.wheel_inertia in p:
            # A table that says nothing of what turns with a wheel holds 0, and the motor's comes on top.
            return {**p, robot.wheel_inertia: jnp.maximum(p[robot.wheel_inertia] - near, 0.0)}
        if len(robot.drive_inputs) != 1 or not mechanism:
            return p
        return {**p, mechanism[0]: p[mechanism[0]] - near}

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        there, drives = self._there(p), zip(self._places(robot), self._ahead(state, p, robot), strict=True)
        return tuple(
            t + there * (self._passed(state[place], ahead, p) - t)
            for t, (place, ahead) in zip(torques, drives, strict=True)
        )

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: Robot, torques: Scalars = ()) -> State:
        found, slopes = {}, _falls_with_speed(robot, p)
        drives = zip(
            torques, slopes, self._places(robot), self._speeds(robot), self._ahead(state, p, robot), strict=True
        )
        for t, slope, place, speed, ahead in drives:
            found[place] = ahead
            found[speed] = (t - slope * ahead - self._passed(state[place], ahead, p)) / p[self.key("inertia")]
        return found


def _turning(robot: Robot) -> float:
    """How fast the drives turn when the robot moves at its usual speed, in the unit of their angles."""
    speed, p = robot.scales.speed, robot.parameters.numbers
    moving = dict.fromkeys(robot.states, 0.0) | {robot.velocities[0]: speed}
    with jax.ensure_compile_time_eval():
        return max((abs(float(rate)) for rate in robot.angle_rates(moving, p)), default=0.0) or speed


def _falls_with_speed(robot: Robot, p: Numbers) -> Scalars:
    """By how much each drive torque falls with its motor's speed, as a back-EMF makes it: the slope, that of a line."""
    idle, rest = (0.0,) * len(robot.channels.inputs), dict.fromkeys(robot.states, 0.0)
    # Speeds of no simple ratio, so that no wheel stands still while the robot turns about it.
    moving = rest | {name: _RATIO**k for k, name in enumerate(robot.velocities)}
    at_rest, braked = (robot.drive_torques(idle, state, p) for state in (rest, moving))
    turning = robot.angle_rates(moving, p)
    return tuple((a - b) / w for a, b, w in zip(at_rest, braked, turning, strict=True))


@dataclass(frozen=True)
class PlayOfCommands(Effect):
    """The play operator on every command, which follows its input at a distance of at most half the `width`; from zero."""

    id: ClassVar[str] = "backlash"
    law: ClassVar[str] = "command"
    settles: ClassVar[bool] = True
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "u' = clip(u' before, u - width / 2, u + width / 2)"
    also_seen_as: ClassVar[tuple[str, ...]] = _LATE
    why_also: ClassVar[str] = _OWN_INERTIA

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "width", input_unit(robot), 0.1 * robot.scales.input)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        return one_by_one(self.key("width"), tuple(share * seen.largest_input for share in _SHARES))

    def command(self, inputs, time, dt, p: Numbers, robot: Robot):
        half = 0.5 * p[self.key("width")]
        return on_drives(robot, inputs, clipped(inputs - half, inputs + half))


LAWS: tuple[Effect, ...] = (GearPlay(), MotorBehindPlay(), PlayOfEach(), PlayOfCommands())

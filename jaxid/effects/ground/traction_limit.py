"""Drive force that the ground limits: slip (Pacejka, Tire and Vehicle Dynamics)."""

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalar, Scalars, State
from ...robots.probe import Probe, Seen
from ...robots.robot import Robot
from ..actuator.drives import back_emf, input_unit
from ..curve import Curve, rises_early
from ..effect_parameters import positive

_SHARES = (0.09, 0.14, 0.21, 0.3, 0.43, 0.6, 0.86, 1.2)
"""Limits of traction that are tried, in shares of the drive force at the largest input."""
_CURRENT = (
    "a limit of the motors' current, or torque, in their driver, which limits the same force: a wheel that turns faster than "
    "the ground passes, or a current that is logged, tells them apart"
)


def _wheels(robot: Robot) -> tuple[str, ...]:
    """The wheels that drive, counted from 1."""
    zero = dict.fromkeys(robot.states, 0.0) | robot.initial_state()
    idle = (0.0,) * len(robot.channels.inputs)
    return tuple(str(k + 1) for k in range(len(robot.drive_torques(idle, zero, robot.parameters.numbers))))


@dataclass(frozen=True)
class TractionLimit(Effect):
    """Drive force of every wheel limited by the ground: slip. `inverse_limit = 1 / limit`, zero for no limit."""

    id: ClassVar[str] = "traction_limit"
    law: ClassVar[str] = "hard"
    where: ClassVar[str] = "ground contact"
    same_as: ClassVar[str] = _CURRENT
    formula: ClassVar[str] = "f' = clip(f, -limit, limit), limit = 1 / inverse_limit"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "inverse_limit", f"1/{robot.ground_force_unit}", 1.1 / robot.scales.force)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        name, force = self.key("inverse_limit"), robot.scales.force
        return tuple(Probe({name: 1 / (share * force)}, limits={name: 1.2 * share * force}) for share in _SHARES)

    def kept(self, f: Scalar, wheel: int, p: Numbers) -> Scalar:
        """The share of the demanded force `f` that a wheel transmits."""
        return 1.0 / jnp.maximum(1.0, jnp.abs(f) * p[self.key("inverse_limit")])

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        forces = robot.drive_forces(torques, p)
        return tuple(t * self.kept(f, k, p) for k, (t, f) in enumerate(zip(torques, forces, strict=True)))


@dataclass(frozen=True)
class SoftTractionLimit(TractionLimit):
    """`f' = limit tanh(f / limit)`."""

    law: ClassVar[str] = "tanh"
    formula: ClassVar[str] = "f' = limit tanh(f / limit), limit = 1 / inverse_limit"

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        name, force = self.key("inverse_limit"), robot.scales.force
        return tuple(Probe({name: 1 / (share * force)}) for share in (3.0, 1.7, 1.0, 0.6, 0.35, 0.2))

    def kept(self, f: Scalar, wheel: int, p: Numbers) -> Scalar:
        x = f * p[self.key("inverse_limit")]
        near = jnp.abs(x) < 1e-3  # where the quotient is 0 / 0
        return jnp.where(near, 1.0 - x * x / 3.0, jnp.tanh(x) / jnp.where(near, 1.0, x))


@dataclass(frozen=True)
class LimitOfEach(TractionLimit):
    """Every wheel with a limit of its own, as by the load on it."""

    law: ClassVar[str] = "per_wheel"
    formula: ClassVar[str] = "f_i' = clip(f_i, -limit_i, limit_i), limit_i = 1 / inverse_limit_i"
    needs: ClassVar[tuple[str, ...]] = ("several_drives",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        for k in _wheels(robot):
            found |= positive(self, f"inverse_limit_{k}", f"1/{robot.ground_force_unit}", 1.1 / robot.scales.force)
        return found

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        names, force = [self.key(f"inverse_limit_{k}") for k in _wheels(robot)], robot.scales.force
        return tuple(
            Probe(dict.fromkeys(names, 1 / (s * force)), limits=dict.fromkeys(names, 1.2 * s * force)) for s in _SHARES
        )

    def kept(self, f: Scalar, wheel: int, p: Numbers) -> Scalar:
        return 1.0 / jnp.maximum(1.0, jnp.abs(f) * p[self.key(f"inverse_limit_{wheel + 1}")])


@dataclass(frozen=True)
class TractionCurve(Curve):
    """What is lost of a drive force, a curve of the force that is demanded."""

    id: ClassVar[str] = "traction_limit"
    where: ClassVar[str] = "ground contact"
    same_as: ClassVar[str] = _CURRENT
    formula: ClassVar[str] = "f' = f - lost(|f|) sgn f"
    needs: ClassVar[tuple[str, ...]] = ("torque",)
    knots: ClassVar[tuple[float, ...]] = (0.0, 0.2, 0.4, 0.7, 1.0)
    free: ClassVar[tuple[int, ...]] = (1, 2, 3, 4)
    begins_later: ClassVar[bool] = True
    rather: ClassVar[str] = "actuator_dead_zone"
    may_as_well: ClassVar[str] = "voltage_saturation"
    variable: ClassVar[str] = "|drive force|"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        unit, largest = robot.ground_force_unit, robot.scales.force
        return self.heights_and_reach(robot, unit, 0.05 * largest, unit, largest)

    def agrees(self, robot: Robot) -> bool:
        """Whether it is large forces that lose: what is lost of small ones is lost of the command that makes them."""
        largest, numbers = np.linspace(0.0, robot.scales.force, 101), robot.parameters.numbers
        lost = [np.asarray(self.at(largest, numbers, name)) for name in self.each(robot)]
        return not rises_early(largest, np.mean(lost, axis=0))

    def parts(self, robot: Robot) -> tuple[str, ...]:
        return _wheels(robot)

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        forces = robot.drive_forces(torques, p)
        tiny = 1e-9 * robot.scales.force
        kept = []
        for k, (t, f) in enumerate(zip(torques, forces, strict=True)):
            size = jnp.abs(f)
            lost = self.at(size, p, self.of(str(k + 1)))
            kept.append(t * (1.0 - jnp.minimum(lost, size) / (size + tiny)))
        return tuple(kept)


@dataclass(frozen=True)
class Creep(Effect):
    """Wheels that creep: each turns faster than the floor passes by a share of its speed in proportion to its drive force, so
    that its motor's back-EMF is larger and less current flows (Pacejka's slip stiffness; Kalker's linear theory).

    `slip` is the share that a wheel creeps at the force of one volt at standstill.
    """

    id: ClassVar[str] = "traction_limit"
    law: ClassVar[str] = "creep"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "i' = i / (1 + slip |back-EMF|)"
    needs: ClassVar[tuple[str, ...]] = ("winding",)

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return positive(self, "slip", f"1/{input_unit(robot)}", 0.2 / robot.scales.input)

    @property
    def denser(self) -> Effect | None:
        return CreepAtRest(stands_as=self.stands_as)

    def volts_at_rest(self, p: Numbers) -> Scalar | float:
        """Back-EMF by which a wheel that demands a force creeps however slow it is."""
        return 0.0

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed, slip = list(volts), p[self.key("slip")]
        for k in robot.drive_inputs:
            emf = back_emf(volts, currents, k, p, robot)
            changed[k] = emf + (volts[k] - emf) / (1.0 + slip * (jnp.abs(emf) + self.volts_at_rest(p)))
        return tuple(changed)


@dataclass(frozen=True)
class CreepAtRest(Creep):
    """Creep that does not end at standstill, where the slip is by a speed and not by a ratio (Bernard & Clover, SAE 950311):
    looked for where creep alone leaves something."""

    law: ClassVar[str] = "creep_at_rest"
    first_look: ClassVar[bool] = False
    formula: ClassVar[str] = "i' = i / (1 + slip (|back-EMF| + at_rest))"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        # A constant share of the current is another thing's, but the slip itself is seen only with this beside it.
        return super().parameters(robot) | positive(self, "at_rest", input_unit(robot), 0.05 * robot.scales.input)

    @property
    def denser(self) -> Effect | None:
        return None

    def volts_at_rest(self, p: Numbers) -> Scalar | float:
        return p[self.key("at_rest")]


LAWS: tuple[Effect, ...] = (
    TractionLimit(),
    SoftTractionLimit(),
    LimitOfEach(),
    Creep(),
    CreepAtRest(),
    TractionCurve(),
)

"""What an effect may do to a robot.

A model is a robot plus a sum of effects. An effect overrides the stage of the signal path at which it acts and leaves
the others as they are: command -> supply -> torque -> dry and viscous friction -> body force -> measurement. Its
parameters are zero when it is absent, and then the model is the robot's own.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from jaxtyping import Array, Float

from ..parameters import Parameter

# One number, or one for each lane of a batch: traced arrays and plain floats alike.
Scalar = Any
State = dict[str, Scalar]
Numbers = Mapping[str, Scalar]
Path = tuple[Scalar, ...]
Levels = tuple[tuple[Scalar, Scalar], ...]


@dataclass(frozen=True)
class Effect:
    """Base of all effects: every stage passes its signal on unchanged.

    Class attributes of an effect: `id` (the public identifier), `where` (actuator, drivetrain, ground contact, body or
    sensor), `formula`, `states` (names of extra states, zero at the start), `needs` (groups of robot states it reads, such
    as "pose" or "wheel_angles") and `frees` (parameters of the robot itself that the effect lets vary). Inside the
    stages `p` holds all parameters of the model; an effect's own are found under `self.key("name")`.
    """

    id: ClassVar[str] = ""
    where: ClassVar[str] = ""
    formula: ClassVar[str] = ""
    frees: ClassVar[tuple[str, ...]] = ()
    states: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[tuple[str, ...]] = ()
    max_step: ClassVar[float] = float("inf")
    """Longest integration step [s] for which the effect's own parameters come out right."""

    @property
    def repeats(self) -> bool:
        """Whether it repeats with the driving wheels' angles."""
        return "wheel_angles" in self.needs

    @property
    def blurred(self) -> "Effect":
        """The effect while it is searched for: one with an edge may make it wider, so that it is found from farther."""
        return self

    @property
    def sharp(self) -> "Effect":
        """The effect as it is once found."""
        return self

    def key(self, name: str) -> str:
        """The name under which this effect's parameter stands in the model's table."""
        return f"{self.id}.{name}"

    def parameters(self, robot: Any) -> dict[str, Parameter]:
        """The effect's parameters for this robot by `key`; all zero means absent."""
        return {}

    def command(self, inputs: Float[Array, "T nu"], time: Float[Array, " T"], dt: Float[Array, " T"], p: Numbers):
        """Whole commanded signals -> signals that reach the motors, on the integration grid [T, nu]."""
        return inputs

    def supply(self, volts: Path, currents: Path, state: State, p: Numbers) -> Path:
        """Motor voltages [V], given the currents [A] they would cause."""
        return volts

    def torque(self, torques: Path, state: State, p: Numbers) -> Path:
        """Drive torques or forces at the wheels."""
        return torques

    def dry(self, levels: Levels, speeds: Path, state: State, p: Numbers) -> Levels:
        """(backward, forward) Coulomb levels of every rubbing axis, both positive."""
        return levels

    def viscous(self, resistance: Path, speeds: Path, state: State, p: Numbers) -> Path:
        """Speed-dependent resisting torques of every rubbing axis."""
        return resistance

    def force(self, forces: Path, state: State, p: Numbers) -> Path:
        """Generalised forces that act on the body, one per velocity."""
        return forces

    def rates(self, state: State, currents: Path, p: Numbers) -> State:
        """Time derivatives of the effect's own states."""
        return {}

    def measure(self, outputs: Float[Array, "T ny"], time: Float[Array, " T"], p: Numbers) -> Float[Array, "T ny"]:
        """Whole simulated outputs -> what the sensors report, on the integration grid."""
        return outputs

"""What an effect may do to a robot.

A model is a robot plus a sum of effects. An effect overrides the stage of the signal path (`signal_path`) at which it acts
and leaves the others as they are: command -> supply -> torque -> dry and viscous friction -> body force -> measurement. Its
parameters are zero when it is absent, and then the model is the robot's own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Self

from jaxtyping import Array, Float

from ..parameters import Parameter
from .draw import Draw
from .probe import Probe, Seen, moved

if TYPE_CHECKING:
    from .robot import Robot

# One number, or one for each lane of a batch: traced arrays and plain floats alike.
Scalar = Any
State = dict[str, Scalar]
Numbers = Mapping[str, Scalar]
# One number for each axis, input or generalised force.
Scalars = tuple[Scalar, ...]
Levels = tuple[tuple[Scalar, Scalar], ...]


_AS_WRITTEN = {"stribeck": "Stribeck", "coriolis": "Coriolis", "coulomb": "Coulomb", "com": "centre-of-mass"}


def in_words(identifier: str) -> str:
    """An identifier as words, as a sentence has them: "stribeck_friction" becomes "Stribeck friction"."""
    return " ".join(_AS_WRITTEN.get(word, word) for word in identifier.split("_"))


class EffectError(ValueError):
    """An effect that a robot cannot have, or that does what an effect must not; the message says what to change."""


@dataclass(frozen=True)
class Effect:
    """Base of all effects: every stage passes its signal on unchanged.

    Class attributes of an effect: `id` (the public identifier of the mechanism), `law` (how this effect writes it, where
    there are several ways), `where` (actuator, drivetrain, ground contact, body or sensor), `formula`, `states` (names of
    extra states, zero at the start) and `needs` (the robot's traits that it asks for, such as "pose" or "wheel_angles";
    those that its stages imply need not be named). Inside the stages `p` holds all parameters of the model, an effect's own
    under `self.key("name")`, and `robot` is the robot it acts on, asked for what it says of itself: an effect holds no
    robot, so that the same model built twice is the same. A stage that does not ask may leave the argument `robot` out.

    `stands_as` tells two laws of one mechanism apart that stand in one model, as when both are screened; else it is empty.
    """

    stands_as: str = field(default="", kw_only=True, repr=False)

    id: ClassVar[str] = ""
    law: ClassVar[str] = ""
    where: ClassVar[str] = ""
    formula: ClassVar[str] = ""
    states: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[tuple[str, ...]] = ()
    from_columns: ClassVar[tuple[str, ...]] = ()
    """Those of `states` that begin at the first value of the column of that name, in logs that have it."""
    first_look: ClassVar[bool] = True
    """Whether it is tried by itself; else only where another law of the mechanism, whose `denser` it is, leaves something."""
    only_later: ClassVar[bool] = False
    """Whether all it does is that the same motion is seen later."""
    ahead: ClassVar[float] = 0.0
    """Share of what it looks at that is still to come, as where logs were smoothed afterwards."""
    late: ClassVar[bool] = False
    """Whether it is a delay or a lag, so that the motion between samples tells it from others."""
    rather: ClassVar[str] = ""
    """The mechanism that a law without a formula may rather be, and that is asked, too, where it explains best; mostly none."""
    otherwise: ClassVar[str] = ""
    """What of the robot itself does the same, in words, so that no log tells it apart where the table does not hold it."""
    same_as: ClassVar[str] = ""
    """What no effect has the name of and does the same, in words, with what would tell the two apart."""
    also_seen_as: ClassVar[tuple[str, ...]] = ()
    """Effects that may be a part of this one where both are found, since none of its laws has that part."""
    why_also: ClassVar[str] = ""
    """What that part is, and what would tell."""
    since_start: ClassVar[bool] = False
    """Whether it counts time, or what has happened, since the start of a log, which a window cut out of it does not know."""
    settles: ClassVar[bool] = False
    """Whether all that it remembers of a command is gone once another was held for long, so that a log that begins in motion
    may be taken to begin with its first command held."""
    memoryless: ClassVar[bool] = False
    """Whether what it makes of a command depends on nothing but that command: not on earlier ones, and not on the time."""
    upon: ClassVar[str] = ""
    """Another effect that changes what this one does: it is looked for only where the robot cannot have that one, or has it."""
    finer: ClassVar[float] = 1.0
    """How many times shorter than the robot's the integration steps must be for the effect's own parameters."""

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

    @property
    def sharper(self) -> "Effect":
        """The effect a step nearer to `sharp`: where samples close to the edge alone say where it is, it is followed there."""
        return self.sharp

    def in_common(self, robot: "Robot") -> str:
        """Of a law with a delay for each of several things: the id of the effect that makes all as late as the least of them
        is, which no data tells apart; empty where something else of the robot would be late then, too."""
        return ""

    def same_on(self, robot: "Robot") -> str:
        """The id of the effect that does just the same to `robot`, by its numbers there, but for how it is worked out; mostly
        empty."""
        return ""

    def elsewhere(self, robot: "Robot") -> Mapping[str, float]:
        """Other values of its parameters from which a search that has ended at those of `robot` may end better; often none."""
        return {}

    def draws(self, p: Numbers, robot: "Robot") -> Sequence[Draw]:
        """Where its law is the mean over what chance does: the ways in which chance may do it to `robot`; mostly none."""
        return ()

    def told_by_size(self, p: Numbers, robot: "Robot") -> Mapping[str, Sequence[float]]:
        """A parameter of which the size of what chance leaves tells more than the mean does, and values of it, increasing, in
        whose range it is; mostly none."""
        return {}

    def may_hold(self, robot: "Robot") -> Sequence[str]:
        """Parameters of its own, each of which may be held at zero where the others can do all that it does; mostly none."""
        return ()

    def either_nominal(self, robot: "Robot") -> Mapping[str, str]:
        """Its shares, of which the data may tell only by how much they differ, each with what it means that it is none; mostly
        none."""
        return {}

    def sides_exchanged(self, robot: "Robot", x: float, y: float) -> Mapping[str, float]:
        """Where a robot that begins at that place begins on the far side of what it has beyond a line: values of its
        parameters with the sides exchanged, beside which the robot's own are those of where it begins; else none."""
        return {}

    def conventions(self, robot: "Robot") -> Mapping[str, Mapping[str, float]]:
        """What of `robot` would be otherwise where the table counts from something else, which no log may tell: values of its
        parameters, each set with what it supposes, in words; mostly none."""
        return {}

    def doubt(self, robot: "Robot") -> str:
        """Why the numbers, or the curve, that `robot` has of it are none that this mechanism may have, in words; empty where
        they may be its own."""
        return ""

    def doubt_of_change(self, robot: "Robot") -> str:
        """Why the numbers that `robot` has of it are hardly what came or went between two sets of logs, in words; empty where
        they may be."""
        return ""

    def key(self, name: str) -> str:
        """The name under which this effect's parameter stands in the model's table."""
        return f"{self.stands_as or self.id}.{name}"

    def own(self, state: str) -> str:
        """The name of a state of the effect's own: as it is, or told apart from that of another law."""
        return f"{state}@{self.stands_as}" if self.stands_as else state

    @property
    def denser(self) -> "Effect | None":
        """The same with further parameters, where this leaves something; what has the same name means the same. None: there is
        no such law."""
        return None

    @property
    def freer(self) -> "Effect | None":
        """The mechanism in a form with further parameters, beside which the robot's own mean the same, to see whether these
        hang on the form. None: there is no such form."""
        return None

    restricts: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Parameters of a `freer` form, with the values at which it is the formula; none where it is not for any."""

    def standing_as(self, name: str) -> Self:
        """The same effect, its parameters and states called by another name than its id ("" for the id)."""
        return replace(self, stands_as=name)

    @property
    def title(self) -> str:
        """Mechanism and law in words."""
        return f"{in_words(self.id)} ({in_words(self.law)})" if self.law else in_words(self.id)

    def probes(self, robot: "Robot", seen: Seen) -> tuple[Probe, ...]:
        """What a first look at logs tries of the effect on `robot`, which carries it: its parameters at their typical size,
        those that have it already (a time constant, a speed) as they are; and the robot's own that it frees, moved a little.

        Effects that act somewhere (at a speed, beyond a line), or that are not proportional to their strength, say more.
        """
        free = {name: robot.parameters[name] for name in self.parameters(robot) if robot.parameters[name].free}
        strengths = {name: p.typical or 1.0 for name, p in free.items() if p.value != (p.typical or 1.0)}
        shape = {name: p.value for name, p in free.items() if name not in strengths}
        freed = {name: moved(robot.parameters[name]) for name in self.frees(robot) if robot.parameters[name].free}
        strengths |= freed
        return (Probe(strengths, shape),) if strengths else ()

    def parameters(self, robot: "Robot") -> dict[str, Parameter]:
        """The effect's parameters for this robot by `key`; all zero means absent."""
        return {}

    def frees(self, robot: "Robot") -> tuple[str, ...]:
        """Parameters of the robot itself that the effect lets vary."""
        return ()

    def states_on(self, robot: "Robot") -> tuple[str, ...]:
        """Names of the effect's own states on this robot."""
        return self.states

    def refusal(self, robot: "Robot") -> str | None:
        """Why this robot cannot have the effect though it has the traits, in a sentence; None if it can."""
        return None

    def there_already(self, robot: "Robot") -> bool:
        """Whether the robot's own numbers hold the mechanism already, so that nothing of it can be missing."""
        return False

    def command(
        self,
        inputs: Float[Array, "T nu"],
        time: Float[Array, " T"],
        dt: Float[Array, " T"],
        p: Numbers,
        robot: "Robot",
    ) -> Float[Array, "T nu"]:
        """Whole commanded signals -> signals that reach the motors, on the integration grid [T, nu]."""
        return inputs

    def numbers(self, p: Numbers, state: State, robot: "Robot") -> Numbers:
        """The model's parameters as they are in this state, such as the mass of what loses its load."""
        return p

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: "Robot") -> Scalars:
        """Motor voltages [V], given the currents [A] they would cause."""
        return volts

    def torque(self, torques: Scalars, state: State, p: Numbers, robot: "Robot") -> Scalars:
        """Drive torques at the wheels (forces of a linear axis)."""
        return torques

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: "Robot") -> Levels:
        """(backward, forward) Coulomb levels of every rubbing axis, both positive."""
        return levels

    def viscous(self, resistance: Scalars, speeds: Scalars, state: State, p: Numbers, robot: "Robot") -> Scalars:
        """Speed-dependent resisting torques of every rubbing axis. One that takes an argument `torques`, too, is given the
        drive torques, effects on them included."""
        return resistance

    def force(self, forces: Scalars, state: State, p: Numbers, robot: "Robot") -> Scalars:
        """Generalised forces that act on the body, one per velocity."""
        return forces

    def rates(self, state: State, currents: Scalars, p: Numbers, robot: "Robot") -> State:
        """Time derivatives of the effect's own states, and of no others. One that takes an argument `torques`, too, is given
        the drive torques before any effect on them."""
        return {}

    def measure(
        self, outputs: Float[Array, "T ny"], time: Float[Array, " T"], p: Numbers, robot: "Robot"
    ) -> Float[Array, "T ny"]:
        """Whole simulated outputs -> what the sensors report, on the integration grid."""
        return outputs

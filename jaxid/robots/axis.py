"""A single drive axis: equation 34 of the Pioneer paper on its own.

    M dv/dt = gain (u - back_emf v) - Fv v - Fc sgn v - offset

State q position [m or rad], v speed; input u force or voltage. What single motors, linear stages and drivetrain tests
need. Symbols are those of the drive-axis literature; for a rotating axis read inertia, torque and angle.
"""

from dataclasses import dataclass
from typing import ClassVar

from ..logs import AXIS, Channels
from ..parameters import ParameterTable
from .effect import Levels, Numbers, Path, State
from .robot import Robot, parameter


@dataclass(frozen=True)
class Axis(Robot):
    """Inertia with viscous and Coulomb friction, a constant offset and, where wanted, a motor's back-EMF."""

    name: ClassVar[str] = "axis"
    channels: ClassVar[Channels] = AXIS
    velocities: ClassVar[tuple[str, ...]] = ("v",)
    drive_axes: ClassVar[tuple[int, ...]] = (0,)
    angles: ClassVar[tuple[str, ...]] = ("q",)

    def defaults(self) -> ParameterTable:
        start = "start value"
        return ParameterTable(
            {
                "M": parameter(1.0, "kg", "moving mass (inertia)", start, free=True),
                "Fv": parameter(1.0, "N s/m", "viscous friction", start, free=True),
                "Fc": parameter(0.1, "N", "Coulomb friction", start, free=True),
                "offset": parameter(0.0, "N", "constant resisting force", start, positive=False, free=True),
                "gain": parameter(
                    1.0, "N per unit of u", "force per unit of input", "input is a force", positive=False
                ),
                "back_emf": parameter(0.0, "unit of u s/m", "back-EMF of a voltage-driven axis", "input is a force"),
            }
        )

    @property
    def states(self) -> tuple[str, ...]:
        return ("q", "v", *self.extra_states)

    @property
    def estimated_states(self) -> tuple[str, ...]:
        return ("q", "v")

    def rubbing(self, state: State, p: Numbers) -> Path:
        return (state["v"],)

    def coulomb(self, state: State, p: Numbers) -> Levels:
        levels: Levels = ((p["Fc"], p["Fc"]),)
        for effect in self.effects:
            levels = effect.dry(levels, (state["v"],), state, p)
        return levels

    def rates(self, state: State, inputs: Path, dry: Path, p: Numbers) -> State:
        v = state["v"]
        volts = inputs
        currents: Path = (volts[0] - p["back_emf"] * v,)
        resistance: Path = (p["Fv"] * v,)
        forces: Path = (-p["offset"],)
        for effect in self.effects:
            volts = effect.supply(volts, currents, state, p)
            currents = (volts[0] - p["back_emf"] * v,)
            resistance = effect.viscous(resistance, (v,), state, p)
            forces = effect.force(forces, state, p)
        torques: Path = (p["gain"] * currents[0],)
        for effect in self.effects:
            torques = effect.torque(torques, state, p)
        rates = {"q": v, "v": (torques[0] + forces[0] - resistance[0] - dry[0]) / p["M"]}
        for effect in self.effects:
            rates |= effect.rates(state, currents, p)
        return rates

    def compliance(self, state: State, p: Numbers) -> tuple[Path, ...]:
        return ((1.0 / p["M"],),)

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Path:
        return (rates["v"],)

    def observe(self, state: State, inputs: Path, p: Numbers) -> Path:
        return state["v"], state["q"]

"""A single drive axis: equation 34 of the Pioneer paper on its own.

    M dv/dt = gain (u - back_emf v) - Fv v - Fc sgn v - offset

State q position [m or rad], v speed; input u force or voltage. What single motors, linear stages and drivetrain tests
need. Symbols are those of the drive-axis literature; for a rotating axis read inertia, torque and angle.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

from ..logs import AXIS, Channels
from ..parameters import ParameterTable, parameter
from .effect import Levels, Numbers, Scalars, State
from .robot import Robot


@dataclass(frozen=True, repr=False)
class Axis(Robot):
    """Inertia with viscous and Coulomb friction, a constant offset and, where wanted, a motor's back-EMF."""

    name: ClassVar[str] = "axis"
    channels: ClassVar[Channels] = AXIS
    velocities: ClassVar[tuple[str, ...]] = ("v",)
    drive_axes: ClassVar[tuple[int, ...]] = (0,)
    angles: ClassVar[tuple[str, ...]] = ("q",)
    positions: ClassVar[Mapping[str, str]] = MappingProxyType({"v": "q"})
    along_line: ClassVar[bool] = True
    torque_unit: ClassVar[str] = "N"
    angle_unit: ClassVar[str] = "m"
    expressed: ClassVar[frozenset[str]] = frozenset({"asymmetric_friction"})  # the offset is the same model
    mechanisms: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({"payload_change": ("M",)})
    words: ClassVar[Mapping[str, str]] = MappingProxyType({"v": "speed", "q": "position"})

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
    def own_states(self) -> tuple[str, ...]:
        return ("q", "v")

    def motor(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        return (volts[0] - p["back_emf"] * state["v"],)

    def gear(self, currents: Scalars, volts: Scalars, state: State, p: Numbers) -> Scalars:
        return (p["gain"] * currents[0],)

    def rubbing(self, state: State, p: Numbers) -> Scalars:
        return (state["v"],)

    def own_coulomb(self, state: State, p: Numbers) -> Levels:
        return ((p["Fc"], p["Fc"]),)

    def own_viscous(self, speeds: Scalars, state: State, p: Numbers) -> Scalars:
        return (p["Fv"] * speeds[0],)

    def own_forces(self, state: State, p: Numbers) -> Scalars:
        return (-p["offset"],)

    def motion(
        self, state: State, volts: Scalars, torques: Scalars, resisting: Scalars, forces: Scalars, p: Numbers
    ) -> State:
        return {"q": state["v"], "v": (torques[0] + forces[0] - resisting[0]) / p["M"]}

    def compliance(self, state: State, p: Numbers) -> tuple[Scalars, ...]:
        return ((1.0 / p["M"],),)

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Scalars:
        return (rates["v"],)

    def angle_rates(self, state: State, p: Numbers) -> Scalars:
        return (state["v"],)

    def rim_levers(self, p: Numbers) -> Scalars:
        return (1.0,)

    def observe(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        return state["v"], state["q"]

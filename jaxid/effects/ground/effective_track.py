"""A track width other than drawn: where wide wheels touch, or skid (Borenstein and Feng, 1996; Mandow et al., 2007)."""

from dataclasses import dataclass
from typing import ClassVar

from ...robots.effect import Effect
from ..own_parameter import OwnParameter


@dataclass(frozen=True)
class EffectiveTrack(OwnParameter):
    """Frees the robot's own width between the wheels."""

    id: ClassVar[str] = "effective_track"
    where: ClassVar[str] = "ground contact"
    formula: ClassVar[str] = "the width between the wheels is another than the table's"


LAWS: tuple[Effect, ...] = (EffectiveTrack(),)

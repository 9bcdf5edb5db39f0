"""The supply's voltage, where a file has it beside the robot's channels: commands that are shares of it fall with it."""

import numpy as np
from jaxtyping import Float

from .units import unit_in_name, words_in

SUPPLIES = ("battery", "batt", "vbat", "supply", "vbus")
"""Words in the name of a signal that is a supply's, and no command's."""
FALLING_SUPPLY = "falling_supply"
"""The check of pre-flight."""
_VOLTAGES = ("vbat", "vbus")
_FALLS = 0.05
"""Share of itself by which a supply falls within one log from which on that is worth saying."""
_FEWEST = 6


def of_supply(name: str) -> bool:
    """Whether a name is that of something about the supply."""
    return any(word in name.lower() for word in SUPPLIES)


def is_supply(name: str, unit: str = "") -> bool:
    """Whether a signal of this name, in this SI `unit` (empty: not known), is a supply's voltage."""
    if not of_supply(name):
        return False
    known = unit_in_name(name)
    volts = (unit or (known.si if known else "")) == "V" or words_in(name)[-1:] == ["v"]
    return volts or any(word in name.lower() for word in _VOLTAGES)


def said_fall(values: Float[np.ndarray, " n"]) -> str:
    """That a supply falls, how far, and what that means, as the end of a sentence; empty where it does not.

    Compared are the values that a tenth of the first and of the last third of the samples exceed: under load it sags for
    moments in every part, and comes back.
    """
    values = values[np.isfinite(values)]
    if len(values) < _FEWEST:
        return ""
    third = len(values) // 3
    first, last = (float(np.quantile(part, 0.9)) for part in (values[:third], values[-third:]))
    if not first > 0 or last < 0 or last > (1.0 - _FALLS) * first:
        return ""
    return (
        f"falls from {first:.4g} to {last:.4g} (by {1.0 - last / first:.0%}): where commands are shares of the supply, such as "
        "a duty, the same command pushes by as much less at the end; command in volts (duty times this voltage), or fit "
        "shorter stretches"
    )

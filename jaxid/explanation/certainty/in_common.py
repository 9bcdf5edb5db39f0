"""What an effect has in common with another mechanism, or with something that has no name.

Sensors that are all late by some time, and commands that are late by it, are the same motion seen later: only by how much one
is later than another is its own.
"""

from typing import NamedTuple

from ...estimate.result import Fit
from ...robots.effect import Effect, in_words

_CERTAIN = 2.0
"""Standard errors by which the least of the delays differs from none."""


class Common(NamedTuple):
    """The `delay` [s] that everything has which an effect makes late, and the id of the effect that it may be as well."""

    delay: float
    other: str


def common_delay(effect: Effect, final: Fit) -> Common | None:
    """What the delays of an effect have in common; None where one thing may have none, where the model has the other mechanism,
    too, or where that has nothing in common with this one."""
    other = effect.in_common(final.robot)
    if not other or any(own.id == other for own in final.robot.effects):
        return None
    delays = [delay for name, delay in final.parameters.items() if name.startswith(effect.key(""))]
    sure = bool(delays) and all(delay.value > _CERTAIN * delay.std_error for delay in delays)
    return Common(min(delay.value for delay in delays), other) if sure else None


def delays_in_common(final: Fit) -> str:
    """A sentence on delays that are as well another mechanism's; empty where there are none."""
    for effect in final.robot.effects:
        common = common_delay(effect, final)
        if common is not None:
            return (
                f"Of {effect.title} the {1e3 * common.delay:.3g} ms that all have in common may as well be "
                f"{in_words(common.other)}, or a part of them: only by how much one is later than another is its own."
            )
    return ""


def without_a_name(final: Fit) -> tuple[str, ...]:
    """Sentences on effects that may as well be something that has no name here."""
    return tuple(
        f"What is called {in_words(effect.id)} here may as well be {effect.same_as}."
        for effect in final.robot.effects
        if effect.same_as
    )


def by_weight(final: Fit) -> tuple[str, ...]:
    """Sentences on effects that pull at the weight of a robot whose table has none of a part of its mass without weight."""
    table = final.robot.parameters
    none = [(part, whole) for part, whole in final.robot.parts.items() if table[part].value == 0.0]
    return tuple(
        f"The numbers of {in_words(effect.id)} take all of {whole} for weight: where a part {part} of it is rotors that turn "
        f"with the wheels, they are larger by {whole} / ({whole} - {part})."
        for effect in final.robot.effects
        if "weight" in effect.needs
        for part, whole in none
    )

"""What a law with a delay for each of several things has in common with another mechanism.

Sensors that are all late by some time, and commands that are late by it, are the same motion seen later: only by how much one
is later than another is its own.
"""

from ...estimate.result import Fit
from ...robots.effect import Effect, in_words

_CERTAIN = 2.0
"""Standard errors by which the least of the delays differs from none."""


def common_delay(effect: Effect, final: Fit) -> float:
    """The delay [s] that everything has which the effect makes late; zero where one thing may have none, where the model has
    the other mechanism, too, or where that has nothing in common with this one."""
    other = any(own.id == effect.in_common for own in final.robot.effects)
    if other or not effect.in_common:
        return 0.0
    delays = [delay for name, delay in final.parameters.items() if name.startswith(effect.key(""))]
    sure = bool(delays) and all(delay.value > _CERTAIN * delay.std_error for delay in delays)
    return min(delay.value for delay in delays) if sure else 0.0


def delays_in_common(final: Fit) -> str:
    """A sentence on delays that are as well another mechanism's; empty where there are none."""
    for effect in final.robot.effects:
        delay = common_delay(effect, final)
        if delay > 0.0:
            return (
                f"Of {effect.title} the {1e3 * delay:.3g} ms that all have in common may as well be "
                f"{in_words(effect.in_common)}, or a part of them: only by how much one is later than another is its own."
            )
    return ""

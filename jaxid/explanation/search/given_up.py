"""An effect that explained the gap by itself and was given up, while what came in its place leaves far more than noise.

Where the noise is not reached, laws that bend further follow the rest a little better whatever it is, and an exchange that
the likelihood asks for may cost the one name that the data did tell.
"""

from collections.abc import Sequence

from ..policy import current_policy
from ..refits.refit import Trial
from .steps import Step


def not_given_up(
    first: tuple[list[Step], Trial] | None, steps: Sequence[Step], current: Trial, base: Trial
) -> tuple[list[Step], Trial]:
    """The model after its `first` step, where the effect of that explained the gap of `base` alone and is in `current` no
    longer, which explains nothing of what that left; else `current`."""
    share = current_policy().unexplained
    if first is not None and not current.held_out.adequate:
        there = {effect.id for effect in current.robot.effects}
        left = first[1].held_out.gap
        if (
            first[0][0].chosen.id not in there
            and left < share * base.held_out.gap
            and current.held_out.gap > share * left
        ):
            return first
    return list(steps), current

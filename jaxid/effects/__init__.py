"""Effects that a model may be missing, each with a name, a place, parameters, units and a formula."""

from ..robots.effect import Effect
from .catalogue import catalogue, effect_by_id, laws_of

__all__ = ["Effect", "catalogue", "effect_by_id", "laws_of"]

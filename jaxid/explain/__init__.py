"""Find where simulation and data disagree, name the missing effect, add it, and show the gap shrink."""

from .explain import explain
from .explanation import Evidence, Explanation, NamedEffect
from .heldout import HeldOut, held_out
from .next_experiment import NextExperiment
from .screen import Candidate, screen
from .search import Search, search

__all__ = [
    "Candidate",
    "Evidence",
    "Explanation",
    "HeldOut",
    "NamedEffect",
    "NextExperiment",
    "Search",
    "explain",
    "held_out",
    "screen",
    "search",
]

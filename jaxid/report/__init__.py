"""Comparisons, explanations, tables and figures."""

from ..explanation.display import show_with
from .comparing import compare
from .comparison import Comparison
from .page import Page

show_with(Page())

__all__ = ["Comparison", "compare"]

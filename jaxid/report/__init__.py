"""Comparisons, explanations, tables and figures."""

from . import explanation_page as _explanation_page  # gives explanations their page
from .comparison import Comparison, compare

__all__ = ["Comparison", "compare"]

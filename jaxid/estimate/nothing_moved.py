"""Logs that determine nothing, since the robot never moved: a fit leaves only noise of them, whatever its parameters are."""

from dataclasses import replace

from ..logs import LogSet
from ..logs.useless import useless
from .judgement import Judgement
from .result import Fit


def where_nothing_moved(fit: Fit, judgement: Judgement, logs: LogSet) -> Judgement:
    """The judgement; a poor one where pre-flight finds every log unusable."""
    why = useless(logs) if fit.free_names and judgement.trustworthy else ""
    if not why:
        return judgement
    said = f"These logs determine no parameter: {why}"
    return replace(judgement, verdict="poor", sentences=(said, *judgement.sentences), better="")

"""Logs that determine nothing, since the robot never moved: a fit leaves only noise of them, whatever its parameters are."""

from dataclasses import replace

from ..logs import LogSet
from ..logs.useless import useless
from .judgement import Judgement
from .result import Fit


def where_nothing_moved(fit: Fit, judgement: Judgement, logs: LogSet) -> Judgement:
    """The judgement; a poor one where the fit determines nothing and pre-flight finds every log unusable."""
    known = [e for e in (*fit.parameters.values(), *fit.combinations.values()) if e.status == "identified"]
    if known or not fit.free_names or not judgement.trustworthy:
        return judgement
    why = useless(logs)
    if not why:
        return judgement
    said = f"These logs determine no parameter: {why}"
    return replace(judgement, verdict="poor", sentences=(said, *judgement.sentences), better="")

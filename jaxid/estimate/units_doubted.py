"""A fit to logs whose numbers no robot reaches in these units: it may follow them to the noise, and every number is wrong."""

from dataclasses import replace

from ..checks.in_words import doubtful_units
from ..logs import LogSet
from .result import Fit


def with_units_doubted(fit: Fit, logs: LogSet) -> Fit:
    """The fit, judged poor where pre-flight doubts the units of its logs; once, however often it is asked."""
    said = doubtful_units(logs)
    if said in fit.notes or (fit.judgement is not None and said in fit.judgement.sentences):
        return fit
    if not said or fit.judgement is None or fit.judgement.verdict == "failed":
        return replace(fit, notes=(*fit.notes, said)) if said else fit
    judgement = replace(fit.judgement.doubted(said), better="")
    notes = (note for note in fit.notes if note != fit.judgement.sentence)
    return replace(fit, judgement=judgement, notes=(judgement.sentence, *notes))

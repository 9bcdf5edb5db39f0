"""A search that went nowhere, or to the edge: said where the residual is more than noise.

Where the simulated robot rests at the start (dry friction above every drive), no small change of a parameter changes the
simulation, and the optimiser ends where it began; a parameter on its bound wanted to go on. Neither is wrong by itself (a fit
may start from the optimum, friction may be zero), so both are only worth a sentence where the fit is to be doubted.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace

from ..judgement import Judgement
from ..result import Fit

_MOVED = 1e-6
"""Change of a parameter, in units of itself, below which it has not moved."""


def with_search(
    fit: Fit, judgement: Judgement, start: Mapping[str, float], said: Collection[str] = ()
) -> tuple[Fit, Judgement]:
    """The fit from `start` and its judgement, with what became of a search that led to more than noise. Of the bounds of what
    is in `said` the judgement speaks already."""
    if judgement.trustworthy:
        return fit, judgement
    names = fit.free_names
    still = all(abs(fit[n].value - start[n]) <= _MOVED * abs(start[n]) for n in names)
    unseen = [n for n in names if fit[n].status == "not_identifiable"]
    if still and (unseen or judgement.verdict == "failed"):
        judgement = judgement.also(
            "The search never left its start: no parameter moved, as where the simulated robot rests there; give other "
            "start values."
        )
        fit = replace(fit, converged=False, reason="the search never left its start")
    bounded = [f"{n} ({fit[n].value:.3g})" for n in names if fit[n].status == "at_bound" and n not in said]
    if bounded:
        judgement = judgement.also(f"The search ended on the bound of {', '.join(bounded)}.")
    return fit, judgement

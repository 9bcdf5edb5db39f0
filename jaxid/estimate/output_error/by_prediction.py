"""Whether what windows leave follows the motion by more than a complete model's would.

What a window predicts of a sample has the noise of the samples before it, and so has the innovation: no prior says where a
window begins. Of a plant that is unstable without its controller that is much of the prediction, and the two are related
whatever the model. By how much, noise alone says, drawn anew and put through the same windows (a parametric bootstrap: Efron
and Tibshirani, An Introduction to the Bootstrap, 1993).
"""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ...logs.windows import stitched
from ..judge import drivers
from ..residual_tests import relation
from .innovations import of_noise_alone
from .problem import Problem, Structure, Unknowns

Array = NDArray[np.float64]

_DRAWS = 40
_BEYOND = 5.0
"""Standard deviations of the draws' log p by which the residual's own must be beyond their mean: of chance alone, whose log p
is exponential, one in 400 is."""
_SEED = 31


def related_by_prediction(
    structure: Structure,
    problem: Problem,
    at: Unknowns,
    logs: LogSet,
    whole: tuple[LogSet, float],
    left: Sequence[Array],
    moved: Sequence[Array],
    simulated: Sequence[Array],
    follows: Collection[str],
) -> set[str]:
    """The channels of `follows` that follow the motion no more than noise alone does.

    `logs` are the windows of `whole`; of each whole log, [T, channels.measured], `left` are the innovations, `moved` what was
    predicted and `simulated` what the windows make of it.
    """
    channels = list(whole[0].channels.measured)
    sigma = np.asarray(problem.sigma)
    noise = np.random.default_rng(_SEED).standard_normal((_DRAWS, *np.asarray(problem.mask).shape))
    white, ahead = of_noise_alone(structure, problem, at, noise)
    drawn: dict[str, list[float]] = {name: [] for name in follows}
    for draw in range(_DRAWS):
        innovation, error, read = (
            stitched(*whole, [own[: len(log)] * sigma for log, own in zip(logs, values[draw], strict=True)])
            for values in (white, ahead, noise)
        )
        predicted = [y + np.nan_to_num(n) + np.nan_to_num(e) for y, n, e in zip(simulated, read, error, strict=True)]
        driving = drivers(whole[0], predicted)
        for name in follows:
            drawn[name].append(_log_p(innovation, channels.index(name), driving))
    driving, found = drivers(whole[0], moved), set()
    for name, values in drawn.items():
        if _log_p(left, channels.index(name), driving) > np.mean(values) - _BEYOND * np.std(values):
            found.add(name)
    return found


def _log_p(left: Sequence[Array], channel: int, driving: dict[str, list[Array]]) -> float:
    return float(np.log(max(relation([own[:, channel] for own in left], driving)[0], 1e-300)))

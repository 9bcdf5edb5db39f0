r"""Which linear equations a robot's logs give: momentum balances, integrated between samples.

Integrating the equation of motion over time needs no acceleration (Innocenti et al., eqs. 29-31). With measured speeds
v, positions rebuilt from them and inputs that are held between samples,

    P(t_k) - P(t_0) = integral of Q dt           "momentum":  P = M(q) v, Q = dP/dt along the robot's own rates
    v(t_k) - v(t_0) = integral of dv/dt dt       "speed":     equation 33, and 30 as printed

Both come from `Robot.rates` alone. The mass matrix is read off the way dry friction accelerates the robot; where that
does not determine it (no friction on some axis), P = v. In the momentum form the parameters that the papers identify enter
linearly, so it needs no start values, but measured speeds multiply the inertias; in the speed form they do not (no
errors in variables there), but the inertias enter inverted and the equations are linearised about given numbers.
"""

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...logs import Log
from ...parameters import ParameterError
from ...robots.robot import Robot
from .integrals import Asked, Form, has_mass_matrix, integrals, walked
from .log_rows import Rows, gather, measured_speeds, positions_of
from .walks import Walk

Array = NDArray[np.float64]
_SMOOTH = np.ones(5) / 5  # moving average through which standstill is judged


# -- equations ---------------------------------------------------------------------------------------------------------
def noise_of(values: Array) -> float:
    """Standard deviation of the white noise on a smooth sampled signal [n], from its third differences (robust)."""
    third = np.diff(values, n=3)
    if not len(third):
        return 0.0
    return float(1.4826 * np.median(np.abs(third - np.median(third))) / np.sqrt(20.0))


def still_at(speeds: Array, log: NDArray[np.int64]) -> NDArray[np.bool_]:
    """[N, axes]: the rubbing speed here is not told from zero."""
    still = np.zeros(speeds.shape, bool)
    for number in np.unique(log):
        rows = log == number
        for axis in range(speeds.shape[1]):
            own = speeds[rows, axis]
            padded = np.pad(own, len(_SMOOTH) // 2, mode="edge")
            smooth = np.convolve(padded, _SMOOTH, mode="valid")
            limit = 3.0 * noise_of(own) / np.sqrt(len(_SMOOTH)) + 1e-3 * np.quantile(np.abs(own), 0.95)
            # Either view may show the standstill: the smoothed one misses a stop of one sample, the raw one is noisy.
            still[rows, axis] = (np.abs(smooth) <= limit) | (np.abs(own) <= 1e-3 * np.quantile(np.abs(own), 0.95))
    return still


def axes_that_matter(shares: Array) -> NDArray[np.bool_]:
    """[equations, axes] from the friction's shares [N, equations, axes]: a tenth of the largest, or more."""
    share = np.median(shares, axis=0)
    most = np.max(share, axis=1, initial=0.0)
    return np.asarray(share >= 0.1 * np.maximum(most, 1e-300)[:, None])


def _question(robot: Robot, names: tuple[str, ...], form: Form, theta: Array) -> tuple[Asked, dict[str, float]]:
    free, numbers = robot.parameters.free_names, robot.parameters.numbers
    asked = Asked(names, positions_of(robot, names), free, form, has_mass_matrix(robot, names))
    return asked, numbers | dict(zip(free, theta, strict=True))


def evaluate(
    robot: Robot,
    rows: Rows,
    names: tuple[str, ...],
    form: Form,
    theta: Array,
    sliding: Array | None = None,
    places: Array | None = None,
    walk: Walk | None = None,
) -> list[Array]:
    """`integrals` of the rows for the free parameters' values `theta`.

    With `sliding`, directions of sliding to take (NaN: the rows' own), there are slopes, these directions and the positions
    at the nodes as well; with `places` those positions are taken. `walk`: that of these rows, where it is known.
    """
    return list(integrals(robot.structure, *_question(robot, names, form, theta), rows, sliding, places, walk))


def walks_of(
    robot: Robot, each: Sequence[Rows], names: tuple[str, ...], form: Form, theta: Array
) -> Sequence[Walk | None]:
    """What `evaluate` may be given for each of several sets of rows: worked out side by side, which is several times faster
    than one after the other."""
    found = walked(robot.structure, *_question(robot, names, form, theta), each)
    return [None] * len(each) if found is None else found


@cache
def _unknown_rates(
    robot: Robot, positions: tuple[str, ...], numbers: tuple[tuple[str, float], ...], free: tuple[str, ...]
):
    """Those of the `positions` whose rates change with the free parameters, at two states without symmetry."""
    found, known = set(), dict(numbers)
    other = known | {name: (1.1 + 0.05 * k) * known[name] + 0.1 * (known[name] == 0) for k, name in enumerate(free)}
    for probe in np.random.default_rng(1).uniform(0.1, 1.0, (2, len(robot.states) + len(robot.channels.inputs))):
        state = dict(zip(robot.states, probe.tolist(), strict=False))
        inputs = tuple(probe[len(robot.states) :].tolist())
        dry = (0.0,) * len(robot.rubbing(state, known))
        here, there = (robot.rates(state, inputs, dry, p) for p in (known, other))
        found |= {
            name for name in positions if not np.isclose(float(here[name]), float(there[name]), rtol=1e-12, atol=0)
        }
    return tuple(name for name in positions if name in found)


@in_float64
def check_linear(robot: Robot, logs: Iterable[Log]) -> None:
    """Raise `ParameterError` naming free parameters in which, together, the robot's balances are not linear, or speeds that
    nobody measured: what is not measured is rebuilt from what is, which needs no free parameter."""
    names = measured_speeds(robot)
    free = robot.parameters.free_names
    rows = gather(robot, logs, names)
    if not rows.moved.any():
        return  # nothing but noise: there are no balances to judge
    numbers = robot.parameters.numbers
    theta = np.array([numbers[name] for name in free], dtype=float)
    elsewhere = np.where(theta == 0, 0.1, theta * (1.1 + 0.05 * np.arange(len(theta))))
    here, there = (evaluate(robot, rows, names, "momentum", at) for at in (theta, elsewhere))
    slopes = (1, 3)  # of momentum and of impulse, in `integrals`
    size = np.max([np.max(np.abs(here[j]), axis=(0, 1)) for j in slopes], axis=0)
    change = np.max([np.max(np.abs(there[j] - here[j]), axis=(0, 1)) for j in slopes], axis=0)
    # A column far below the others' effect is rounding and says nothing about linearity.
    effect = size * np.abs(elsewhere)
    change = change / np.maximum(size, 1e-6 * max(effect.max(initial=0.0), 1e-300) / np.abs(elsewhere))
    bent = [name for name, moved in zip(free, change, strict=True) if not moved < 1e-6]
    if bent:
        raise ParameterError(
            f"the equations of motion of {robot.name!r} are not linear in {', '.join(bent)}, freed together; fix what "
            "makes them so (free=False: lengths, gains, one factor of a product) or use output error."
        )
    unmeasured = _unknown_rates(
        robot.structure, positions_of(robot, names), tuple(robot.parameters.numbers.items()), free
    )
    if unmeasured:
        raise ParameterError(
            f"the logs do not measure {', '.join(unmeasured)} of {robot.name!r}, whose equations hold free parameters: linear "
            "methods need those states measured; log them as outputs, or use output error"
        )

"""How much longer noise is remembered than a sample, followed while windows come.

Neighbouring errors of a filtered sensor are related. What slow signals tell beside such noise is less by its long-run variance,
(1 + r) / (1 - r) times its own for an autoregression of first order, than as many samples of white noise would leave (Bartlett,
Journal of the Royal Statistical Society 98, 1935).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...kernel.direct import outputs
from .laid_out import Array, Direct, seen_by, shown, weighted_residual

Values = NDArray[np.float64]
_CLEAR = 2.5
"""Standard errors of a correlation of neighbours from which it is one."""
_HIGHEST = 0.98
_WINDOWS = 30.0
"""Windows after which what was seen of the noise has been forgotten but for 1/e."""


@dataclass(frozen=True)
class Neighbours:
    """Sums over samples so far of each channel's squared residual, of its products with the one before, and of samples [ny]."""

    squares: Values
    products: Values
    samples: Values

    @classmethod
    def none(cls, channels: int) -> "Neighbours":
        return cls(*(np.zeros(channels) for _ in range(3)))

    def with_(self, residual: Values, there: NDArray[np.bool_], new: int) -> "Neighbours":
        """With the last `new` samples of a window's `residual` [T, ny], measured where `there`; older ones count less by the
        share of a window that these are."""
        pair = there[1:] & there[:-1]
        last = slice(max(len(pair) - new, 0), None)
        own = np.where(there, residual, 0.0)
        kept = float(np.exp(-min(new / max(len(residual), 1), 1.0) / _WINDOWS))
        return Neighbours(
            kept * self.squares + np.sum(np.where(pair, own[1:] ** 2, 0.0)[last], axis=0),
            kept * self.products + np.sum(np.where(pair, own[1:] * own[:-1], 0.0)[last], axis=0),
            kept * self.samples + np.sum(pair[last], axis=0),
        )

    @property
    def correlation(self) -> Values:
        """Of neighbouring errors, by channel; zero where it may be chance or they pull apart."""
        seen = (self.squares > 0) & (self.samples > 1)
        found = np.where(seen, self.products / np.where(seen, self.squares, 1.0), 0.0)
        return np.where(found * np.sqrt(self.samples) > _CLEAR, np.minimum(found, _HIGHEST), 0.0)

    @property
    def long_run(self) -> Values:
        """The long-run variance of each channel, in units of its own."""
        r = self.correlation
        return (1.0 + r) / (1.0 - r)

    @property
    def of_squares(self) -> Values:
        """How many samples count as one where squares are added up."""
        r = self.correlation**2
        return (1.0 + r) / (1.0 - r)


def residual_at(d: Direct, theta: Values, states: Values) -> Array:
    """The weighted residuals [T, ny] of a window's only log."""
    y = shown(d, theta, outputs(d.model.system, seen_by(d, theta, states)))
    return np.asarray(weighted_residual(y, d.logs.measured, d.logs.weight)[0, :, :, 0])

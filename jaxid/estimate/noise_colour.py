"""The colour of a sensor's noise: an autoregression of a residual.

Neighbouring errors of many sensors are related: filtered speeds, differences of positions smoothed over some samples. An
autoregression of each channel describes that (Box & Jenkins, Time Series Analysis, 1976; the order by Schwarz's criterion).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from .._filters import autoregressive
from .residual_tests import Relation, autocorrelation, relation

Array = NDArray[np.float64]

_MOST_ORDERS = 12
_FEWEST = 20
"""Samples for every coefficient of an autoregression."""
_RESPONSE = 4096
_FORGOTTEN = 10.0
"""Integral time scales after which a start is forgotten."""
_SLOWEST = 0.98
"""Correlation of neighbouring samples of noise, beyond which stretches cannot tell it from a drift."""


@dataclass(frozen=True)
class Colour:
    """An autoregression r_k = sum_i `coefficients`_i r_(k-i) + innovations of standard deviation `level`.

    `correlation` is that of neighbouring samples. No coefficients: white noise.
    """

    coefficients: tuple[float, ...]
    level: float
    correlation: float

    @classmethod
    def first_order(cls, size: float, correlation: float) -> Self:
        """First-order noise of standard deviation `size`; white where neighbours have no `correlation`."""
        if correlation == 0:
            return cls((), size, 0.0)
        return cls((correlation,), size * float(np.sqrt(1.0 - correlation**2)), correlation)

    @property
    def order(self) -> int:
        """How many samples back it reaches."""
        return len(self.coefficients)

    @property
    def on_white(self) -> bool:
        """Whether it looks like slow noise with white noise on top: its best prediction is then an average of the past."""
        return self.order > 1 and all(c > 0 for c in self.coefficients)

    @property
    def in_the_long_run(self) -> float:
        """What it is as much as, of white noise, to a mean over many samples: the root of its spectrum at frequency zero."""
        return self.level / max(1.0 - sum(self.coefficients), 1e-3)

    @property
    def _taps(self) -> Array:
        """[order + 1], which the noise has to be filtered with to become white."""
        return np.concatenate([[1.0], -np.asarray(self.coefficients)])

    @property
    def memory(self) -> float:
        """Its integral time scale in samples: of first-order noise about the time within which it falls to 37 %.

        Of slow noise with white noise on top, that of the slow one.
        """
        rho = self.correlations
        if self.on_white:
            return float(np.sum(rho[1:]) / rho[1]) - 0.5
        return float(np.sum(rho)) - 0.5

    @property
    def white_share(self) -> float:
        """Share of the variance that is white noise on top of slow noise: what an exponential's correlations lack at lag 0."""
        rho = self.correlations
        return max(1.0 - float(rho[1] ** 2 / rho[2]), 0.0) if self.on_white and rho[2] > 0 else 0.0

    @property
    def correlations(self) -> Array:
        """Autocorrelations [lags] of the autoregression, by its response to one innovation."""
        response = autoregressive(self._taps, np.eye(1, _RESPONSE)[0])
        products = np.fft.irfft(np.abs(np.fft.rfft(response, 2 * _RESPONSE)) ** 2)[:_RESPONSE]
        return products / products[0]

    def drawn(self, random: np.random.Generator, samples: int) -> Array:
        """So many samples of it [samples], stationary from the first one on."""
        before = int(np.ceil(_FORGOTTEN * max(self.memory, 0.0))) if self.order else 0
        return autoregressive(self._taps, self.level * random.normal(size=before + samples))[before:]

    def whiten(self, values: Array, there: NDArray[np.bool_]) -> Array:
        """Innovations of `values` [..., T] in units of their level, zero at a log's first samples, where not `there` [T], and
        at the first samples after a gap.

        Neighbours are the measured samples, whatever lies between all of them alike.
        """
        found = np.zeros_like(values)
        if np.count_nonzero(there) > self.order:
            measured = values[..., there]
            own = measured / self.level
            for back, tap in enumerate(self._taps[1:], 1):
                own[..., back:] += tap / self.level * measured[..., :-back]
            own[..., : self.order] = 0.0
            if self.order:
                # After a gap that is longer than those between all others the noise is another one.
                apart = np.diff(np.flatnonzero(there))
                after = np.flatnonzero(apart > np.median(apart)) + 1
                own[..., np.minimum(after[:, None] + np.arange(self.order), own.shape[-1] - 1)] = 0.0
            found[..., there] = own
        return found


def made_white(colours: Sequence[Colour], values: Array, mask: NDArray[np.bool_]) -> Array:
    """Innovations of `values` [E, T, ny, *], channel by channel, of every log where `mask` [E, T, ny]."""
    found = np.zeros_like(values)
    for c, colour in enumerate(colours):
        for e, there in enumerate(mask[..., c]):
            found[e, :, c] = np.moveaxis(colour.whiten(np.moveaxis(values[e, :, c], 0, -1), there), -1, 0)
    return found


def colour_of(parts: Sequence[Array]) -> Colour:
    """The colour of one channel's residual, `parts` [T] of each log, NaN where not measured. Its mean is not taken off."""
    parts = [part[np.isfinite(part)] for part in parts]
    most = min(_MOST_ORDERS, sum(map(len, parts)) // _FEWEST, max(map(len, parts), default=0) // 2)
    parts = [part for part in parts if len(part) > most]
    pooled = np.concatenate([*parts, np.empty(0)])
    rms = float(np.sqrt(np.mean(pooled**2))) if pooled.size else 0.0
    if most < 1 or not rms > 0:
        return Colour((), max(rms, 1e-300), 0.0)
    # One regression of all orders on the same samples, so that their likelihoods compare.
    rows = np.concatenate(
        [np.stack([part[most - k : len(part) - k] for k in range(most + 1)], axis=1) for part in parts]
    )
    gram, n = rows.T @ rows, len(rows)
    best, criterion, level = (), np.inf, rms
    for order in range(most + 1):
        own = np.linalg.lstsq(gram[1 : order + 1, 1 : order + 1], gram[1 : order + 1, 0], rcond=1e-10)[0]
        left = max(float(gram[0, 0] - own @ gram[1 : order + 1, 0]), 1e-12 * float(gram[0, 0]))
        value = n * np.log(left / n) + order * np.log(n)
        if value < criterion:
            best, criterion, level = tuple(own.tolist()), value, float(np.sqrt(left / n))
    neighbours = sum(float(part[1:] @ part[:-1]) for part in parts)
    return Colour(best, level, neighbours / sum(float(part @ part) for part in parts))


def colour_in_stretches(residual: Sequence[Array], window: int) -> Colour:
    """First-order noise that leaves this residual [T] of each log in stretches of `window` samples, their means taken off."""
    rho, _ = autocorrelation(residual, 1, mean=0.0)
    square = float(np.nanmean(np.concatenate(residual) ** 2))
    centre = np.eye(window) - 1.0 / window
    best, found = np.inf, Colour.first_order(float(np.sqrt(square)), 0.0)
    for memory in np.linspace(0.0, _SLOWEST, 50):
        left = centre @ toeplitz(memory ** np.arange(window)) @ centre
        variance = float(np.trace(left)) / window
        neighbours = float(np.trace(left, offset=1)) / max(window - 1, 1)
        if abs(neighbours / variance - rho[1]) < best:
            best = abs(neighbours / variance - rho[1])
            found = Colour.first_order(float(np.sqrt(square / variance)), float(memory))
    return found


def innovations_related(parts: Sequence[Array], drivers: Mapping[str, Sequence[Array]]) -> Relation:
    """`relation` of a residual's innovations to the `drivers`, filtered alike: in a closed loop coloured noise itself is
    related to what it drove."""
    colour = colour_of(parts)
    there = [np.isfinite(part) for part in parts]
    white = [np.where(here, colour.whiten(own, here), np.nan) for own, here in zip(parts, there, strict=True)]
    alike = {
        name: [colour.whiten(own, here) for own, here in zip(values, there, strict=True)]
        for name, values in drivers.items()
    }
    return relation(white, alike)

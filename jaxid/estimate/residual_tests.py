"""Is a residual nothing but noise? Whiteness, relation to what drove the robot, normality.

Every test has the false-alarm rate `FALSE_ALARM`: that often it rejects a residual that is fine.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from .._distributions import beta_tail, chi_squared_tail, f_tail, moments, normal_beyond, normal_test, student_tail
from .._filters import filtered, lagged
from ..logs.noise import usual_size

Array = NDArray[np.float64]

FALSE_ALARM = 0.01
"""How often each test rejects a residual that is nothing but white Gaussian noise."""
LAGS = 25
"""Samples over which autocorrelation and cross-correlation are looked at."""
_ORDER = 10  # of the autoregression that whitens a residual before it is compared with the inputs
_SMOOTHED = (0.0, 10.0, 40.0)  # samples over which drivers are smoothed: a robot's own lag is not known here
_SHIFTS = 999
_CUT = 9.0  # squared innovations, in units of their variance, above which they count as outliers
_DIFFERENCES = 1.5  # uncertainty of a variance by differences of white noise, which are related by -1/2
_STRETCH = 8  # samples
_SLACK = 0.05  # ratio (its logarithm) of two levels of one noise that is no news
FEWEST = 30
"""Samples below which no test is made."""


@dataclass(frozen=True)
class ResidualTest:
    """One test: its `statistic`, `p_value` (NaN where it could not be made), `rejected` and the outcome in words."""

    name: str
    statistic: float
    p_value: float
    rejected: bool
    sentence: str


@dataclass(frozen=True)
class ChannelTests:
    """The tests of one channel's residual, all logs together.

    `autocorrelation` [lags + 1] from lag 0, and for each input the correlation [lags + 1] of the whitened residual with
    the input that many samples earlier. Noise stays inside ± `band95` and ± `band99` in 95 % and 99 % of the lags.
    """

    whiteness: ResidualTest
    cross_correlation: dict[str, ResidualTest]
    normality: ResidualTest
    autocorrelation: Array
    input_correlation: dict[str, Array]
    band95: float
    band99: float

    @property
    def all(self) -> tuple[ResidualTest, ...]:
        """Whiteness, cross-correlation with every input, normality."""
        return (self.whiteness, *self.cross_correlation.values(), self.normality)

    @property
    def summary(self) -> str:
        """What was rejected, such as "is not white and follows V2, V3"; empty if nothing was."""
        lag = int(np.argmax(np.abs(self.autocorrelation[1:]))) + 1
        follows = [name for name, test in self.cross_correlation.items() if test.rejected]
        found = []
        if self.whiteness.rejected:
            found.append(f"is not white (correlation {self.autocorrelation[lag]:.2f} at lag {lag})")
        if follows:
            found.append(f"follows {', '.join(follows)}")
        if self.normality.rejected:
            found.append("is not Gaussian")
        return ", ".join(found[:-1]) + (" and " if len(found) > 1 else "") + found[-1] if found else ""


def _chance(p: float) -> str:
    return f"p = {p:.2g}" if p >= 1e-4 else "p < 0.0001"


def _constant(values: Array) -> bool:
    """Whether there is nothing but one value, up to rounding."""
    return float(np.nanmax(values) - np.nanmin(values)) <= 1e-9 * float(np.nanmax(np.abs(values)))


def _centred(parts: Sequence[Array], mean: float | None = None) -> list[Array]:
    """Without their common (or the known) mean, zero where not measured: products with missing samples vanish."""
    mean = float(np.nanmean(np.concatenate(parts))) if mean is None else mean
    return [np.nan_to_num(part - mean, nan=0.0) for part in parts]


def autocorrelation(parts: Sequence[Array], lags: int = LAGS, mean: float | None = None) -> tuple[Array, Array]:
    """Autocorrelation [lags + 1] of one signal in several parts, never across two, and the pairs in each lag.

    Around the parts' common mean, or the known one.
    """
    centred = _centred(parts, mean)
    there = [np.isfinite(part).astype(float) for part in parts]
    reach = range(lags + 1)
    products = [sum(float(e[: len(e) - k] @ e[k:]) for e in centred if len(e) > k) for k in reach]
    pairs = [sum(float(m[: len(m) - k] @ m[k:]) for m in there if len(m) > k) for k in reach]
    return np.array(products) / max(products[0], np.finfo(float).tiny), np.array(pairs)


def ljung_box(parts: Sequence[Array], lags: int, mean: float | None = None) -> tuple[float, int]:
    """Ljung and Box's (1978) statistic of a residual in `parts`, chi-squared if white, and its degrees of freedom.

    No degree of freedom is taken off: nothing was fitted to held-out logs.
    """
    samples = int(sum(np.isfinite(part).sum() for part in parts))
    rho, pairs = autocorrelation(parts, lags, mean)
    used = np.flatnonzero(pairs[1:] > 0) + 1
    return float(samples * (samples + 2) * np.sum(rho[used] ** 2 / pairs[used])), len(used)


def _untested(name: str, why: str) -> ResidualTest:
    return ResidualTest(name, float("nan"), float("nan"), False, why)


def whiteness(parts: Sequence[Array], channel: str = "the channel", lags: int = LAGS) -> ResidualTest:
    """Ljung-Box test of the residual `parts` (one array a log) over `lags`."""
    name = "whiteness"
    samples = int(sum(np.isfinite(part).sum() for part in parts))
    if samples < FEWEST or _constant(np.concatenate(parts)):
        return _untested(name, f"{channel}: whiteness not tested, the residual has {samples} samples or is constant.")
    lags = min(lags, samples // 4, max(map(len, parts)) - 1)
    rho, _ = autocorrelation(parts, lags)
    statistic, freedom = ljung_box(parts, lags)
    p = float(chi_squared_tail(statistic, freedom))
    worst = int(np.argmax(np.abs(rho[1:]))) + 1
    if p >= FALSE_ALARM:
        return ResidualTest(
            name, statistic, p, False, f"{channel}: the residual is white over {lags} lags ({_chance(p)})."
        )
    return ResidualTest(
        name,
        statistic,
        p,
        True,
        f"{channel}: the residual is not white ({_chance(p)}; correlation {rho[worst]:.2f} at lag {worst}): the model "
        "misses dynamics, or the sensor's noise is coloured.",
    )


def _whitening(rho: Array) -> Array:
    """Coefficients of the filter that whitens a signal of autocorrelation `rho` (Yule-Walker, so that it is stable)."""
    order = min(_ORDER, len(rho) - 1)
    column = rho[:order].copy()
    column[0] += 1e-9
    return np.concatenate([[1.0], -linalg.solve_toeplitz(column, rho[1 : order + 1])])


def cross_correlation(
    parts: Sequence[Array], inputs: Sequence[Array], channel: str = "the channel", name: str = "u", lags: int = LAGS
) -> tuple[ResidualTest, Array]:
    """Test of the residual against one input 1 to `lags` samples earlier, and their correlation from lag 0 on [lags + 1].

    The input of the sample itself acts after it, and a controller makes it from what was measured there, noise included.

    Both are first whitened by the residual's own autoregression (Box & Jenkins), which keeps coloured sensor noise from
    passing as a missing effect. The statistic is the F ratio of the residual's regression on the delayed inputs: the
    input may have any spectrum (Soderstrom & Stoica 1989, section 11.2, for finite samples).
    """
    title = f"correlation with {name}"
    samples = int(sum(np.isfinite(part).sum() for part in parts))
    lags = min(lags, samples // 8)
    nothing = np.full(lags + 1, np.nan)
    if samples < FEWEST or _constant(np.concatenate(parts)):
        return _untested(
            title, f"{channel}: not compared with {name}, too few samples or a constant residual."
        ), nothing
    centred = _centred(parts)
    taps = _whitening(autocorrelation(parts, lags)[0])
    rows, targets = [], []
    for e, part, u in zip(centred, parts, inputs, strict=True):
        if len(u) <= lags + len(taps):
            continue
        e, u = filtered(taps, e), filtered(taps, u)
        first = lags + len(taps) - 1
        delayed = np.stack([u[first - k : len(u) - k] for k in range(lags + 1)], axis=1)
        measured = np.isfinite(part[first:])
        rows.append(delayed[measured])
        targets.append(e[first:][measured])
    if not rows:
        return _untested(title, f"{channel}: not compared with {name}, the logs are too short."), nothing
    matrix, target = np.concatenate(rows), np.concatenate(targets)
    level = np.max(np.abs(matrix), initial=0.0)
    matrix, target = matrix - matrix.mean(axis=0), target - target.mean()
    spread = matrix.std(axis=0)
    if len(target) < 2 * (lags + 2) or spread.max() <= 1e-9 * level or target.std() == 0:
        return _untested(title, f"{channel}: not compared with {name}, which never changes."), nothing
    rho = matrix.T @ target / len(target) / np.where(spread > 0, spread, np.inf) / target.std()
    acted = matrix[:, 1:]
    coefficients, _, rank, _ = np.linalg.lstsq(acted, target, rcond=1e-8)
    left = float(np.sum((target - acted @ coefficients) ** 2))
    total = float(target @ target)
    freedom = len(target) - 1 - int(rank)
    statistic = (total - left) / rank / max(left / freedom, np.finfo(float).tiny)
    p = float(f_tail(statistic, rank, freedom))
    if p >= FALSE_ALARM:
        return ResidualTest(
            title, statistic, p, False, f"{channel}: the residual is unrelated to {name} ({_chance(p)})."
        ), rho
    worst = int(np.argmax(np.abs(rho[1:]))) + 1
    return ResidualTest(
        title,
        statistic,
        p,
        True,
        f"{channel}: the residual still follows {name} ({_chance(p)}; correlation {rho[worst]:.2f} at lag {worst}): "
        f"part of what {name} does is not in the model.",
    ), rho


class Relation(NamedTuple):
    """That a residual follows what moved the robot: `p_value` by chance, the driver that it follows `most`, and the `share` of
    its variance that does, beyond what does by chance."""

    p_value: float
    most: str
    share: float


def relation(parts: Sequence[Array], drivers: Mapping[str, Sequence[Array]]) -> Relation:
    """Does a residual of any colour follow what moved the robot?

    The share of the residual `parts` that the `drivers` (by name, [samples] of each log), as they are and smoothed, explain
    together is compared with the share that they explain shifted in time by random amounts, log by log and round the end:
    shifted drivers have lost what they did to the residual, and all of its colour and theirs is kept. Whitening instead
    would take a slow deterministic error for coloured noise. Periodic drivers cannot be told from shifted ones; the test
    is then cautious.
    """
    names = [name for name in drivers for _ in _SMOOTHED]
    gram = np.zeros((len(names), len(names)))
    by_shift, power = [], 0.0
    for e, part in enumerate(parts):
        r = np.nan_to_num(part - np.nanmean(part)) if np.isfinite(part).any() else np.zeros(len(part))
        own = [_smoothed(signals[e], memory) for signals in drivers.values() for memory in _SMOOTHED]
        X = np.stack([x - x.mean() for x in own], axis=1)
        gram += X.T @ X
        spectra = np.conj(np.fft.rfft(X, axis=0)) * np.fft.rfft(r)[:, None]
        by_shift.append(np.fft.irfft(spectra, n=len(r), axis=0))  # [shift, column]
        power += float(r @ r)
    size = np.sqrt(np.diag(gram))
    used = size > 1e-9 * size.max(initial=0.0)
    if power == 0.0 or not used.any() or sum(map(len, parts)) < FEWEST:
        return Relation(1.0, "", 0.0)
    values, vectors = np.linalg.eigh(gram[np.ix_(used, used)] / np.outer(size[used], size[used]))
    kept = values > 1e-6 * values.max()
    onto = vectors[:, kept] / np.sqrt(values[kept])
    random = np.random.default_rng(0)
    products = np.zeros((_SHIFTS + 1, int(used.sum())))
    for own in by_shift:
        # Closer than a tenth of the log is too much like no shift at all.
        margin = len(own) // 10
        shifts = random.integers(margin, max(len(own) - margin, margin + 1), size=_SHIFTS)
        products += own[np.append(0, shifts)][:, used] / size[used]
    shares = np.sum((products @ onto) ** 2, axis=1) / power
    # Shifts of less than the residual's memory are alike, so that their number says little about the tail: a share of
    # variance by chance is a beta variate, whose two numbers the shifts do tell.
    mean, variance = float(shares[1:].mean()), max(float(shares[1:].var()), 1e-12)
    mean = min(max(mean, 1e-9), 1.0 - 1e-9)
    weight = max(mean * (1.0 - mean) / variance - 1.0, 1e-3)
    p = float(beta_tail(min(shares[0], 1.0), mean * weight, (1.0 - mean) * weight))
    most = np.array(names)[used][int(np.argmax(np.abs(products[0])))].item()
    return Relation(p, most, max(float(shares[0]) - mean, 0.0))


def bursts(parts: Sequence[Array]) -> float:
    """p value of a residual coming in bursts by chance: noise of any colour does not, errors of a model come where the motion
    makes them.

    Are the squares of its innovations (an autoregression taken off) related, or does a stretch of a few samples, which no
    single outlier makes, stand out from all others? 1 where there are too few samples.
    """
    samples = int(sum(np.isfinite(part).sum() for part in parts))
    if samples < FEWEST or _constant(np.concatenate(parts)):
        return 1.0
    taps = _whitening(autocorrelation(parts, _ORDER)[0])
    white = []
    for centred, part in zip(_centred(parts), parts, strict=True):
        own = filtered(taps, centred)[len(taps) - 1 :]
        white.append(own[np.isfinite(part[len(taps) - 1 :])])
    return min(2.0 * related_squares(white), 2.0 * _standing_out(parts), 1.0)


def related_squares(innovations: Sequence[Array]) -> float:
    """p value of the squares of innovations, `innovations` [T] of each log, being related by chance (McLeod & Li 1983).

    Those beyond three standard deviations are cut off, and each log has a level of its own. 1 where there are too few samples.
    """
    squares = []
    for own in innovations:
        level = usual_size(own) if len(own) > 2 * _ORDER else 0.0
        if level > 0.0:
            cut = np.minimum((own / level) ** 2, _CUT)
            squares.append(cut - cut.mean())
    if sum(map(len, squares)) < FEWEST:
        return 1.0
    statistic, freedom = ljung_box(squares, min(LAGS, max(map(len, squares)) - 1), mean=0.0)
    return float(chi_squared_tail(statistic, freedom))


def _standing_out(parts: Sequence[Array]) -> float:
    """p value of the largest median over `_STRETCH` samples, among those of all logs."""
    largest, count = 0.0, 0
    for part in parts:
        own = part[np.isfinite(part)]
        medians = np.median(own[: len(own) // _STRETCH * _STRETCH].reshape(-1, _STRETCH), axis=1)
        level = usual_size(medians) if len(medians) > 2 * _STRETCH else 0.0
        if level > 0.0:
            largest, count = max(largest, float(np.max(np.abs(medians))) / level), count + len(medians)
    # The level is known from these medians alone.
    return float(-np.expm1(count * np.log1p(-2.0 * student_tail(largest, count / 3.0)))) if count else 1.0


def independent(parts: Sequence[Array]) -> float:
    """Independent samples that a coloured residual is worth: their number over 1 + 2 sum rho, up to where rho is no more than
    noise."""
    samples = float(sum(np.isfinite(part).sum() for part in parts))
    rho, pairs = autocorrelation(parts, max(max(map(len, parts)) // 2, 1), mean=0.0)
    past = np.flatnonzero(rho[1:] <= 2.0 / np.sqrt(np.maximum(pairs[1:], 1.0)))
    last = int(past[0]) if len(past) else len(rho) - 1
    return samples / (1.0 + 2.0 * float(rho[1 : last + 1].sum()))


def uneven(parts: Sequence[Array]) -> float:
    """p value of one log's residual being larger than another's by chance, each in units of its own differences: a sensor that
    is noisier on one log is so in its differences, too; errors of a model are where the motion makes them. 1 for one log.

    A variance of n samples of autocorrelation rho has 1 + 2 sum rho^2 times the uncertainty of independent ones.
    """
    parts = [part[np.isfinite(part)] for part in parts]
    parts = [part for part in parts if len(part) > FEWEST]
    if len(parts) < 2 or _constant(np.concatenate(parts)):
        return 1.0
    rho, _ = autocorrelation(parts, min(2 * LAGS, max(map(len, parts)) - 1), mean=0.0)
    inflated = 1.0 + 2.0 * float(np.sum(rho[1:] ** 2))
    sizes = np.array([np.log(usual_size(p) / max(usual_size(np.diff(p)), 1e-300)) for p in parts])
    weight = np.array([2.0 * len(p) / (inflated + _DIFFERENCES) for p in parts])
    apart = np.maximum(np.abs(sizes - np.average(sizes, weights=weight)) - _SLACK, 0.0)
    return float(chi_squared_tail(np.sum(weight * apart**2), len(parts) - 1))


def _smoothed(values: Array, memory: float) -> Array:
    """First-order smoothing over `memory` samples, from rest at the first value."""
    if memory == 0:
        return values
    a = float(np.exp(-1.0 / memory))
    return lagged(values - values[0], a) + values[0]


def normality(values: Array, channel: str = "the channel") -> ResidualTest:
    """D'Agostino and Pearson's test of skewness and kurtosis (`scipy.stats.normaltest`) of `values` [N] but NaN."""
    values = values[np.isfinite(values)]
    if len(values) < FEWEST or _constant(values):
        return _untested("normality", f"{channel}: normality not tested, {len(values)} samples or a constant residual.")
    statistic, p = normal_test(values)
    if p >= FALSE_ALARM:
        return ResidualTest("normality", statistic, p, False, f"{channel}: the residual is Gaussian ({_chance(p)}).")
    skewness, kurtosis = moments(values)
    return ResidualTest(
        "normality",
        statistic,
        p,
        True,
        f"{channel}: the residual is not Gaussian ({_chance(p)}; skewness {skewness:.2f}, excess kurtosis "
        f"{kurtosis:.2f}): look for outliers, or for errors that depend on the motion.",
    )


def residual_tests(parts: Sequence[Array], inputs: Mapping[str, Sequence[Array]], channel: str) -> ChannelTests:
    """All tests of one channel: residual `parts` [samples] of each log, and each input's [samples] of the same logs."""
    samples = int(sum(np.isfinite(part).sum() for part in parts))
    crossed = {name: cross_correlation(parts, values, channel, name) for name, values in inputs.items()}
    return ChannelTests(
        whiteness=whiteness(parts, channel),
        cross_correlation={name: test for name, (test, _) in crossed.items()},
        normality=normality(np.concatenate(parts), channel),
        autocorrelation=autocorrelation(parts)[0],
        input_correlation={name: rho for name, (_, rho) in crossed.items()},
        band95=float(normal_beyond(0.025) / np.sqrt(max(samples, 1))),
        band99=float(normal_beyond(0.005) / np.sqrt(max(samples, 1))),
    )

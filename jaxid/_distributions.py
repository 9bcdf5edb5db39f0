"""Tails of the usual distributions, by `scipy.special`.

`scipy.stats` has all of them; importing it takes a quarter of the time that everything else takes that a fit imports.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]


def chi_squared_tail(x: Any, freedom: Any) -> Any:
    """Probability of more than `x` (`scipy.stats.chi2.sf`)."""
    return special.chdtrc(freedom, np.maximum(x, 0.0))


def chi_squared_beyond(p: Any, freedom: Any) -> Any:
    """What is exceeded with probability `p` (`scipy.stats.chi2.isf`)."""
    return special.chdtri(freedom, p)


def f_tail(x: Any, above: Any, below: Any) -> Any:
    """Probability of more than `x` with these degrees of freedom (`scipy.stats.f.sf`)."""
    return special.fdtrc(above, below, np.maximum(x, 0.0))


def student_tail(x: Any, freedom: Any) -> Any:
    """Probability of more than `x` (`scipy.stats.t.sf`)."""
    return special.stdtr(freedom, np.negative(x))


def student_quantile(p: Any, freedom: Any) -> Any:
    """What is not exceeded with probability `p` (`scipy.stats.t.ppf`)."""
    return special.stdtrit(freedom, p)


def beta_tail(x: Any, a: Any, b: Any) -> Any:
    """Probability of more than `x` (`scipy.stats.beta.sf`)."""
    return special.betaincc(a, b, np.clip(x, 0.0, 1.0))


def normal_beyond(p: Any) -> Any:
    """What is exceeded with probability `p` (`scipy.stats.norm.isf`)."""
    return -special.ndtri(p)


def normal_tail(x: Any) -> Any:
    """Probability of more than `x` (`scipy.stats.norm.sf`)."""
    return special.ndtr(np.negative(x))


def normal_density(x: Any, mean: Any, deviation: Any) -> Any:
    """`scipy.stats.norm.pdf`."""
    return np.exp(-0.5 * ((x - mean) / deviation) ** 2) / (deviation * np.sqrt(2.0 * np.pi))


def moments(values: Array) -> tuple[float, float]:
    """Skewness and excess kurtosis of `values` [N], biased (`scipy.stats.skew`, `scipy.stats.kurtosis`)."""
    centred = values - values.mean()
    variance = np.mean(centred**2)
    return float(np.mean(centred**3) / variance**1.5), float(np.mean(centred**4) / variance**2 - 3.0)


def normal_test(values: Array) -> tuple[float, float]:
    """Statistic and p value of D'Agostino and Pearson's test of skewness and kurtosis (Biometrika 60, 1973) of `values` [N],
    N at least 20 (`scipy.stats.normaltest`)."""
    n = float(len(values))
    skewness, excess = moments(values)
    # Skewness: D'Agostino's Johnson transformation (Biometrika 57, 1970).
    y = skewness * np.sqrt((n + 1.0) * (n + 3.0) / (6.0 * (n - 2.0)))
    beta = 3.0 * (n**2 + 27.0 * n - 70.0) * (n + 1.0) * (n + 3.0) / ((n - 2.0) * (n + 5.0) * (n + 7.0) * (n + 9.0))
    w2 = np.sqrt(2.0 * (beta - 1.0)) - 1.0
    first = np.arcsinh(y / np.sqrt(2.0 / (w2 - 1.0))) / np.sqrt(0.5 * np.log(w2))
    # Kurtosis: Anscombe and Glynn's cube-root transformation (Biometrika 70, 1983).
    mean = 3.0 * (n - 1.0) / (n + 1.0)
    variance = 24.0 * n * (n - 2.0) * (n - 3.0) / ((n + 1.0) ** 2 * (n + 3.0) * (n + 5.0))
    x = (excess + 3.0 - mean) / np.sqrt(variance)
    third = 6.0 * (n**2 - 5.0 * n + 2.0) / ((n + 7.0) * (n + 9.0))
    third *= np.sqrt(6.0 * (n + 3.0) * (n + 5.0) / (n * (n - 2.0) * (n - 3.0)))
    a = 6.0 + 8.0 / third * (2.0 / third + np.sqrt(1.0 + 4.0 / third**2))
    ratio = (1.0 - 2.0 / a) / (1.0 + x * np.sqrt(2.0 / (a - 4.0)))
    second = (1.0 - 2.0 / (9.0 * a) - np.cbrt(ratio)) / np.sqrt(2.0 / (9.0 * a))
    statistic = float(first**2 + second**2)
    return statistic, float(chi_squared_tail(statistic, 2))

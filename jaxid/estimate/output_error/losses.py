"""Losses: how much a residual counts.

`u` is a residual in units of its channel's robust standard deviation. A loss is given by its weight psi(u)/u and by the
slope of psi; `minimise_robustly` needs no more of it. A loss of your own is a subclass of `Loss`.
"""

from abc import abstractmethod

import equinox as eqx
import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

Residuals = Float[NDArray, "*shape"]


class Loss(eqx.Module):
    """Base of all losses of a residual `u` (in robust standard deviations, any shape; numbers without a unit)."""

    @abstractmethod
    def weight(self, u: Residuals) -> Residuals:
        """psi(u)/u: 1 for squares."""

    @abstractmethod
    def slope(self, u: Residuals) -> Residuals:
        """Derivative of psi(u) = u weight(u)."""


class Squares(Loss):
    """u²/2: least squares."""

    def weight(self, u: Residuals) -> Residuals:
        return np.ones_like(u)

    def slope(self, u: Residuals) -> Residuals:
        return np.ones_like(u)


class Huber(Loss):
    """u²/2 up to k, then linear; 1.345 for 95 % efficiency under normal noise."""

    k: float = 1.345

    def weight(self, u: Residuals) -> Residuals:
        return np.minimum(1.0, self.k / np.maximum(np.abs(u), 1e-12))

    def slope(self, u: Residuals) -> Residuals:
        return (np.abs(u) < self.k).astype(float)


class Cauchy(Loss):
    """c²/2 log(1 + (u/c)²); 2.385 for 95 % efficiency under normal noise."""

    c: float = 2.385

    def weight(self, u: Residuals) -> Residuals:
        return 1.0 / (1.0 + (u / self.c) ** 2)

    def slope(self, u: Residuals) -> Residuals:
        q = (u / self.c) ** 2
        return (1.0 - q) / (1.0 + q) ** 2


class StudentT(Loss):
    """Minus the log density of Student's t with `nu` degrees of freedom."""

    nu: float = 4.0

    def weight(self, u: Residuals) -> Residuals:
        return (self.nu + 1.0) / (self.nu + u**2)

    def slope(self, u: Residuals) -> Residuals:
        return (self.nu + 1.0) * (self.nu - u**2) / (self.nu + u**2) ** 2


_NAMES = {"squares": Squares, "huber": Huber, "cauchy": Cauchy, "student_t": StudentT}


def loss_named(loss: Loss | str) -> Loss:
    """The loss itself, or the one of that name. Raises `ValueError` for a name that is none."""
    if isinstance(loss, Loss):
        return loss
    if loss not in _NAMES:
        raise ValueError(f"There is no loss {loss!r}; use {', '.join(_NAMES)} or a `Loss`.")
    return _NAMES[loss]()

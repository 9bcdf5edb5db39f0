"""Estimators: the papers' linear methods and output error."""

from .fleet import Fleet, fit_fleet
from .identifiability import FreeDirection, Identifiability, identifiability
from .integral_least_squares import integral_least_squares
from .multi_start import Basin, MultiStart, multi_start
from .output_error import output_error
from .posterior import Posterior, posterior
from .profile_likelihood import Profile, Profiles, profile_likelihood
from .repeatability import Repeatability, repeatability
from .result import Estimate, Fit, Outlier

__all__ = [
    "Basin",
    "Estimate",
    "Fit",
    "Fleet",
    "FreeDirection",
    "Identifiability",
    "MultiStart",
    "Outlier",
    "Posterior",
    "Profile",
    "Profiles",
    "Repeatability",
    "fit_fleet",
    "identifiability",
    "integral_least_squares",
    "multi_start",
    "output_error",
    "posterior",
    "profile_likelihood",
    "repeatability",
]

"""jaxid: from a wheeled robot's logs to a model its owner can trust.

import jaxid

logs = jaxid.read_logs("logs/*.csv", robot="pioneer")
fit, check = logs.split(check=["turns.csv", "crawl.csv"])
ls = jaxid.integral_least_squares(jaxid.Pioneer(), fit)
oe = jaxid.output_error(jaxid.Pioneer(), fit, start=ls)
jaxid.compare(ls, oe, check=check)
jaxid.explain(oe, fit, check)
"""

from ._float64 import float64
from .design import Design, DesignError, design_experiment
from .effects import catalogue
from .estimate import (
    Estimate,
    Fit,
    Fleet,
    Identifiability,
    MultiStart,
    Outlier,
    Posterior,
    Profiles,
    Repeatability,
    fit_fleet,
    identifiability,
    integral_least_squares,
    multi_start,
    output_error,
    posterior,
    profile_likelihood,
    repeatability,
)
from .explain import Explanation, explain
from .logs import AXIS, OMNI, PIONEER, Channels, Log, LogError, LogSet, noise_level, read_logs
from .parameters import Parameter, ParameterError, ParameterTable
from .report import Comparison, compare
from .robots import Axis, Custom, Effect, Omni, Pioneer, Robot
from .simulate import Integrator, Smooth, Sticking, simulate

__all__ = [
    "AXIS",
    "OMNI",
    "PIONEER",
    "Axis",
    "Channels",
    "Comparison",
    "Custom",
    "Design",
    "DesignError",
    "Effect",
    "Estimate",
    "Explanation",
    "Fit",
    "Fleet",
    "Identifiability",
    "Integrator",
    "Log",
    "LogError",
    "LogSet",
    "MultiStart",
    "Omni",
    "Outlier",
    "Parameter",
    "ParameterError",
    "ParameterTable",
    "Pioneer",
    "Posterior",
    "Profiles",
    "Repeatability",
    "Robot",
    "Smooth",
    "Sticking",
    "catalogue",
    "compare",
    "design_experiment",
    "explain",
    "fit_fleet",
    "float64",
    "identifiability",
    "integral_least_squares",
    "multi_start",
    "noise_level",
    "output_error",
    "posterior",
    "profile_likelihood",
    "read_logs",
    "repeatability",
    "simulate",
]

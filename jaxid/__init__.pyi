"""The public names and where each comes from; `__init__.py` imports it from there when it is first asked for."""

from . import checks as checks
from . import design as design
from . import effects as effects
from . import estimate as estimate
from . import explanation as explanation
from . import kernel as kernel
from . import logs as logs
from . import parameters as parameters
from . import report as report
from . import robots as robots
from . import simulation as simulation
from ._float64 import float64
from ._origin import Origin
from .design import Design, DesignError, design_experiment
from .effects import catalogue
from .estimate.confidence.identifiability import Identifiability, identifiability
from .estimate.confidence.posterior import Posterior, posterior
from .estimate.confidence.profile_likelihood import Profiles, profile_likelihood
from .estimate.confidence.repeatability import Repeatability, repeatability
from .estimate.linear.instrumental_variables import instrumental_variables
from .estimate.linear.integral_least_squares import integral_least_squares
from .estimate.linear.recursive_least_squares import RecursiveLeastSquares, recursive_least_squares
from .estimate.output_error.fleet import Fleet, fit_fleet
from .estimate.output_error.fleet_with_dask import fit_fleet_with_dask
from .estimate.output_error.levenberg_marquardt import BestDampingLevenbergMarquardt
from .estimate.output_error.losses import Cauchy, Huber, Loss, Squares, StudentT
from .estimate.output_error.moving_window import MovingWindow, WindowFit
from .estimate.output_error.multi_start import MultiStart, multi_start
from .estimate.output_error.optimum import Outcome
from .estimate.output_error.output_error import output_error
from .estimate.output_error.pure import Minimum, OutputErrorProblem, minimise, output_error_problem
from .estimate.prediction_error.prediction_error import prediction_error
from .estimate.result import Disturbance, Estimate, Fit, Outlier
from .explanation.changes.change import ExplainedChange
from .explanation.changes.explain_change import explain_change
from .explanation.explain import explain
from .explanation.explanation import Explanation
from .explanation.fleet import ExplainedFleet, explain_fleet
from .explanation.policy import Policy
from .logs import AXIS, OMNI, PIONEER, Channels, Log, LogError, LogSet, LogWarning, noise_level, read_logs
from .model_file import ModelFileError, read_model, write_model
from .parameters import Parameter, ParameterError, ParameterTable
from .report import Comparison, compare
from .robot_file import RobotFileError, read_robot
from .robots import (
    Axis,
    Controller,
    Custom,
    DifferentialDrive,
    DriveAxis,
    Effect,
    EffectError,
    LayoutError,
    Omni,
    Pioneer,
    Robot,
    Wheel,
    Wheeled,
    closed_loop,
)
from .saved_results import ResultFileError, load, save
from .simulation.friction import Smooth, Sticking
from .simulation.rollout import Integrator
from .simulation.simulate import simulate

__all__ = [
    "AXIS",
    "OMNI",
    "PIONEER",
    "Axis",
    "BestDampingLevenbergMarquardt",
    "Cauchy",
    "Channels",
    "Comparison",
    "Controller",
    "Custom",
    "Design",
    "DesignError",
    "DifferentialDrive",
    "DriveAxis",
    "Disturbance",
    "Effect",
    "EffectError",
    "Estimate",
    "ExplainedChange",
    "ExplainedFleet",
    "Explanation",
    "Fit",
    "Fleet",
    "Huber",
    "Identifiability",
    "Integrator",
    "LayoutError",
    "Log",
    "LogError",
    "LogSet",
    "LogWarning",
    "Loss",
    "Minimum",
    "ModelFileError",
    "MovingWindow",
    "MultiStart",
    "Omni",
    "Origin",
    "Outcome",
    "Outlier",
    "OutputErrorProblem",
    "Parameter",
    "ParameterError",
    "ParameterTable",
    "Pioneer",
    "Policy",
    "Posterior",
    "Profiles",
    "Repeatability",
    "RecursiveLeastSquares",
    "ResultFileError",
    "Robot",
    "RobotFileError",
    "Smooth",
    "Squares",
    "Sticking",
    "StudentT",
    "Wheel",
    "Wheeled",
    "WindowFit",
    "catalogue",
    "closed_loop",
    "compare",
    "design_experiment",
    "explain",
    "explain_change",
    "explain_fleet",
    "fit_fleet",
    "fit_fleet_with_dask",
    "float64",
    "identifiability",
    "instrumental_variables",
    "integral_least_squares",
    "load",
    "minimise",
    "multi_start",
    "noise_level",
    "output_error",
    "output_error_problem",
    "posterior",
    "prediction_error",
    "profile_likelihood",
    "read_logs",
    "read_model",
    "read_robot",
    "recursive_least_squares",
    "repeatability",
    "save",
    "simulate",
    "write_model",
]

__version__: str

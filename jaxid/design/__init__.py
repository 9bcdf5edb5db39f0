"""The experiment to drive next: the input from which a fit learns most, within the robot's limits."""

from .design import design_experiment
from .designed import Design, PlannedRun
from .limits import DesignError

__all__ = ["Design", "DesignError", "PlannedRun", "design_experiment"]

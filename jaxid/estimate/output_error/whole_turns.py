"""Angles that a search left turns away from where it began, where the model is the same."""

from collections.abc import Mapping

import numpy as np

from ...logs.units import unit_said
from ...robots.robot import Robot
from .evaluation import cost_at
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns, parameters_at

_HALF_TURN = np.pi
_ALIKE = 1e-6
"""Relative difference of the costs of two models that are the same but for rounding."""


def without_whole_turns(
    robot: Robot, structure: Structure, problem: Problem, optimum: Optimum, start: Mapping[str, float]
) -> Unknowns | None:
    """Where every angle is as near its `start` as half turns bring it without a change of the cost; None where all are.

    A long step of a search may leave a mounting angle eleven half turns away, whose tangent is the same.
    """
    z, moved = np.array(optimum.unknowns.z), False
    lower, upper, scale = (np.asarray(x) for x in (problem.bounds.lower, problem.bounds.upper, problem.bounds.scale))
    for i, name in enumerate(structure.names):
        said = unit_said(robot.parameters[name].unit) if name in robot.parameters else None
        if said is None or said.si != "rad":
            continue
        theta = np.asarray(parameters_at(problem, z))
        for turn in (_HALF_TURN / said.factor, 2.0 * _HALF_TURN / said.factor):
            nearer = theta[i] - turn * np.round((theta[i] - start[name]) / turn)
            if nearer == theta[i] or not lower[i] <= nearer <= upper[i]:
                continue
            tried = z.copy()
            tried[i] = nearer / scale[i]
            if cost_at(structure, problem, Unknowns(tried, optimum.unknowns.states)) <= optimum.cost * (1.0 + _ALIKE):
                z, moved = tried, True
                break
    return Unknowns(z, optimum.unknowns.states) if moved else None

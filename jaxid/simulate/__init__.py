"""Rollouts of robots: integration with true dry friction, initial states, whole logs."""

from .friction import Smooth, Sticking
from .rollout import Integrator, rollout, step
from .simulate import simulate
from .start import initial_states

__all__ = ["Integrator", "Smooth", "Sticking", "initial_states", "rollout", "simulate", "step"]

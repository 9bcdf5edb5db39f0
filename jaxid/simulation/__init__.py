"""Rollouts of robots: integration with true dry friction, initial states, whole logs."""

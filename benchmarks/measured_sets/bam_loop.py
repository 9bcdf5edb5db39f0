"""BAM's servo with its position controller: the runs simulated in closed loop, as the authors simulate them.

The logged duty is a proportional controller's, `GAIN kp (goal - q)` within [-1, 1]. Regressed on kp (goal - q) run by
run it leaves 0.3 to 4 % of the duty below saturation, most in fast runs, whose rows hold values read a moment apart. With
it the measured position is no input any more, so that a small error of torque is a small error of position and not an arm
that falls over.
"""

import json
from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pandas as pd

from jaxid import Channels, Controller, Custom, Log, LogSet

from . import bam

GAIN = 2.87e-3
"""Duty per rad and unit of the servo's kp (2.76e-3 to 2.88e-3 run by run)."""
_CHANNELS = Channels(
    ("goal", "stiffness", "supply", "on"),
    ("q",),
    units={"goal": "rad", "stiffness": "1/rad", "supply": "V", "q": "rad"},
)


def load(folder: Path) -> LogSet:
    """The 16 runs with the goal, the controller's duty per rad and the measured supply as inputs."""
    logs = []
    for log, path in zip(bam.load(folder), sorted(folder.glob("*.json")), strict=True):
        run = json.loads(path.read_text())
        rows = {key: np.array([entry[key] for entry in run["entries"]], float) for key in run["entries"][0]}
        inputs = {
            "goal": rows["goal_position"],
            "stiffness": np.full(len(log), GAIN * run["kp"]),
            "supply": rows["input_volts"],
            "on": rows["torque_enable"],
        }
        logs.append(Log.from_arrays(log.name, log.time, inputs, {"q": log.output("q")}, _CHANNELS))
    return LogSet(logs)


def robot() -> Custom:
    """Servo, pendulum and controller, with viscous and Coulomb friction (the paper's M1)."""
    plain = bam.robot()

    def dynamics(state, inputs, p, friction):
        duty = jnp.clip(inputs["stiffness"] * (inputs["goal"] - state["q"]), -1.0, 1.0)
        return plain.dynamics(state, {"u": duty * inputs["supply"], "on": inputs["on"]}, p, friction)

    return Custom(
        dynamics=dynamics,
        state_names=plain.state_names,
        own_channels=_CHANNELS,
        table=plain.table,
        dry_friction=plain.dry_friction,
        title="servo with pendulum and controller",
    )


def _law(reference, measured, state, p):
    duty = jnp.clip(reference["stiffness"] * (reference["goal"] - measured["q"]), -1.0, 1.0)
    return {"u": duty * reference["supply"], "on": reference["enabled"]}


CONTROLLER = Controller(_law, ("goal", "stiffness", "supply", "enabled"), fitted=False)
"""The same controller for `jaxid.output_error(bam.robot(), logs, controller=CONTROLLER)`: once a sample, and held."""


def with_reference(folder: Path) -> LogSet:
    """The logs of `bam.robot`, with the controller's reference in further columns."""
    names = {"goal": "goal", "stiffness": "stiffness", "supply": "supply", "on": "enabled"}
    return LogSet(
        replace(log, extra=pd.DataFrame({own: loop.input(name) for name, own in names.items()}))
        for log, loop in zip(bam.load(folder), load(folder), strict=True)
    )

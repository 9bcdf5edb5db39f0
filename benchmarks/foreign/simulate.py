"""Logs of the Pioneer in MuJoCo: held voltages in, forward speed and yaw rate at the middle of the axle out."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .pioneer_mjcf import World, mjcf

SAMPLING = 0.02
REST = 1.0
"""Seconds without voltage before a log begins, in which the wheels sink into their contacts."""


@dataclass(frozen=True)
class Motion:
    """Exact result at the samples: `speeds` [N, 2] (m/s, rad/s) and the wheels' `slip` [N, 2] along the robot (m/s)."""

    speeds: NDArray[np.float64]
    slip: NDArray[np.float64]


def _forward(data: mujoco.MjData) -> float:
    """Speed of the axle's middle along the robot [m/s]; a free joint's velocity is in world axes, its turning in the body's."""
    w, x, y, z = data.qpos[3:7]
    ahead = np.array([2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z)])
    return float(ahead @ data.qvel[:2] / np.hypot(*ahead))


def drive(p: Mapping[str, float], voltages: NDArray, world: World | None = None, delay: float = 0.0) -> Motion:
    """Motion from rest under commanded voltages [N, 2] (right, left), row k held from sample k to k + 1.

    `delay` [s], in whole integration steps, is how late the motors get their command. Raises `RuntimeError` if the engine
    gives up (a number that is not finite).
    """
    world = world or World()
    steps = round(SAMPLING / world.timestep)
    model = mujoco.MjModel.from_xml_string(mjcf(p, world))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=round(REST / world.timestep))
    late = round(delay / world.timestep)
    joints = [model.joint(name).dofadr[0] for name in ("right", "left")]
    speeds, slip = np.empty((len(voltages), 2)), np.empty((len(voltages), 2))
    reach = np.array([p["L"], -p["L"]])
    for k in range(len(voltages)):
        speeds[k] = _forward(data), data.qvel[5]
        slip[k] = p["R"] * data.qvel[joints] - speeds[k, 0] - reach * speeds[k, 1]
        done = 0
        while done < steps:
            row, within = divmod(k * steps + done - late, steps)
            held = min(steps - within, steps - done)
            data.ctrl[:] = voltages[row] if row >= 0 else 0.0
            mujoco.mj_step(model, data, nstep=held)
            done += held
    if not np.isfinite(speeds).all():
        raise RuntimeError("MuJoCo's simulation diverged: its speeds are not finite.")
    return Motion(speeds, slip)


def log_table(voltages: NDArray, motion: Motion, noise: tuple[float, float], seed: int) -> pd.DataFrame:
    """What a logger on the robot would have written: t, V2, V3 as commanded, eta1, eta2 with white noise."""
    measured = motion.speeds + np.random.default_rng(seed).standard_normal(motion.speeds.shape) * noise
    time = np.arange(len(voltages)) * SAMPLING
    columns = (time, *np.asarray(voltages).T, *measured.T)
    return pd.DataFrame(dict(zip(("t", "V2", "V3", "eta1", "eta2"), columns, strict=True)))

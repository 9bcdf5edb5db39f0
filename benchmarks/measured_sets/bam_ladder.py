"""The BAM authors' own parameters, M1 to M6, on the recorded runs: the answer key to compare an explanation with.

Their friction (Duclusaud et al., ICRA 2025) limits the dry torque to a level that may depend on speed and load:

    level = base + |load_motor m - load_external e|                            load-dependent: M3; directional: M5
          + exp(-|w / w_s|^alpha) (stribeck + |stribeck_motor m - stribeck_external e| + quadratic)  M2, M4 to M6

with m the motor's torque and e the load's. M3 and M4 have one share for both sides. The quadratic term of M6 (at most
2 % of the level here) acts while motor and load oppose each other. Viscous friction comes on top.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from jaxid import Custom, Effect, LogSet, Parameter, simulate

from . import bam, bam_loop, table

_SHARES = {
    "friction_stribeck": "N m",
    "load_friction_motor": "",
    "load_friction_external": "",
    "load_friction_motor_stribeck": "",
    "load_friction_external_stribeck": "",
    "load_friction_motor_quad": "1/(N m)",
    "load_friction_external_quad": "1/(N m)",
}


@dataclass(frozen=True)
class PublishedFriction(Effect):
    """The published law with all its terms; those that a rung of the ladder lacks are zero."""

    id: ClassVar[str] = "published"
    where: ClassVar[str] = "drivetrain"

    def parameters(self, robot) -> dict[str, Parameter]:
        found = {self.key(name): Parameter(0.0, unit, lower=0.0) for name, unit in _SHARES.items()}
        found[self.key("dtheta_stribeck")] = Parameter(1.0, "rad/s", lower=0.0)
        return found | {self.key("alpha"): Parameter(1.0, "", lower=0.0)}

    def dry(self, levels, speeds, state, p, robot):
        own = {name: p[self.key(name)] for name in (*_SHARES, "dtheta_stribeck", "alpha")}
        motor, load = state["motor"], -bam.LOAD * jnp.sin(state["q"] + p["q_offset"])
        slow = jnp.exp(-((jnp.abs(speeds[0]) / own["dtheta_stribeck"]) ** own["alpha"]))
        carried = jnp.abs(own["load_friction_motor"] * motor - own["load_friction_external"] * load)
        carried_slow = jnp.abs(
            own["load_friction_motor_stribeck"] * motor - own["load_friction_external_stribeck"] * load
        )
        driving = jnp.abs(motor) > jnp.abs(load)
        square = jnp.where(
            driving, own["load_friction_external_quad"] * load**2, own["load_friction_motor_quad"] * motor**2
        )
        square = jnp.where(motor * load < 0, square, 0.0)
        rise = carried + slow * (own["friction_stribeck"] + carried_slow + square)
        return tuple((backward + rise, forward + rise) for backward, forward in levels)


def published_robot(path: Path) -> Custom:
    """Servo, pendulum and controller with the parameters of one of the authors' files."""
    data = json.loads(path.read_text())
    for side in ("motor", "external"):  # M3 and M4: one share of the difference of the torques
        data.setdefault(f"load_friction_{side}", data.get("load_friction_base", 0.0))
        data.setdefault(f"load_friction_{side}_stribeck", data.get("load_friction_stribeck", 0.0))
    values = {f"published.{name}": data[name] for name in (*_SHARES, "dtheta_stribeck", "alpha") if name in data}
    return (bam_loop.robot() + PublishedFriction()).with_values(
        J=bam.MASS * bam.LENGTH**2 + data["armature"],
        kt=data["kt"],
        R=data["R"],
        viscous=data["friction_viscous"],
        coulomb=data["friction_base"],
        q_offset=data["q_offset"],
        **values,
    )


def errors(robot: Custom, logs: LogSet) -> dict[str, float]:
    """Root mean square and mean absolute error of the position [rad] over logs, each simulated from rest."""
    pairs = zip(logs, simulate(robot, logs), strict=True)
    off = np.concatenate([log.output("q") - seen[:, 0] for log, seen in pairs])
    return {"rms": float(np.sqrt(np.mean(off**2))), "mean_absolute": float(np.mean(np.abs(off)))}


def published_robots(folder: Path) -> dict[str, Custom]:
    """The robot with each of the authors' parameter files, by the file's name."""
    return {path.stem: published_robot(path) for path in sorted((folder / "published_params").glob("*.json"))}


def text(ladder: dict[str, dict[str, dict[str, float]]]) -> str:
    """The errors of own and published models side by side, in words and as a table."""
    rows = [
        (
            name,
            *(f"{1e3 * own[part][kind]:.0f}" for part in ("fitted", "held_out") for kind in ("rms", "mean_absolute")),
        )
        for name, own in ladder.items()
    ]
    first, last = ("jaxid, baseline (M1)", "af22604_m1", "HEAD_m1"), ("jaxid, explained", "af22604_m6", "HEAD_m6")
    steps = [[1e3 * ladder[name]["held_out"]["rms"] for name in pair] for pair in zip(first, last, strict=True)]
    gains = "; ".join(
        f"{100 * (b / a - 1):+.0f} % from {one} to {other}"
        for (a, b), one, other in zip(steps, first, last, strict=True)
    )
    header = ("model", "fitted runs, rms [mrad]", "mean absolute", "held-out runs, rms [mrad]", "mean absolute")
    return f"""The runs are simulated with the servo's position controller, as the authors simulate them, so that a small error
of torque is a small error of position (fed with the logged voltage, a model that errs a little lets the arm fall over).
Position errors of the models found here and of the authors' own parameters, M1 to M6, in the same simulation:

{table(header, rows)}

What the further terms do to the held-out rms error: {gains}.

af22604 are the authors' parameters of the commit that holds these runs, HEAD later ones. They may have been fitted to the
runs that are held out here, and HEAD to others; their files name a supply of 7.4 V, this table uses the measured one. The
set's README gives no errors of theirs to compare with."""

"""Measured logs explained: the committed figures against what is known of the machines, and what they are made from."""

import json
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks.measured_sets import bam, bam_ladder, bam_loop, husky
from jaxid.explanation.where.conditions import motions, straight, turning_left, turning_right

ROOT = Path(__file__).parents[1]
DATA = ROOT / "../shared/data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the measured logs are not beside this checkout")


def level(effect, robot, state, speed):
    """Friction level [N m] forwards of the robot with one effect, at a state and a speed."""
    p = {name: jnp.asarray(parameter.value) for name, parameter in robot.parameters.items()}
    ((_, forward),) = effect.dry(((p["coulomb"], p["coulomb"]),), (jnp.asarray(speed),), state, p, robot)
    return float(forward)


# -- measured again ----------------------------------------------------------------------------------------------------
@needs_data
def test_husky_logs_hold_steady_currents_and_show_when_it_turns():
    logs = husky.load(DATA / "husky", "wetgrass")
    for log in logs:
        changed = np.any(np.diff(log.inputs, axis=0) != 0, axis=1)
        after = np.flatnonzero(changed) + 1
        assert np.isnan(log.outputs[after]).all() and np.isfinite(log.outputs).any()
    for log, motion in zip(logs, motions(husky.SkidSteer(), logs), strict=True):
        left, right, turning = turning_left(motion), turning_right(motion), log.extra["eta2"].to_numpy()
        assert (left | right).any() and not np.any((left | right) & straight(motion))
        assert np.all(turning[left] > 0.1) and np.all(turning[right] < -0.1)


@needs_data
def test_bam_duty_is_the_proportional_controllers():
    for driven, looped in zip(bam.load(DATA / "bam_xl330"), bam_loop.load(DATA / "bam_xl330"), strict=True):
        on, supply = looped.input("on") > 0, looped.input("supply")
        wanted = looped.input("stiffness") * (looped.input("goal") - looped.output("q"))
        duty = driven.input("u") / supply
        inside = on & (np.abs(duty) < 0.95) & (duty != 0)
        slope = float(wanted[inside] @ duty[inside] / (wanted[inside] @ wanted[inside]))
        assert slope == pytest.approx(1.0, abs=0.04)
        assert np.std((duty - slope * wanted)[inside]) < 0.05 * np.std(duty[inside])


@needs_data
def test_bam_published_load_dependence_is_that_of_the_own_candidate():
    """M3 has one share of |motor - load|: the law of `LoadFriction` at that share."""
    path = DATA / "bam_xl330/published_params/HEAD_m3.json"
    data = json.loads(path.read_text())
    theirs = bam_ladder.published_robot(path)
    own = (bam_loop.robot() + bam.LoadFriction()).with_values(
        coulomb=data["friction_base"], q_offset=data["q_offset"], **{"load_friction.share": data["load_friction_base"]}
    )
    for motor, angle in ((0.3, 0.5), (-0.2, 0.8), (0.1, -1.0)):
        state = {"motor": jnp.asarray(motor), "q": jnp.asarray(angle)}
        assert level(bam_ladder.PublishedFriction(), theirs, state, 1.0) == pytest.approx(
            level(bam.LoadFriction(), own, state, 1.0), rel=1e-3
        )

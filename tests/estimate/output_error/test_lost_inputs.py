"""Inputs of missing rows estimated from what came of them: a linear drive whose samples are known in closed form."""

import numpy as np
import pytest

from jaxid import Log, LogSet, output_error, read_robot
from jaxid.estimate.output_error.lost_inputs import with_lost_inputs

from .test_lost_rows import CHANGES, DT, INPUTS, ROBOT, without

NOISE = 0.005
SIDES = ("left", "right")
ERROR = NOISE / (1.0 - np.exp(-DT)) * np.sqrt(1.0 - np.exp(-2.0 * DT))
"""Standard deviation of an input of one row as the speeds after it tell it, which fade within a second (least squares)."""


def put_back(rows):
    """The logs without `rows`, a fit to them, and what is put back."""
    logs = without(rows, noise=NOISE)
    return logs, with_lost_inputs(output_error(ROBOT, logs).robot, logs, {"v": NOISE})


@pytest.mark.parametrize(("first", "new"), [(0, 1.0), (-1, 0.0)])
def test_the_moment_of_a_change_is_found_whether_it_came_early_or_late(first, new):
    logs, found = put_back(CHANGES + first)  # of one row, missing where the new input begins or just before
    (log,) = found.logs
    assert found.places == len(CHANGES) and len(log) == len(logs[0]) + len(CHANGES)
    assert np.allclose(np.diff(log.time), DT)
    back = np.flatnonzero(~np.isfinite(log.outputs[:, 0]))
    steps = INPUTS[CHANGES] - INPUTS[CHANGES - 1]
    shares = (log.inputs[back, 0] - INPUTS[CHANGES - 1]) / steps
    assert np.all(np.abs(shares - new) * np.abs(steps) < 4.0 * ERROR)


def test_a_step_in_several_missing_rows_comes_at_one_of_them():
    rows = np.sort(np.concatenate([CHANGES + k for k in (-1, 0, 1)]))
    _, found = put_back(rows)
    (log,) = found.logs
    back = np.flatnonzero(~np.isfinite(log.outputs[:, 0])).reshape(len(CHANGES), 3)
    true = sum(INPUTS[CHANGES + k] for k in (-1, 0, 1))
    assert np.all(np.abs(log.inputs[back, 0].sum(axis=1) - true) < 4.0 * ERROR)


def test_the_parameters_come_nearer_and_their_errors_say_how_near():
    logs, found = put_back(CHANGES)
    before, after = output_error(ROBOT, logs), output_error(ROBOT, found.logs)
    wide = found.widened(after)
    assert all(found.wider[n] >= 1.0 for n in ("M", "Fv")) and max(found.wider.values()) > 1.02
    for n in ("M", "Fv"):
        assert wide[n].std_error == pytest.approx(found.wider[n] * after[n].std_error)
        assert abs(wide[n].value - 1.0) < 3.5 * wide[n].std_error
    k = after.free_names.index("M")
    assert wide.covariance[k, k] == pytest.approx(wide["M"].std_error ** 2)
    off = [max(abs(fit[n].value - 1.0) for n in ("M", "Fv")) for fit in (before, wide)]
    assert off[1] < off[0]


def test_logs_whose_inputs_do_not_change_unseen_stay_as_they_are():
    logs, found = put_back(CHANGES + 10)
    assert found.logs is logs and found.places == 0


CART = """name = "cart"
parameters = { r = 0.05, M = 4.0, J = 0.04, viscous = 0.004, coulomb = 0.1, Iw = 0.001 }
[wheels]
left = { at = [0.0, 0.1] }
right = { at = [0.0, -0.1] }
"""
"""With J = M b^2 neither wheel pulls at the other: each is an axis of mass M r^2 / 2 + Iw."""


def test_moments_are_found_from_angles_that_add_up_what_was_off(axis_law, tmp_path):
    """A row of the wrong input moves all later angles by many times their noise, and the start that is estimated from them."""
    rng, dt, noise, n = np.random.default_rng(5), 0.02, 0.01, 27 * 45
    (tmp_path / "cart.toml").write_text(CART)
    robot = read_robot(tmp_path / "cart.toml").for_columns(["angle_left", "angle_right"])
    robot = robot.change("viscous", free=True).change("coulomb", free=True)
    logs, given = [], []
    for name in ("one", "two"):
        torques = np.repeat(rng.uniform(-0.35, 0.35, (27, 2)), 45, axis=0)
        angles = [axis_law(own, dt, M=2.0 * 0.05**2 + 0.001, Fv=0.004, Fc=0.1)[1] for own in torques.T]
        changes = rng.permutation(np.arange(45, n, 45))
        lost = [*changes[:3], *(changes[3:5] - 1)]  # the first row of a new input, or the last of an old one
        kept = np.setdiff1d(np.arange(n), lost)
        read = {
            f"angle_{side}": q[kept] + noise * rng.normal(size=len(kept)) for side, q in zip(SIDES, angles, strict=True)
        }
        logs.append(Log.from_arrays(name, dt * kept, torques[kept], read, robot))
        given.append(torques)
    found = with_lost_inputs(robot, LogSet(logs), dict.fromkeys(robot.channels.measured, noise))
    assert found.places == 10
    for log, torques in zip(found.logs, given, strict=True):
        assert np.abs(log.inputs - torques).max() < 0.05  # of steps of up to 0.7

"""Delays, filters, averages and scales of measured positions, against what was done to exact angles on a fine grid."""

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, Omni, Pioneer, simulate
from jaxid.effects import effect_by_id
from jaxid.effects.sensor.outputs import sensed
from reference.encoder import averaged, counted, late, low_passed

FINE, SAMPLING = 20, 0.02


@pytest.fixture(scope="module")
def runs():
    """A force held for samples, and the exact position on the fine grid [T * FINE, 1] of a mass with viscous friction."""
    rng = np.random.default_rng(7)
    u = np.repeat(rng.uniform(-3, 3, 20), 15)
    a = np.exp(-SAMPLING / FINE)
    q, v, found = 0.0, 0.0, []
    for force in np.repeat(u, FINE):
        found.append(q)
        q, v = q + force * SAMPLING / FINE + (v - force) * (1 - a), force + (v - force) * a
    return u, np.array(found)[:, None]


@pytest.mark.parametrize(
    ("effect", "law", "values", "seen"),
    [
        ("sensor_delay", "constant", {"delay": 0.033}, lambda q: late(q, 33)),
        ("sensor_lag", "first_order", {"time_constant": 0.05}, lambda q: low_passed(q, 50.0)),
        ("sensor_lag", "moving_average", {"window": 0.07}, lambda q: averaged(q, 70)),
        ("sensor_lag", "centred_average", {"window": 0.4}, lambda q: averaged(q, 200, 200)),
        ("sensor_scale", "each_channel", {"error_q": 0.04}, lambda q: 1.04 * q),
    ],
)
def test_a_position_is_seen_as_its_sensor_makes_it(runs, effect, law, values, seen):
    u, exact = runs
    robot = Axis().with_values(M=1.0, Fv=1.0, Fc=0.0, offset=0.0)
    robot = robot + effect_by_id(robot, effect, law)
    robot = robot.with_values(**{f"{effect}.{name}": value for name, value in values.items()})
    time = SAMPLING * np.arange(len(u))
    log = Log.from_arrays("run", time, u[:, None], {"q": exact[::FINE, 0]}, robot)
    start = {name: np.zeros(1) for name in robot.states}
    found = simulate(robot, LogSet([log]), start=start)[0][:, robot.channels.measured.index("q")]
    wanted = seen(exact)[::FINE, 0]
    inner = slice(0, -12)  # a centred average ends before the log does
    without = np.abs(exact[::FINE, 0] - wanted)[inner].max()
    assert without > 5e-3 and np.abs(found - wanted)[inner].max() < 0.05 * without


def test_currents_keep_out_of_it():
    assert sensed(Omni(wheel_angles=True)) == ("V", "Vn", "W", "phi1", "phi2", "phi3", "phi4")
    assert sensed(Omni()) == ("V", "Vn", "W")
    assert sensed(Pioneer(wheel_angles=True)) == ("eta1", "eta2", "phi2", "phi3")


def test_counts_are_of_the_angle_from_wherever_the_wheel_stood():
    angles = np.linspace(0.0, 30.0, 4000)[:, None] * [1.0, -1.0]
    seen = counted(angles, 64, np.random.default_rng(1))
    step = 2 * np.pi / 64
    np.testing.assert_allclose(seen / step, np.round(seen / step), atol=1e-9)
    off = seen - angles - (seen - angles).mean(axis=0)
    assert np.abs(off).max() < 0.51 * step and np.std(off) == pytest.approx(step / np.sqrt(12), rel=0.02)

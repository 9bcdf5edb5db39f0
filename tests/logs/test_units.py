"""jaxid/logs/units.py: units as formats and people write them; factors by the SI brochure, words by WPILib."""

import math

import pytest

from jaxid.logs.units import unit_in_name, unit_said


@pytest.mark.parametrize(
    ("text", "si", "factor"),
    [
        ("Rotation per Second", "rad/s", 2 * math.pi),  # WPILib's RotationsPerSecond.name()
        ("Rotation", "rad", 2 * math.pi),
        ("Meter per Second", "m/s", 1.0),
        ("meters_per_second", "m/s", 1.0),
        ("Volt", "V", 1.0),
        ("deg/s", "rad/s", math.pi / 180),
        ("°/s", "rad/s", math.pi / 180),
        ("rpm", "rad/s", math.pi / 30),
        ("km/h", "m/s", 1 / 3.6),
        ("mm", "m", 1e-3),
        ('{"source": "robot", "unit": "degrees"}', "rad", math.pi / 180),
    ],
)
def test_a_formats_own_words_are_units(text, si, factor):
    found = unit_said(text)
    assert found is not None and found.si == si and found.factor == pytest.approx(factor)


@pytest.mark.parametrize("text", ["", "{", "apples per second", "Meter of cable", '{"unit": 3}'])
def test_other_words_are_none(text):
    assert unit_said(text) is None


@pytest.mark.parametrize(
    ("name", "si", "factor"),
    [
        ("/gyro_dps.vector.z", "rad/s", math.pi / 180),
        ("/base/motor_command.left_mv", "V", 1e-3),
        ("wheelSpeedRPM", "rad/s", math.pi / 30),
        ("speed (km/h)", "m/s", 1 / 3.6),
        ("V2 [mV]", "V", 1e-3),
        ("/drive/left_mV", "V", 1e-3),
        ("motor_mA", "A", 1e-3),
        ("/drive/left_rps", "rad/s", 2 * math.pi),
        ("wheelSpeedRpsLeft", "rad/s", 2 * math.pi),
        ("left_kRPM", "rad/s", 1000 * math.pi / 30),
        ("gz_degps", "rad/s", math.pi / 180),
        ("Gierrate [°/s]", "rad/s", math.pi / 180),
        ("/speed_mm_s.data", "m/s", 1e-3),
        ("heading_deg", "rad", math.pi / 180),
        ("gyro_deg", "rad or rad/s", math.pi / 180),
        ("yaw_rate_deg", "rad or rad/s", math.pi / 180),
        ("log.x_mm", "m", 1e-3),
        ("vx_mm", "m or m/s", 1e-3),
        ("current_ma", "A", 1e-3),
    ],
)
def test_names_bear_units(name, si, factor):
    found = unit_in_name(name)
    assert found is not None and found.si == si and found.factor == pytest.approx(factor)


@pytest.mark.parametrize(
    "name",
    [
        "/odom.pose.pose.position.x",
        "/tf[a->b].rotation.z",
        "/arm/m",
        "/turn.data",
        "/imu.angular_velocity.z",
        "joints[m]",
    ],
)
def test_words_that_mean_something_else_are_no_units(name):
    assert unit_in_name(name) is None


@pytest.mark.parametrize(
    ("name", "said"), [("/left/pwm.data", "duty"), ("duty [%]", "duty"), ("/enc.left_ticks", "counts")]
)
def test_of_shares_and_counts_only_the_owner_knows_the_factor(name, said):
    found = unit_in_name(name)
    assert found is not None and math.isnan(found.factor) and (found.si, found.said) == ("", said)

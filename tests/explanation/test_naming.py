"""The fast slice of the blind study: a drive axis with one thing hidden, nothing hidden, and what no catalogue holds.

Data from the event-accurate simulator, read back from CSV files; `benchmarks/naming.py` runs the whole study.
"""

import pytest

pytest.importorskip("numba")
from benchmarks.naming import Plan, run  # noqa: E402


def explained(effects: dict[str, float], seed: int = 31) -> dict:
    """What `explain` says of one case."""
    return run(Plan("axis", "single", effects, "medium", seed))


def test_nothing_hidden_is_adequate():
    found = explained({})
    assert found["verdict"] == "adequate"
    assert found["named"] == [] and found["before"] == found["after"]


@pytest.mark.parametrize(
    ("effect", "size"),
    [
        ("stribeck_friction", 4.0),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in [
                ("sensor_bias", 0.03),
                ("actuator_dead_zone", 0.3),
                ("quadratic_drag", 20.0),
                ("cogging_torque", 8.0),
            ]
        ),
    ],
)
def test_a_hidden_effect_is_named_and_closes_the_gap(effect, size):
    found = explained({effect: size})
    assert found["verdict"] == "named"
    assert found["named"] == [effect]
    assert found["before"] > 1.4 and found["after"] < 1.03
    for name, (true, value, std_error, _) in found["covered"].items():
        assert abs(value - true) < 4 * std_error, name


@pytest.mark.slow
def test_a_delay_of_input_or_sensor_is_one_set():
    """Zero-order hold and a robot at rest: on one axis the two are the same but for the first samples."""
    found = explained({"input_delay": 0.03})
    assert found["verdict"] == "ambiguous"
    assert {found["named"][0], *found["equivalent"][found["named"][0]]} == {"input_delay", "sensor_delay"}
    assert found["after"] < 1.03


@pytest.mark.slow
def test_pushes_are_in_no_catalogue():
    found = explained({"push": 15.0})
    assert found["verdict"] == "unexplained"
    assert found["before"] > 3

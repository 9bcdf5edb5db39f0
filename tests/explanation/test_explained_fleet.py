"""jaxid/explanation/fleet.py: every member gets what it gets alone; what a fleet's explanations have in common."""

from dataclasses import replace

import pytest

from jaxid import Axis, LogError, explain_fleet, read_logs
from jaxid.explanation import fleet
from jaxid.explanation.fleet import ExplainedFleet, named, summary


@pytest.fixture(scope="module")
def logs(hidden_drag):
    return read_logs(hidden_drag / "fit_*.csv", "axis")


def test_a_member_gets_what_it_gets_alone_and_one_that_fails_is_named(explained, logs):
    said = []
    others = {"a": explained.held_out, "twice": logs}  # no log may be fitted and held out
    fits = {"a": explained.baseline, "twice": explained.baseline}
    found = explain_fleet(fits, {"a": logs, "twice": logs}, others, report=said.append)
    assert list(found.explanations) == ["a"]
    assert found.explanations["a"].to_dict() == explained.to_dict()
    assert set(found.failed) == {"twice"} and "both called" in found.failed["twice"]
    assert any(line.startswith("a: first look") for line in said)
    table = found.to_pandas().set_index("member")
    assert table.loc["a", "effects"] == "quadratic_drag" and table.loc["a", "failure"] == ""
    assert (
        table.loc["a", "before"] == explained.before.normalised_rms and "both called" in table.loc["twice", "failure"]
    )
    drag = found.effects_to_pandas().set_index(["member", "parameter"]).loc[("a", "coefficient")]
    assert drag["value"] == explained.effects[0].parameters["coefficient"].value and drag["status"] == "identified"
    assert "quadratic drag in 1" in repr(found) and "twice: " in repr(found)


def test_one_answer_for_all_says_nothing_of_their_numbers(explained):
    """Seven members that lack the same, one of which weighs twice as much; of four nothing can be said, which is said."""
    weights = dict(zip("abcdefg", (1.0, 1.02, 0.98, 1.01, 1.0, 0.99, 2.0), strict=True))
    mass = explained.final["M"]
    members = {}
    for name, times in weights.items():
        own = replace(mass, value=times * mass.value)
        members[name] = replace(
            explained, final=replace(explained.final, parameters={**explained.final.parameters, "M": own})
        )
    found = ExplainedFleet(members, {})
    assert [(far.member, far.parameter) for far in found.far] == [("g", "M")]
    assert "g is far from the others in M" in repr(found)
    few = ExplainedFleet(dict(list(members.items())[:4]), {})
    assert not few.far and "takes 5 sound fits, and there are 4" in repr(few)


def test_members_without_logs_are_the_callers_mistake(explained, logs):
    with pytest.raises(LogError, match="a has no held-out logs"):
        explain_fleet({"a": explained.baseline}, {"a": logs}, {})
    with pytest.raises(LogError, match="no member"):
        explain_fleet({}, {}, {})
    with pytest.raises(LogError, match="a has no logs"):
        explain_fleet(Axis(), {"a": ()}, {})  # type: ignore[dict-item]


def test_who_differs_from_most_is_said():
    rows = [(f"robot {k}", "named", "input_delay", "", "") for k in range(5)]
    rows += [("robot 5", "named", "sensor_bias,input_delay", "", ""), ("robot 6", "adequate", "", "", "")]
    rows += [("robot 7", "", "", "", "no fit")]
    said = summary(rows)
    assert said[0] == "7 of 8 members explained: 6 named, 1 adequate."
    assert said[1] == "Missing: input delay in 6, sensor bias in 1."
    assert said[2] == "One answer for most (5): input delay."
    assert said[3:] == [
        "Other than most, input delay and sensor bias: robot 5.",
        "Other than most, adequate: robot 6.",
    ]
    assert summary([("a", "", "", "", "no fit")]) == ["0 of 1 members explained."]


def test_names_that_the_logs_cannot_tell_apart_are_no_names_that_are_sure():
    """An effective track that may be a sensor's scale: both are said, wherever the member is."""
    rows = [(f"robot {k}", "adequate", "", "", "") for k in range(5)]
    rows += [
        ("robot 5", "ambiguous", "effective_track", "sensor_scale,motor_cross_talk", ""),
        ("robot 6", "ambiguous", "effective_track", "sensor_scale", ""),
        ("robot 7", "named", "input_delay", "", ""),
    ]
    said = summary(rows)
    assert said[1] == "Missing: input delay in 1."
    assert said[2].startswith("Missing, of names that the logs cannot tell apart: effective track (or sensor scale")
    assert "Other than most, effective track (or sensor scale, motor cross talk): robot 5, robot 6." in said
    assert named("ambiguous", "effective_track", "sensor_scale") == "effective track (or sensor scale)"
    assert named("unexplained", "effective_track", "") == ""


def test_what_jaxid_should_not_raise_costs_one_member_alone(explained, logs, monkeypatch):
    def broken(fit, *arguments, **options):
        if fit is other:
            raise ZeroDivisionError("division by zero")
        return explained

    other = replace(explained.baseline)
    monkeypatch.setattr(fleet, "explain", broken)
    fits = {"a": explained.baseline, "b": other}
    found = explain_fleet(fits, dict.fromkeys(fits, logs), dict.fromkeys(fits, explained.held_out))
    assert list(found.explanations) == ["a"] and "ZeroDivisionError" in found.failed["b"]
    assert "report it" in found.failed["b"] and "test_explained_fleet.py, line " in found.failed["b"]


def test_a_fleet_says_how_many_complete_robots_chance_makes_look_incomplete():
    """One of thirty at a level of 1 %: it may be chance's. Nothing is said where all are complete, or where there are few."""
    members = [(f"robot {k}", "adequate", "", "", "") for k in range(29)]
    said = " ".join(summary([*members, ("odd one", "unexplained", "", "", "")]))
    assert "of 30 complete robots, chance makes 0.3 look incomplete" in said
    assert "of 30 complete robots, chance makes 1.5" in " ".join(
        summary([*members, ("odd one", "unexplained", "", "", "")], false_alarm=0.05)
    )
    assert "chance" not in " ".join(summary(members))
    assert "chance" not in " ".join(summary([*members[:2], ("odd one", "unexplained", "", "", "")]))

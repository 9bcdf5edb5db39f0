"""The study of foreign laws: its cases, its judge and its page, without an explanation."""

import numpy as np
import pytest

from benchmarks.laws import judge, page
from benchmarks.laws.cases import make, parameters
from benchmarks.laws.plans import FIRST_SEED, plans
from reference.law_table import LAWS, applies


def entry(hidden, verdict, named, **more):
    own = {
        "case": "c",
        "kind": "quick",
        "strength": "medium",
        "noise": "white",
        "off": False,
        "code": "x",
        "seconds": 1.0,
    }
    said = {"verdict": verdict, "named": named, "equivalent": more.pop("equivalent", {}), "laws": more.pop("laws", {})}
    return {**own, "hidden": dict.fromkeys(hidden, {}), **said, "before": 3.0, "after": 1.0, **more}


@pytest.mark.parametrize("name", FIRST_SEED)
def test_every_set_hides_every_law_and_no_two_sets_share_a_seed(name):
    own = plans(name)
    assert {law for plan in own if plan.kind == "quick" for law in plan.laws} == set(LAWS)
    assert len({plan.name for plan in own}) == len(own)
    assert all(applies(law, plan.robot) for plan in own for law in plan.laws)
    others = {plan.seed for other in FIRST_SEED if other != name for plan in plans(other)}
    assert not others & {plan.seed for plan in own}


def test_parameters_are_those_of_the_law_and_drawn_from_the_seed():
    for law in LAWS:
        for robot in ("pioneer", "omni", "axis"):
            if applies(law, robot):
                one, other = (parameters(robot, law, 0.1, np.random.default_rng([k, 3])) for k in (1, 1))
                assert set(one) == set(LAWS[law]) and one == other
                assert abs(next(iter(one.values()))) == 0.1


def test_a_case_is_the_same_again_and_its_constants_may_be_off():
    laws = {"stribeck_friction/lorentzian": 4.0}
    one, again = make("axis", laws, 20500), make("axis", laws, 20500)
    assert all(one.tables[stem].equals(again.tables[stem]) for stem in one.tables)
    off = make("axis", laws, 20500, constants_off=True)
    assert off.nominal == one.nominal
    assert 0.01 <= abs(off.truth["gain"] / one.truth["gain"] - 1) <= 0.05
    assert off.truth["Fc"] == one.truth["Fc"]


def test_the_judge():
    law = "motor_gain_mismatch/torque_constant"
    assert judge.outcome(entry([law], "named", ["motor_gain_mismatch"])) == "right"
    declared = {"wheel_radius_mismatch": ["motor_gain_mismatch"]}
    assert judge.outcome(entry([law], "ambiguous", ["wheel_radius_mismatch"], equivalent=declared)) == "right"
    assert judge.outcome(entry([law], "named", ["motor_gain_mismatch", "sensor_bias"])) == "wrong name"
    assert judge.outcome(entry([law], "unexplained", ["motor_gain_mismatch"])) == "right, not believed"
    assert judge.outcome(entry([law], "unexplained", ["motor_gain_mismatch", "sensor_bias"])) == "right among others"
    assert judge.outcome(entry([law], "adequate", [])) == "adequate"
    assert judge.outcome(entry([], "adequate", [])) == "right"
    assert judge.outcome(entry([], "named", ["sensor_bias"])) == "wrong name"
    assert judge.outcome(entry(["sensor_lag/second_order"], "named", ["motor_lag"])) == "neighbour named"
    pair = ["sensor_bias/drawn", law]
    assert judge.outcome(entry(pair, "named", ["sensor_bias", "motor_gain_mismatch"])) == "right"
    assert judge.outcome(entry(pair, "named", ["sensor_bias"])) != "right"
    both = entry(["asymmetric_friction/with_viscous"], "named", ["asymmetric_friction", "asymmetric_viscous_friction"])
    assert judge.outcome(both) == "right"


def test_laws_are_judged_where_they_are_told():
    hidden = ["stribeck_friction/drawn"]
    assert judge.law_right(entry(hidden, "named", ["stribeck_friction"])) is None
    assert judge.law_right(
        entry(hidden, "named", ["stribeck_friction"], laws={"stribeck_friction": ["power", "shape"]})
    )
    wrong = entry(
        ["stribeck_friction/lorentzian"], "named", ["stribeck_friction"], laws={"stribeck_friction": ["gaussian"]}
    )
    assert judge.law_right(wrong) is False
    unlisted = entry(["payload_change/leaking"], "named", ["payload_change"], laws={"payload_change": ["shape"]})
    assert judge.law_right(unlisted) is None


def test_the_page_counts():
    own = {
        "a": entry(["sensor_bias/drawn"], "named", ["sensor_bias"]),
        "b": entry(["sensor_bias/drawn"], "named", ["sensor_lag"], after=2.0),
        "c": entry([], "adequate", [], kind="complete"),
        "d": {"case": "d", "kind": "pair", "strength": "medium", "noise": "white", "off": False, "code": "x",
              "hidden": {"x/y": {}}, "error": "RuntimeError: no"},
        "e": {"case": "e", "kind": "quick", "strength": "medium", "noise": "white", "off": False, "code": "x",
              "hidden": {"x/y": {}}, "unseen": 1.02},
    }  # fmt: skip
    text = page.text({"main": own}, {"main": plans("main")})
    assert "| mechanism named, medium and strong | ≥ 97 % | 1 of 2: 50 %" in text
    assert "| gap closed, median | ≥ 98 % | 75.0 % |" in text
    assert "noise white | ≤ 2 % | 0 of 1" in text
    assert "RuntimeError: no" in text and "1 ended with an error; in 1 what" in text

"""The study of false alarms: a few of its cases, and how its page counts."""

import pytest

pytest.importorskip("numba", reason="the independent simulator needs numba")

from benchmarks.false_alarms import SEED, SETTINGS, draw, run
from benchmarks.false_alarms_page import share, write
from benchmarks.sensor_noise import FAMILIES, KINDS

SHORT = "50 Hz, 10 s, 1 + 1 logs"


def cases(robot, hidden=False, count=2):
    """The first cases of different kinds of noise of a robot in short logs."""
    drawn = (draw(number, SEED, hidden) for number in range(400))
    found = {case.kind: case for case in drawn if case.robot == robot and case.setting == SHORT}
    return [found[kind] for kind in sorted(found)][:count]


@pytest.mark.parametrize("robot", ["axis", pytest.param("two masses", marks=pytest.mark.slow)])
def test_complete_models_are_complete_whatever_the_noise(robot):
    rows = [run(case) for case in cases(robot, count=4)]
    assert len({row["kind"] for row in rows}) == 4
    assert not [row for row in rows if row["alarm"]]


def test_what_is_hidden_is_seen():
    rows = [run(case) for case in cases("axis", hidden=True) if case.strength > 1.0]
    assert rows and all(row["alarm"] for row in rows)


def test_every_kind_of_noise_has_its_family_and_a_number_is_always_the_same_case():
    assert sorted(kind for kinds in FAMILIES.values() for kind in kinds) == sorted(KINDS)
    assert draw(7, SEED) == draw(7, SEED) and draw(7, SEED) != draw(7, SEED + 1)


def test_the_page_counts_what_was_run(tmp_path):
    usual = {"robot": "axis", "setting": SHORT, "why": "white", "p_value": 0.5, "normalised_rms": 1.0, "code": "abc"}
    rows = [
        usual | {"number": k, "kind": kind, "alarm": k == 0, "alarms": {"0.01": k == 0}}
        for k, kind in enumerate(("white", "Laplace", "white"))
    ]
    hidden = [usual | {"number": 9, "kind": "white", "alarm": True, "hidden": "drag", "strength": 1.0}]
    write(rows, hidden, (0.01,), list(SETTINGS), tmp_path / "page.md")
    page = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert f"| white | {share(1, 2)} | 1.00 |" in page and f"| heavy-tailed | {share(0, 1)} | 1.00 |" in page
    assert f"| white | 0.5 to 1.5 | {share(1, 1)} |" in page and "- 0: axis" in page
    assert (tmp_path / "page" / "calibration.png").is_file()

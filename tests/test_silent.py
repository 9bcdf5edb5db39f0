"""The study of wrong answers: cases that were wrong and silent once, and how its processes share the work."""

import argparse
import json

import pytest

from benchmarks.cases.judge import errors, run, verdict
from benchmarks.silent import SEED, append, blocks, done_by, estimate, in_turn, rows_of
from jaxid import simulate
from jaxid.simulation.simulate import integrator_for

WANTED = argparse.Namespace(seed=SEED, family=None, condition=None, wide=False)


def drawn(number):
    pytest.importorskip("numba", reason="the independent simulator needs numba")
    from benchmarks.cases.draw import draw

    return draw(number, SEED)


@pytest.mark.parametrize(
    ("number", "words"),
    [(282, "friction that rises towards standstill"), (208, "drag that grows with the square"), (1372, "the speed")],
)
def test_a_hidden_force_that_hardly_shows_is_said(number, words):
    row = run(drawn(number), estimate)
    assert row["fit_error"] < 1.15 and words in row["words"][0]


def test_inputs_that_changed_in_dropped_rows_are_said_where_the_residual_is_white():
    row = run(drawn(1398), estimate)
    assert row["fit_error"] < 1.05 and row["held_out_error"] > 2.0 and row["outcome"] == "wrong, said"
    assert row["verdict"] == "sound" and "Rows are missing" in row["words"][0]


def test_a_held_out_log_close_to_the_top_is_not_held_against_parameters_that_are_right():
    row = run(drawn(642), estimate)
    assert row["held_out_error"] > 5 and row["outcome"] == "right"
    assert all(abs(off) < 2 for *_, off in row["parameters"].values())
    # The same miss by parameters outside of what the result says of them is wrong.
    assert verdict(row | {"truth_within": False})["outcome"] == "wrong, silent"


def test_a_caster_that_is_pushed_over_its_dead_point_is_simulated_in_steps_that_are_short_enough():
    case = drawn(325)
    true, first = case.robot.with_values(**case.truth), len(case.fit)
    assert errors(case, simulate(true, case.held_out), case.held_out, first) < 1.05
    plain = simulate(true, case.held_out, integrator=integrator_for(true, case.held_out))
    assert errors(case, plain, case.held_out, first) > 2.0


def test_two_processes_do_every_case_and_begin_apart():
    found = blocks(range(60), WANTED)
    one, other = (in_turn(found, part, 2) for part in (0, 1))
    assert sorted(one) == sorted(other) == list(range(60))
    half = len(one) // 3
    assert not set(one[:half]) & set(other[:half])


def test_a_row_that_was_cut_short_costs_that_row_alone_and_the_last_one_counts(tmp_path):
    path = tmp_path / "rows.jsonl"
    append(path, {"number": 2, "code": "old"})
    append(path, {"number": 1, "fit_error": float("nan")})
    with path.open("a") as file:
        file.write('{"number": 3, "code"')
    append(path, {"number": 2, "code": "new"})
    assert done_by(path, "new") == done_by(path, "old") == {2} and done_by(path, "other") == set()
    assert rows_of(path) == [{"number": 1, "fit_error": None}, {"number": 2, "code": "new"}]
    assert all(json.loads(line) for line in path.read_text().splitlines() if line.endswith("}"))

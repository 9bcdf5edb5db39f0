"""Broken input on the command line: status 1 or 2 and one line on stderr, or a result with its warnings."""

import jax
import pytest

from benchmarks.fuzzing.corpus import commands
from benchmarks.fuzzing.good import good_logs
from benchmarks.fuzzing.judge import Outcome, judge_command

AXIS = next(good for good in good_logs() if good.robot == "axis")
CASES = [case for case in commands(number=3) if case.name.startswith("simulate")][::9]


@pytest.fixture(scope="module", autouse=True)
def settings_of_jax():
    """The command line keeps compiled programs; JAX forgets about that afterwards."""
    names = ("compilation_cache_dir", "persistent_cache_min_compile_time_secs", "persistent_cache_min_entry_size_bytes")
    before = {f"jax_{name}": getattr(jax.config, f"jax_{name}") for name in names}
    yield
    for name, value in before.items():
        jax.config.update(name, value)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_broken_input_is_one_line(tmp_path, case):
    verdict = case.judge(tmp_path)
    assert verdict.right, f"{verdict.outcome}: {verdict.said}"


def test_wrong_arguments_are_status_2(tmp_path):
    for arguments in (
        ["fit"],
        ["fit", "pionier"],
        ["simulate", "no.such:thing", "--log", "a", "--model", "b", "--out", "c"],
    ):
        assert judge_command(arguments, "").outcome is Outcome.REFUSED


def test_a_failed_simulation_leaves_the_old_result(tmp_path):
    (tmp_path / "run.csv").write_text(AXIS.text)
    (tmp_path / "model.toml").write_text("[parameters]\nM = 1e-90\n")
    out = tmp_path / "predicted.csv"
    out.write_text("old")
    arguments = ["simulate", "axis", "--log", str(tmp_path / "run.csv"), "--model", str(tmp_path / "model.toml")]
    assert judge_command([*arguments, "--out", str(out)], "run.csv", (out,)).outcome is Outcome.REFUSED
    assert out.read_text() == "old" and not list(tmp_path.glob(".*"))

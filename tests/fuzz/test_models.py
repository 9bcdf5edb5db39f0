"""Broken model files and mappings: refused in a sentence, and never more than data."""

import ast
import json
import tomllib
from pathlib import Path

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

import jaxid
from benchmarks.fuzzing import models
from benchmarks.fuzzing.good import good_logs
from benchmarks.fuzzing.judge import ROBOTS, Outcome, judge_log, judge_model
from benchmarks.fuzzing.mutations import edited, edits
from jaxid.logs import LogError
from jaxid.model_file import ModelFileError, model_text, read_model
from jaxid.report.files import write_fit

GOOD = next(good for good in good_logs() if good.robot == "pioneer")


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("kind", models.BROKEN | models.ODD)
def test_every_way_to_break_a_model_ends_well(tmp_path, robot, kind):
    content = (models.BROKEN | models.ODD)[kind](ROBOTS[robot](), np.random.default_rng(len(kind)))
    path = tmp_path / "model.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    verdict = judge_model(path, ROBOTS[robot](), odd=kind in models.ODD)
    assert verdict.outcome is (Outcome.SAME if kind in models.ODD else Outcome.REFUSED), verdict.said


@hypothesis.settings(
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=100,
    suppress_health_check=[hypothesis.HealthCheck.function_scoped_fixture],
)
@hypothesis.given(data=st.data())
def test_random_bytes_in_a_model_end_well(tmp_path, data):
    text = model_text(jaxid.Axis()).encode()
    path = tmp_path / "model.toml"
    path.write_bytes(edited(text, data.draw(edits(len(text)))))
    verdict = judge_model(path, jaxid.Axis(), by_chance=True)
    assert verdict.right or verdict.outcome is Outcome.UNSEEN, f"{verdict.outcome}: {verdict.said}"


@pytest.mark.parametrize("kind", models.BROKEN_MAPPINGS | models.ODD_MAPPINGS)
def test_every_way_to_break_a_mapping_ends_well(tmp_path, kind):
    content = (models.BROKEN_MAPPINGS | models.ODD_MAPPINGS)[kind]
    path, mapping = tmp_path / "run.csv", tmp_path / "mapping.toml"
    path.write_text(GOOD.text)
    mapping.write_bytes(content if isinstance(content, bytes) else content.encode())
    odd = kind in models.ODD_MAPPINGS
    verdict = judge_log(path, GOOD, mapping=mapping, harmless=odd)
    assert verdict.outcome in ({Outcome.SAME} if odd else {Outcome.REFUSED, Outcome.TOLD}), verdict.said


RUNS_CODE = {
    "pickle",
    "cPickle",
    "_pickle",
    "dill",
    "cloudpickle",
    "joblib",
    "shelve",
    "marshal",
    "yaml",
    "runpy",
    "code",
}
CALLS_CODE = {"eval", "exec", "compile", "__import__", "import_module", "execfile"}


def test_nothing_in_the_package_runs_data_as_code():
    """No module that loads objects is imported, and one place imports what a user names: the command line's."""
    imported, called = set(), set()
    package = Path(jaxid.__file__).parent
    for path in package.rglob("*.py"):
        where = path.relative_to(package).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {(alias.name.split(".")[0], where) for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                imported.add(((node.module or "").split(".")[0], where))
            elif isinstance(node, ast.Call):
                # As methods, `compile` belongs to regular expressions and to JAX.
                name = getattr(node.func, "id", getattr(node.func, "attr", "").replace("compile", ""))
                if not (node.args and isinstance(node.args[0], ast.Constant)):  # a module named in the code is no data
                    called.add((name, where))
                pickles = [k.value for k in node.keywords if k.arg == "allow_pickle"]
                assert all(isinstance(value, ast.Constant) and value.value is False for value in pickles), where
    assert not {entry for entry in imported if entry[0] in RUNS_CODE}
    assert {entry for entry in called if entry[0] in CALLS_CODE} == {("import_module", "cli/arguments.py")}


def test_names_in_files_are_never_imported(tmp_path, monkeypatch):
    """A module of that name lies in the current folder; it is not touched by a model, a mapping, or from Python."""
    (tmp_path / "intruder.py").write_text("raise SystemExit('imported')\n")
    (tmp_path / "run.csv").write_text(GOOD.text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    for text in ('robot = "intruder:robot"', '[[effects]]\nid = "intruder:effect"', '[parameters]\n"intruder:M" = 1'):
        Path("model.toml").write_text(text)
        with pytest.raises(ModelFileError, match="intruder"):
            read_model("model.toml", jaxid.Pioneer())
    Path("mapping.toml").write_text('V2 = "intruder:column"')
    with pytest.raises(LogError, match="intruder"):
        jaxid.read_logs("run.csv", "pioneer", mapping="mapping.toml")
    with pytest.raises(LogError, match="intruder"):
        jaxid.read_logs("run.csv", "intruder:robot")


def test_the_command_line_imports_what_stands_on_it(tmp_path, monkeypatch, jaxid):
    (tmp_path / "intruder_on_purpose.py").write_text("raise RuntimeError('imported')\n")
    monkeypatch.chdir(tmp_path)
    status, _, said = jaxid("fit", "intruder_on_purpose:robot", "--fit", "run.csv", "--out", "out")
    assert status == 1 and "intruder_on_purpose.py:1 (RuntimeError: imported)" in said


def test_results_are_json_and_toml(tmp_path):
    log = tmp_path / "run.csv"
    log.write_text(next(good for good in good_logs() if good.robot == "axis").text)
    fit = jaxid.integral_least_squares(jaxid.Axis(), jaxid.read_logs(log, "axis"))
    write_fit(tmp_path, [fit])
    numbers = json.loads((tmp_path / "fit.json").read_text())["methods"]["integral_least_squares"]["parameters"]
    model = tomllib.loads((tmp_path / "model.toml").read_text())["parameters"]
    assert all(numbers[name]["value"] == pytest.approx(entry["value"], rel=0) for name, entry in model.items())

"""jaxid/cli/folder.py: one command's results do not take the place of another's, and nothing that was edited is lost."""

import json

import pytest

from jaxid.cli.arguments import UnusableInput
from jaxid.cli.folder import RECORD, record, results_in


def made(out, command="fit", robot="axis", overwrite=False, **files):
    """What a command leaves in its folder."""
    with results_in(out, command, robot, overwrite):
        for name, text in files.items():
            (out / name.replace("_", ".", 1)).write_text(text)


def test_a_folder_says_which_command_made_it(tmp_path):
    made(tmp_path / "new" / "out", model_toml="M = 1")
    found = json.loads((tmp_path / "new/out" / RECORD).read_text())
    assert (found["command"], found["robot"], list(found["files"])) == ("fit", "axis", ["model.toml"])


@pytest.mark.parametrize(
    ("command", "robot", "words"),
    [("explain", "axis", "results of `jaxid fit`"), ("fit", "omni", "for the robot 'axis'")],
)
def test_another_commands_or_robots_results_are_kept(tmp_path, command, robot, words):
    made(tmp_path, model_toml="M = 1")
    with pytest.raises(UnusableInput, match=f"{words}.*--overwrite"):
        made(tmp_path, command, robot, model_toml="M = 2")
    assert (tmp_path / "model.toml").read_text() == "M = 1"
    made(tmp_path, command, robot, overwrite=True, model_toml="M = 2")
    assert json.loads((tmp_path / RECORD).read_text())["command"] == command


def test_the_same_command_goes_again_unless_somebody_has_edited_what_it_wrote(tmp_path):
    for text in ("M = 1", "M = 2"):
        made(tmp_path, model_toml=text, fit_json="{}")
    (tmp_path / "fit.json").write_text("read by nobody but programs")
    made(tmp_path, model_toml="M = 3")
    (tmp_path / "model.toml").write_text("M = 3  # weighed")
    with pytest.raises(UnusableInput, match=r"model.toml has changed since `jaxid fit` wrote it"):
        made(tmp_path, model_toml="M = 4")
    assert "weighed" in (tmp_path / "model.toml").read_text()
    made(tmp_path, overwrite=True, model_toml="M = 5")


def test_columns_filled_into_a_designed_experiment_are_not_written_over(tmp_path):
    made(tmp_path, "design", experiment_csv="t,u\n0,1\n")
    (tmp_path / "experiment.csv").write_text("t,u,v\n0,1,0.1\n")
    with pytest.raises(UnusableInput, match="experiment.csv has changed"):
        made(tmp_path, "design", experiment_csv="t,u\n0,2\n")


@pytest.mark.parametrize(("file", "command"), [("fit.json", "fit"), ("explanation.json", "explain"), ("x.json", "")])
def test_folders_without_a_record_are_known_by_their_results(tmp_path, file, command):
    (tmp_path / "fit.json" if command else tmp_path / file).write_text("{}")
    (tmp_path / file).write_text("{}")
    if command:
        with pytest.raises(UnusableInput, match=f"results of `jaxid {command}`"):
            made(tmp_path, "design")
        made(tmp_path, command)
    else:
        made(tmp_path, "design")


def test_a_run_that_fails_leaves_no_record_and_one_that_is_stopped_can_go_again(tmp_path):
    with pytest.raises(ZeroDivisionError), results_in(tmp_path, "fit", "axis", False):
        1 / 0  # noqa: B018
    assert not list(tmp_path.iterdir())
    record(tmp_path, "explain", "axis")  # as `jaxid explain` does before its first file
    (tmp_path / "fit.json").write_text("{}")
    made(tmp_path, "explain")


def test_a_record_that_is_damaged_counts_as_none(tmp_path):
    (tmp_path / RECORD).write_text("{")
    made(tmp_path, "design")
    (tmp_path / RECORD).write_text("[1]")
    made(tmp_path, "design")

"""jaxid/cli/app.py and options.py: help, completion and the effects of a user's own on the command line."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import typer

from jaxid.cli.app import app

OWN = """
from dataclasses import dataclass
from typing import ClassVar

from jaxid import Effect, Parameter


@dataclass(frozen=True)
class Magnet(Effect):
    id: ClassVar[str] = "magnet"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "F = pull * v * |v|"

    def parameters(self, robot):
        return {self.key("pull"): Parameter(0.0, "N s^2/m^2", free=True, typical=0.5)}

    def force(self, forces, state, p):
        return (forces[0] - p[self.key("pull")] * state["v"] * abs(state["v"]),)


@dataclass(frozen=True)
class Faulty(Magnet):
    id: ClassVar[str] = "faulty"

    def parameters(self, robot):
        return {self.key("pull"): 1 / 0}


@dataclass(frozen=True)
class Nameless(Magnet):
    id: ClassVar[str] = ""


@dataclass(frozen=True)
class Drag(Magnet):
    id: ClassVar[str] = "quadratic_drag"


ours = [Magnet()]
mixed = [Magnet(), 3]
twice = [Magnet(), Magnet()]
none = []
number = 3
faulty, nameless, drag = Faulty(), Nameless(), Drag()


def make():
    return Magnet()


def fails():
    raise OSError("no such magnet")
"""
COMMANDS = [command.name or command.callback.__name__ for command in app.registered_commands]


def plain(text):
    """Help without its frame, in one line."""
    return re.sub(r"\s+", "", re.sub(r"[│╭╮╰╯─]", "", text))


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("columns", [70, 160])
def test_help_shows_every_word_that_options_say_of_themselves(jaxid, monkeypatch, command, columns):
    """Units in brackets, stars of patterns and quotes among them."""
    monkeypatch.setattr("typer.rich_utils.MAX_WIDTH", columns)
    code, said, _ = jaxid(command, "-h")
    assert code == 0 and said == jaxid(command, "--help")[1]
    asked = {c.name: c for c in typer.main.get_command(app).commands.values()}[command]
    lines = [line.split("│") for line in said.splitlines()]
    for option in asked.params:
        words = (option.help or "").replace("`", "").split()
        assert all(any(word in part for line in lines for part in line) or len(word) > 20 for word in words), words
    if command == "design":
        assert "[m]" in plain(said) and "[s]" in plain(said)


def completed(*words):
    """What the shell is told to complete the last of the words with."""
    code = "from jaxid.cli import main; main()"
    run = subprocess.run(
        [sys.executable, "-c", code],
        env={
            **os.environ,
            "_JAXID_COMPLETE": "complete_bash",
            "COMP_WORDS": " ".join(words),
            "COMP_CWORD": str(len(words) - 1),
        },
        capture_output=True,
        text=True,
    )
    return run.stdout.split()


def test_the_shell_completes_commands_robots_and_options():
    assert completed("jaxid", "ex") == ["explain"]
    assert completed("jaxid", "fit", "pi") == ["pioneer"]
    assert completed("jaxid", "fit", "axis", "--fit", "a.csv", "b.csv", "--hel") == ["--held-out", "--help"]


@pytest.mark.parametrize(
    ("attribute", "status", "words"),
    [
        ("number", 1, "is a int, no effect"),
        ("mixed", 1, "has 3 in place 1, which is no Effect"),
        ("twice", 1, "two effects 'magnet'"),
        ("none", 1, "is empty"),
        ("nameless", 1, "Nameless has no id"),
        ("fails", 1, "OSError: no such magnet"),
        ("faulty", 1, "'faulty' of --effects fails at"),
        ("drag", 1, "'quadratic_drag' of --effects has the id of one of the catalogue"),
        ("our", 2, "close: 'ours'"),
        ("", 2, "is no package.module:attribute"),
    ],
)
def test_what_is_no_effect_is_said(jaxid, tmp_path, monkeypatch, attribute, status, words):
    monkeypatch.chdir(tmp_path)
    Path("effects_of_a_test.py").write_text(OWN)
    argv = ("explain", "axis", "--fit", "a.csv", "--held-out", "b.csv", "--out", "o")
    code, said, remarks = jaxid(*argv, "--effects", f"effects_of_a_test:{attribute}")
    assert (code, said) == (status, "") and "Traceback" not in remarks
    assert plain(words) in plain(remarks) and not Path("o").exists()


def test_what_a_users_robot_is_wrong_about_is_said_with_their_own_line(jaxid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("robot_of_a_test.py").write_text(
        "import jaxid\n\ncart = jaxid.Custom(\n    dynamics=lambda x, u, p: {'v': u['f']}, state_names=('v',),\n"
        "    own_channels=jaxid.Channels(('f',), ('v',)), table={}, dry_friction={'wheel': ('v', 'Fc')})\n"
    )
    code, _, remarks = jaxid("fit", "robot_of_a_test:cart", "--fit", "a.csv", "--out", "o")
    assert code == 1 and plain("robot_of_a_test.py:3 (ParameterError: dry friction of axis 'wheel'") in plain(remarks)


LOG = "t,u,v\n" + "\n".join(f"{0.02 * k:.2f},{2.0 * (k > 9)},0" for k in range(60)) + "\n"
MODEL = """
[[effects]]
id = "magnet"

[parameters]
M = 2.0
Fv = 0.0
Fc = 0.0
offset = 0.0
"magnet.pull" = 0.5
"""


def test_a_model_with_an_effect_of_ones_own_is_simulated(jaxid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("effects_of_a_test.py").write_text(OWN)
    Path("log.csv").write_text(LOG)
    Path("model.toml").write_text(MODEL)
    argv = ("simulate", "axis", "--log", "log.csv", "--model", "model.toml", "--out", "p.csv")
    code, _, remarks = jaxid(*argv)
    assert code == 1 and "--effects package.module:attribute" in remarks
    code, _, remarks = jaxid(*argv, "--effects", "effects_of_a_test:make")
    assert code == 0, remarks
    found = pd.read_csv("p.csv")
    # M v' = u - pull v |v| from rest: v = sqrt(u / pull) tanh(sqrt(u pull) t / M).
    since = np.maximum(found["t"] - 0.2, 0.0)
    np.testing.assert_allclose(found["v"], 2.0 * np.tanh(since / 2.0), atol=1e-6)


def test_an_experiment_that_nobody_has_driven_yet_is_simulated(jaxid, tmp_path, monkeypatch):
    """As `jaxid design` writes it: inputs alone, from rest; and a file that lacks one of several outputs is still wrong."""
    monkeypatch.chdir(tmp_path)
    times = 0.01 * np.arange(200)
    Path("experiment.csv").write_text("t,u\n" + "".join(f"{t:.2f},3\n" for t in times))
    Path("model.toml").write_text("[parameters]\nM = 2.0\nFv = 1.5\nFc = 0.6\noffset = 0.0\n")
    code, _, remarks = jaxid("simulate", "axis", "--log", "experiment.csv", "--model", "model.toml", "--out", "p.csv")
    assert code == 0 and "dead" not in remarks, remarks
    found = pd.read_csv("p.csv")
    np.testing.assert_allclose(found["v"], 2.4 / 1.5 * (1.0 - np.exp(-1.5 / 2.0 * times)), atol=1e-6)
    Path("half.csv").write_text("t,u_right,u_left,v\n" + "".join(f"{t:.2f},3,3,0.1\n" for t in times))
    Path("model.toml").write_text("[parameters]\nM = 2.0\n")
    code, _, remarks = jaxid("simulate", "differential", "--log", "half.csv", "--model", "model.toml", "--out", "q.csv")
    assert code == 1 and "no column 'w'" in remarks


def test_a_log_by_other_names_is_not_said_to_have_columns_that_it_lacks(jaxid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("run.csv").write_text("Zeit [s],PWM,Weg\n" + "".join(f"{0.1 * k:.1f},1,2\n" for k in range(20)))
    Path("model.toml").write_text("[parameters]\nM = 2.0\n")
    code, _, remarks = jaxid("simulate", "axis", "--log", "run.csv", "--model", "model.toml", "--out", "p.csv")
    said = " ".join(remarks.split())
    assert code == 1 and "run.csv has no column 't'; it has 'Zeit [s]', 'PWM', 'Weg': rename one" in said, remarks


def test_effects_without_a_model_that_could_name_them_are_wrong_arguments(jaxid):
    code, _, remarks = jaxid("fit", "axis", "--fit", "a.csv", "--out", "o", "--effects", "effects_of_a_test:ours")
    assert code == 2 and "--model names" in remarks


@pytest.mark.parametrize("out", ["log.csv", "model.toml", "../here/log.csv"])
def test_a_simulation_does_not_take_the_place_of_what_it_is_made_from(jaxid, tmp_path, monkeypatch, out):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    Path("log.csv").write_text(LOG)
    Path("model.toml").write_text("[parameters]\nM = 2.0\n")
    code, _, remarks = jaxid("simulate", "axis", "--log", "log.csv", "--model", "model.toml", "--out", out)
    assert code == 1 and "would be written over" in remarks
    assert Path("log.csv").read_text() == LOG


@pytest.mark.parametrize("spec", ["my_robot.py:cart", "./my_robot.py:cart", "folder/my_robot:cart"])
def test_a_robot_that_is_named_by_its_file_is_told_its_module(jaxid, tmp_path, monkeypatch, spec):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.csv").write_text("t,u,v\n0,0,0\n")
    code, _, remarks = jaxid("look", "run.csv", "--robot", spec)
    said = " ".join(remarks.replace("│", " ").split())
    assert (
        code == 2 and "names a file; give its module, my_robot:cart, and start from the folder of my_robot.py" in said
    )

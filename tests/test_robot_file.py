"""jaxid/robot_file.py: a robot on wheels from fifteen lines, and what is said of lines that make none."""

import numpy as np
import pytest

import jaxid
from jaxid.robot_file import RobotFileError, read_robot

KIWI = """
name = "kiwi"

[parameters]
M = 5.2
J = { value = 0.05, free = true, lower = 0.01 }
r = 0.05
K = 0.025
Ra = 0.6
gear = 12.0
supply = 12.0

[wheels]
front = { at = [0.20, 0.0], rolls = 90, kind = "omni" }
left = { at = [-0.10, 0.173], rolls = 210, kind = "omni" }
right = { at = [-0.10, -0.173], rolls = 330, kind = "omni", command = "motor 3" }
"""


def read(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return read_robot(path)


def refused(tmp_path, text):
    with pytest.raises(RobotFileError) as error:
        read(tmp_path, text)
    assert "robot.toml" in str(error.value) and "\n" not in str(error.value)
    return str(error.value)


def test_fifteen_lines_are_a_robot(tmp_path):
    robot = read(tmp_path, KIWI)
    assert len([line for line in KIWI.splitlines() if line]) <= 15
    assert robot.name == "kiwi" and robot.motors and robot.velocities == ("V", "Vn", "W")
    assert robot.channels.inputs == ("u_front", "u_left", "motor 3")
    table = robot.parameters
    assert (table["M"].value, table["M"].free) == (5.2, False)
    assert (table["J"].value, table["J"].free, table["J"].lower) == (0.05, True, 0.01)
    assert table.free_names == ("J", "viscous", "coulomb")
    assert robot.wheels[1] == jaxid.Wheel("left", (-0.1, 0.173), 210.0, "omni")


def test_the_file_s_own_name_stands_where_there_is_none(tmp_path):
    robot = read(tmp_path, "[parameters]\nr = 0.1\n[wheels]\na = { at = [0, 0.2] }\nb = { at = [0, -0.2] }")
    assert robot.name == "robot" and not robot.motors and robot.parameters["M"].free


def test_it_is_saved_with_results_and_named_by_models(tmp_path):
    robot = read(tmp_path, KIWI)
    assert jaxid.load(jaxid.save(robot, tmp_path / "kiwi.jaxid")) == robot
    model = jaxid.write_model(tmp_path / "model.toml", robot.with_values(M=6.0)) or tmp_path / "model.toml"
    assert jaxid.read_model(model, robot).parameters["M"].value == 6.0
    assert hash(robot) == hash(read(tmp_path, KIWI))


def test_what_makes_no_robot_is_said(tmp_path):
    assert "there are no wheels" in refused(tmp_path, "[parameters]\nr = 0.1")
    assert "radius in m" in refused(tmp_path, KIWI.replace("r = 0.05\n", ""))
    assert "parameters.supply is missing" in refused(tmp_path, KIWI.replace("supply = 12.0\n", ""))
    assert "(close: 'Ra'" in refused(tmp_path, KIWI.replace("Ra", "ra").replace("gear = 12.0", "gear = 12.0\nRa = 1"))
    assert "use standard" in refused(tmp_path, KIWI.replace('"omni"', '"omnii"')).replace("one of ", "")
    assert "unknown key roll" in refused(tmp_path, KIWI.replace("rolls = 90", "roll = 90"))
    assert "no place" in refused(tmp_path, KIWI.replace("[0.20, 0.0]", "[0.20]"))
    assert "no angle" in refused(tmp_path, KIWI.replace("rolls = 90", 'rolls = "left"'))
    assert "no wheel" in refused(tmp_path, KIWI + "back = 3\n")
    assert "no word" in refused(tmp_path, KIWI.replace('"motor 3"', "3"))
    assert "kind = 'skid'" in refused(tmp_path, KIWI.replace(', kind = "omni"', ""))
    assert "there is no key mass" in refused(tmp_path, "mass = 3\n" + KIWI)
    assert "is not TOML" in refused(tmp_path, "name = kiwi")
    assert "is no table" in refused(tmp_path, "wheels = 3")
    assert "negative" in refused(tmp_path, KIWI.replace("M = 5.2", "M = -5.2"))
    assert "gear = 0; give it a value above zero" in refused(tmp_path, KIWI.replace("gear = 12.0", "gear = 0"))
    assert "r = -0.05; give it a value above zero" in refused(tmp_path, KIWI.replace("r = 0.05", "r = -0.05"))
    assert "r = 50 is no wheel's radius in metres" in refused(tmp_path, KIWI.replace("r = 0.05", "r = 50"))
    assert "too far from the origin for metres" in refused(tmp_path, KIWI.replace("[0.20, 0.0]", "[200, 0.0]"))
    assert "is no name" in refused(tmp_path, KIWI.replace('"kiwi"', "7"))
    with pytest.raises(RobotFileError, match="cannot be opened"):
        read_robot(tmp_path / "none.toml")


def test_the_command_line_takes_it(tmp_path, capsys):
    from jaxid.cli import main

    (tmp_path / "kiwi.toml").write_text(KIWI, encoding="utf-8")
    time = np.arange(0, 2, 0.01)
    rows = np.column_stack([time, *(3 * np.sin(time * f) for f in (3, 4, 5)), *np.zeros((3, len(time)))])
    header = "t,u_front,u_left,motor 3,V,Vn,W"
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=header, comments="")
    (tmp_path / "model.toml").write_text('robot = "kiwi"', encoding="utf-8")
    rest = ["--model", str(tmp_path / "model.toml"), "--log", str(tmp_path / "log.csv"), "--out"]
    with pytest.raises(SystemExit) as ended:
        main(["simulate", str(tmp_path / "kiwi.toml"), *rest, str(tmp_path / "p.csv")])
    assert not ended.value.code and (tmp_path / "p.csv").exists()
    with pytest.raises(SystemExit) as ended:
        main(["simulate", str(tmp_path / "none.toml"), *rest, str(tmp_path / "q.csv")])
    assert ended.value.code and "cannot be opened" in " ".join(capsys.readouterr().err.split())

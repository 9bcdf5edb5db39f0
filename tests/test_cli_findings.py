"""What the command line says of columns beside what pre-flight finds."""

import numpy as np

from jaxid import DifferentialDrive, Log, LogSet, read_robot
from jaxid.cli.findings import warn_of_findings, warn_of_unused


def said(capsys, columns):
    robot = DifferentialDrive().for_columns(("t", "u_right", "u_left", *columns))
    time, there = np.arange(50) * 0.02, {name: np.zeros(50) for name in columns}
    outputs = {name: there.pop(name) for name in robot.channels.outputs}
    log = Log.from_arrays("a", time, np.zeros((50, 2)), outputs, robot.channels, extra=there)
    warn_of_unused(robot, LogSet([log]), None)
    return " ".join(capsys.readouterr().err.split())


def test_columns_of_the_robots_own_sensors_that_a_fit_leaves_out_are_named(capsys):
    told = said(capsys, ("v", "w", "v_right", "v_left", "temperature"))
    assert told.startswith("warning: v_right, v_left: not used, since v, w are") and "temperature" not in told
    assert said(capsys, ("v_right", "v_left", "w")) == ""


def test_a_speed_that_is_called_otherwise_on_this_robot_is_told_its_name(tmp_path, capsys):
    path = tmp_path / "cart.toml"
    path.write_text(
        'name = "cart"\n[parameters]\nr = 0.08\n[wheels]\nleft = { at = [0.0, 0.2] }\nright = { at = [0.0, -0.2] }\n'
    )
    robot = read_robot(path).for_columns(["t", "u_left", "u_right", "speed_left", "speed_right", "W"])
    zeros = {name: np.zeros(50) for name in robot.channels.outputs}
    log = Log.from_arrays(
        "a", np.arange(50) * 0.02, np.zeros((50, 2)), zeros, robot.channels, extra={"W": np.zeros(50)}
    )
    warn_of_unused(robot, LogSet([log]))
    told = " ".join(capsys.readouterr().err.split())
    assert told == "warning: W: not used, for the yaw rate of this robot is called w; rename the column, or map it."


def rims(name, times):
    """Wheels that follow their voltages within 0.3 s, in m/s times so much."""
    random, robot = (
        np.random.default_rng(3),
        DifferentialDrive().for_columns(("t", "u_right", "u_left", "v_right", "v_left")),
    )
    volts, speeds = np.repeat(random.uniform(-8, 8, (20, 2)), 40, axis=0), np.zeros((800, 2))
    for k in range(799):
        speeds[k + 1] = speeds[k] + 0.02 / 0.3 * (0.1 * volts[k] - speeds[k])
    speeds += 0.003 * random.normal(size=speeds.shape)
    return Log.from_arrays(name, np.arange(800) * 0.02, volts, times * speeds, robot.channels)


def test_what_is_found_of_a_column_in_several_logs_is_said_once_with_their_names(capsys):
    """Rims' speeds in revolutions a minute of a wheel of 8 cm: no floor gives such accelerations."""
    warn_of_findings(LogSet([rims(name, 60 / (2 * np.pi * 0.08)) for name in "abc"]), LogSet([rims("d", 119.0)]))
    told = " ".join(capsys.readouterr().err.split())
    assert "warning: a, column 'v_right': " in told and "likewise column 'v_right' of b, c, d" in told
    assert told.count("much for m/s") == 2 and told.count("more than wheels on a floor can give") == 2
    warn_of_findings(LogSet([rims("a", 1.0), rims("b", 1.0)]))
    assert "m/s" not in capsys.readouterr().err

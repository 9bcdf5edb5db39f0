"""What the command line says of columns beside what pre-flight finds."""

import numpy as np

from jaxid import DifferentialDrive, Log, LogSet
from jaxid.cli.findings import warn_of_unused


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

"""jaxid/live/work.py: a log is judged among the others, as everywhere else."""

from dataclasses import replace

import numpy as np

from jaxid import LogSet, demo, read_logs
from jaxid.live.work import ReadLog, together


def test_a_sensor_that_the_others_show_to_be_alive_is_not_called_dead():
    def louder(log):
        """A gyro in whose noise the little that the robot turns in this log is lost."""
        turning = log.channels.measured.index("eta2")
        noise = 0.6 * np.random.default_rng(0).normal(size=len(log))
        return replace(log, outputs=log.outputs + np.eye(len(log.channels.measured))[turning] * noise[:, None])

    logs = [
        louder(log) if log.name == "check_3.csv" else log
        for log in read_logs(demo.folder("unknown") / "*.csv", robot="pioneer")
    ]
    alone = {log.name: tuple(LogSet([log]).preflight()) for log in logs}
    read = [ReadLog(log.name, log, "", alone[log.name], log.name.startswith("check")) for log in logs]
    assert [found.check for found in alone["check_3.csv"] if found.severity != "note"] == ["dead_sensor"]
    broken = ReadLog("broken.csv", None, "is empty", (), False)
    assert together([broken, *read])[0] == broken
    doubtful = {own.name for own in together(read) if any(found.severity != "note" for found in own.findings)}
    assert not doubtful, "what the README says of these nine logs"

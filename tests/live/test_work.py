"""jaxid/live/work.py: a log is judged among the others, as everywhere else."""

from jaxid import demo, read_logs
from jaxid.live.work import ReadLog, together


def test_a_sensor_that_the_others_show_to_be_alive_is_not_called_dead():
    logs = read_logs(demo.folder("unknown") / "*.csv", robot="pioneer")
    alone = {log.name: tuple(read_logs(log.source, robot="pioneer").preflight()) for log in logs}
    read = [ReadLog(log.name, log, "", alone[log.name], log.name.startswith("check")) for log in logs]
    assert [found.check for found in alone["check_3.csv"] if found.severity != "note"] == ["dead_sensor"]
    broken = ReadLog("broken.csv", None, "is empty", (), False)
    assert together([broken, *read])[0] == broken
    doubtful = {own.name for own in together(read) if any(found.severity != "note" for found in own.findings)}
    assert not doubtful, "what the README says of these nine logs"

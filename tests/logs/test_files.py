"""jaxid/logs/files.py: which files are meant, and which stretches of them."""

import numpy as np
import pandas as pd
import pytest

from jaxid import read_logs
from jaxid.logs import LogError
from jaxid.logs.files import files_of, named_files

TIMES = np.round(np.arange(500) * 0.02, 6)


@pytest.fixture
def run(tmp_path):
    path = tmp_path / "run.csv"
    frame = pd.DataFrame({"t": TIMES, "u": np.round(TIMES) % 3, "v": np.sin(TIMES), "q": 1 - np.cos(TIMES)})
    frame.to_csv(path, index=False)
    return path


def test_stretches_of_a_file_are_logs_of_their_own(run):
    logs = read_logs([f"{run}[0:2]", f"{run}[4.5:]"], "axis")
    assert [log.name for log in logs] == ["run.csv[0:1.98]", "run.csv[4.5:9.98]"]
    assert [len(log) for log in logs] == [100, 275]
    np.testing.assert_array_equal(logs[1].output("v"), np.sin(TIMES[225:]))
    assert read_logs(f"{run.parent}/*.csv[:1]", "axis")[0].duration == pytest.approx(0.98)


def test_a_file_whose_name_ends_like_a_stretch_is_that_file(run):
    odd = run.with_name("run.csv[1:2]")
    odd.write_bytes(run.read_bytes())
    assert files_of(odd) == [odd] and named_files(odd)[0].start is None


@pytest.mark.parametrize(
    ("stretches", "says"),
    [
        (["[0:2]", "[1:3]"], "given twice"),
        (["", "[1:3]"], "given twice"),
        (["[3:1]"], "ends before it begins"),
        (["[1.2.3:4]"], "no stretch of time; write seconds"),
        (["[100:]"], r"holds 0 sample\(s\); the log runs from 0 to 9.98 s"),
    ],
)
def test_stretches_that_are_none(run, stretches, says):
    with pytest.raises(LogError, match=says):
        read_logs([f"{run}{stretch}" for stretch in stretches], "axis")

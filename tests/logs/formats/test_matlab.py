"""jaxid/logs/formats/matlab.py: files of SciPy's own writer."""

import numpy as np
import pytest

from jaxid import read_logs
from jaxid.logs import LogError
from jaxid.logs.formats import read_recording
from tests.recordings import write_mat

T = np.arange(50) * 0.02
U, V = np.sin(T), np.cos(T)


@pytest.mark.parametrize(
    ("variables", "mapping"),
    [
        ({"t": T, "u": U, "v": V}, None),
        ({"t": T[:, None], "u": U[None, :], "v": V}, None),
        ({"run": {"Time": T, "u": U, "v": V}, "note": "of a timetable"}, {"u": "run.u", "v": "run.v"}),
        ({"clock": T * 1000, "u": U, "v": V}, {"t": {"column": "clock", "scale": 0.001}}),
        (
            {"out": {"time": T, "signals": [{"values": U, "label": "u"}, {"values": V, "label": "v"}]}},
            {"u": "out.u", "v": "out.v"},
        ),
        ({"tout": T, "yout": np.stack([U, V], axis=1)}, {"u": "yout[0]", "v": {"field": "yout[1]"}}),
    ],
)
def test_ways_to_save_a_run_give_the_same_log(tmp_path, variables, mapping):
    log = read_logs(write_mat(tmp_path / "run.mat", variables), "axis", mapping=mapping)[0]
    np.testing.assert_allclose(log.time, T, atol=1e-9)
    np.testing.assert_array_equal(log.input("u"), U)
    np.testing.assert_array_equal(log.output("v"), V)
    assert not [finding for finding in log.findings if finding.severity != "note"]


def test_signals_of_other_rates_keep_their_own_times(tmp_path):
    slow = {"time": T[::5], "v": V[::5]}
    path = write_mat(tmp_path / "run.mat", {"fast": {"time": T, "u": U}, "slow": slow})
    series = read_recording(path).series
    assert len(series["fast.u"]) == 50 and len(series["slow.v"]) == 10
    np.testing.assert_array_equal(series["slow.v"].received, np.round(T[::5] * 1e9))


def test_what_cannot_be_read_says_how_to_save_it(tmp_path):
    h5py = pytest.importorskip("h5py", reason="files of version 7.3 are HDF5")
    new = tmp_path / "new.mat"
    with h5py.File(new, "w") as file:
        file["t"] = T
    with pytest.raises(LogError, match="version 7.3; save it by .*-v7"):
        read_recording(new)


@pytest.mark.parametrize(
    ("variables", "says"),
    [
        ({"u": U}, "no vectors with a time of their length"),
        ({"t": T, "u": U[:-1]}, r"it has t \(50\), u \(49\)"),
        ({"t": np.append(T[:-1], np.nan), "u": U}, "'t' holds times that are not finite"),
        ({"text": "hello"}, "no vectors of numbers"),
    ],
)
def test_files_without_a_run(tmp_path, variables, says):
    with pytest.raises(LogError, match=says):
        read_recording(write_mat(tmp_path / "run.mat", variables))

"""jaxid/logs/formats/matlab.py: files of SciPy's own writer."""

import sys

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


@pytest.mark.parametrize("mapping", [{}, {"t": {"field": "t_ms", "scale": 0.001}}])
def test_times_in_another_unit_stand_beside_their_signals(tmp_path, mapping):
    """In every struct its own, found by their name, or by the mapping, whose scale then counts."""
    names = {"u": "fast.force", "v": {"field": "slow.speed", "scale": 0.001}}
    slow = {"t_ms": 1000 * T[::5], "speed": 1000 * V[::5]}
    path = write_mat(tmp_path / "run.mat", {"fast": {"t_ms": 1000 * T, "force": U}, "slow": slow})
    log = read_logs(path, "axis", mapping=names | mapping)[0]
    np.testing.assert_allclose(log.time[np.isfinite(log.output("v"))], T[::5], atol=1e-9)
    np.testing.assert_allclose(log.output("v")[np.isfinite(log.output("v"))], V[::5])
    other = write_mat(
        tmp_path / "other.mat", {"fast": {"clk": T, "force": U}, "slow": {"clk": T[::5], "speed": V[::5]}}
    )
    log = read_logs(other, "axis", mapping={"u": "fast.force", "v": "slow.speed", "t": "clk"})[0]
    np.testing.assert_allclose(log.time[np.isfinite(log.output("v"))], T[::5], atol=1e-9)


def matlab73(path):
    """As MATLAB lays out version 7.3: 512 bytes before the HDF5 file, columns as rows, structs as groups, text as numbers."""
    h5py = pytest.importorskip("h5py", reason="files of version 7.3 are HDF5")
    with h5py.File(path, "w", userblock_size=512) as file:

        def add(group, name, values, kind="double"):
            made = group.create_dataset(name, data=values)
            made.attrs["MATLAB_class"] = np.bytes_(kind)

        run = file.create_group("run")
        run.attrs["MATLAB_class"] = np.bytes_("struct")
        add(run, "t", T[None, :])
        add(run, "u", U[None, :])
        add(run, "v", U[:, None] * 2)
        logged = file.create_group("out")
        add(logged, "time", T[None, :])
        signals = logged.create_group("signals")
        add(signals, "values", np.stack([U, -U]))
        add(signals, "label", np.array([[ord(c)] for c in "wheel"], dtype=np.uint16), "char")
        references = file.create_group("#refs#")
        add(references, "a", T[None, :])
        file.create_dataset("cells", data=np.array([references.ref], dtype=h5py.ref_dtype))
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def test_version_73_is_read_as_older_ones_are(tmp_path):
    series = read_recording(matlab73(tmp_path / "new.mat")).series
    assert set(series) == {"run.u", "run.v", "out.wheel[0]", "out.wheel[1]"}
    np.testing.assert_array_equal(series["run.v"].values, 2 * U)
    np.testing.assert_array_equal(series["out.wheel[1]"].values, -U)
    np.testing.assert_array_equal(series["run.u"].received, np.round(T * 1e9))


def test_version_73_without_h5py_or_damaged(tmp_path, monkeypatch):
    whole = matlab73(tmp_path / "new.mat").read_bytes()
    for length in range(512, len(whole), len(whole) // 12):
        cut = tmp_path / f"cut_{length}.mat"
        cut.write_bytes(whole[:length])
        with pytest.raises(LogError, match="cannot be read as a MATLAB file"):
            read_recording(cut)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(LogError, match=r"pip install jaxid-robots\[mat73\], or save it by .*-v7"):
        read_recording(tmp_path / "new.mat")


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

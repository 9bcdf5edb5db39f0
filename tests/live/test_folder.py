"""jaxid/live/folder.py: nothing that is sent to the page gets anywhere but into its folder, under its own name."""

import io
import os

import pytest

from jaxid.live.folder import LogFolder, Refused, log_name

ELSEWHERE = [
    "../x.csv", "..", ".", "", "a/../../x.csv", "/etc/x.csv", "\\\\host\\x.csv", "..\\x.csv", "C:\\x.csv", "C:x.csv",
    "x.csv:stream.csv", "x\0.csv", "x.csv\0.txt", "x\n.csv", "%2e%2e%2fx.csv", ".hidden.csv", "~/x.csv", " x.csv", "x.csv.",
    "nul.csv", "COM1.csv", "x\u202ecsv.csv", "x/", "\ud800.csv", "a" * 300 + ".csv",
]  # fmt: skip


@pytest.fixture
def place(tmp_path):
    """A folder of logs, its neighbour, and a file there that must stay as it is."""
    (tmp_path / "logs").mkdir()
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside/kept.csv").write_text("kept")
    return tmp_path


def store(folder, name, data=b"t,u,v\n", length=None):
    return folder.store(name, io.BytesIO(data), len(data) if length is None else length)


def everything(place):
    return sorted(str(path.relative_to(place)) for path in place.rglob("*"))


@pytest.mark.parametrize("name", ELSEWHERE, ids=ascii)
def test_a_name_that_is_no_plain_one_is_refused(place, name):
    before = everything(place)
    with pytest.raises(Refused) as refused:
        store(LogFolder(place / "logs"), name)
    assert refused.value.status == 400 and str(refused.value).endswith(".")
    assert everything(place) == before


def test_only_logs_are_taken(place):
    for name in ("x.html", "x", "x.csv.exe", "authorized_keys", "x.py", "x.toml"):
        with pytest.raises(Refused, match="does not end as a log does") as refused:
            store(LogFolder(place / "logs"), name)
        assert refused.value.status == 415
    assert log_name("Fahrt 3 über Kies.CSV") == "Fahrt 3 über Kies.CSV" and log_name("a.csv.gz") == "a.csv.gz"


def test_a_log_is_stored_whole_and_never_over_another(place):
    folder = LogFolder(place / "logs")
    assert store(folder, "a.csv", b"one") == "a.csv" and (place / "logs/a.csv").read_bytes() == b"one"
    with pytest.raises(Refused, match="is there already") as refused:
        store(folder, "a.csv", b"two")
    assert refused.value.status == 409 and (place / "logs/a.csv").read_bytes() == b"one"
    with pytest.raises(Refused, match="broke off after 3 of 9 bytes"):
        store(folder, "b.csv", b"abc", length=9)
    assert everything(place / "logs") == ["a.csv"]  # nothing half, nothing hidden


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="this system has no symbolic links")
@pytest.mark.parametrize("target", ["outside/kept.csv", "outside/new.csv"])
def test_a_link_in_the_folder_leads_nothing_out_of_it(place, target):
    os.symlink(place / target, place / "logs/link.csv")
    before = everything(place)
    with pytest.raises(Refused, match="is there already"):
        store(LogFolder(place / "logs"), "link.csv", b"changed")
    os.symlink(place / "outside", place / "logs/away")
    with pytest.raises(Refused):
        store(LogFolder(place / "logs"), "away/new.csv", b"changed")
    assert (place / "outside/kept.csv").read_text() == "kept" and set(everything(place)) - {"logs/away"} == set(before)


def test_what_is_too_large_is_refused_before_it_is_read(place):
    folder = LogFolder(place / "logs", largest=10)

    class Unread(io.BufferedIOBase):
        def read(self, size):
            raise AssertionError("it was read")

    with pytest.raises(Refused, match="is 5e\\+06 MB; the page takes logs up to 1e-05 MB: copy it into") as refused:
        folder.store("a.csv", Unread(), 5_000_000_000_000)
    assert refused.value.status == 413
    with pytest.raises(Refused, match="is empty"):
        folder.store("a.csv", Unread(), 0)
    assert store(folder, "b.csv", b"0123456789") == "b.csv"


def test_the_folder_is_listed_by_what_its_files_are(place):
    folder = LogFolder(place / "logs")
    store(folder, "b.csv")
    store(folder, "a.mcap")
    (place / "logs/.hidden.csv").write_text("")
    (place / "logs/read me.md").write_text("")
    (place / "logs/bag").mkdir()
    (place / "logs/bag/metadata.yaml").write_text("")
    os.symlink(place / "nowhere.csv", place / "logs/dangling.csv")
    before = folder.files()
    assert list(before) == ["a.mcap", "b.csv", "bag"] and folder.others() == ("dangling.csv", "read me.md")
    (place / "logs/b.csv").write_text("longer than it was")
    after = folder.files()
    assert after["b.csv"] != before["b.csv"] and after["a.mcap"] == before["a.mcap"]

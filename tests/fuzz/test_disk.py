"""Files that vanish or cannot be opened, results that cannot be written, full disks and killed runs."""

import os

import pytest

from benchmarks.fuzzing import disk
from benchmarks.fuzzing.good import good_logs
from jaxid._atomic import write_text

AXIS = next(good for good in good_logs() if good.robot == "axis")
pytestmark = pytest.mark.skipif(os.name != "posix", reason="permissions, links and mounts are POSIX's")


@pytest.fixture
def folder(tmp_path):
    """A folder that everyone may enter: without root's rights its parents must let us through."""
    place = tmp_path
    while place != place.parent and place.stat().st_uid == os.geteuid() and place.name:
        place.chmod(0o755)
        place = place.parent
    return tmp_path


def test_paths_that_cannot_be_read(folder):
    verdicts = dict(disk.reading(folder, AXIS))
    assert len(verdicts) >= 15
    assert {name: verdict.said for name, verdict in verdicts.items() if not verdict.right} == {}


def test_a_full_disk_leaves_the_old_file(folder):
    verdicts = dict(disk.full_disk(folder, AXIS))
    if not verdicts:
        pytest.skip("no small disk can be mounted here")
    assert {name: verdict.said for name, verdict in verdicts.items() if not verdict.right} == {}


def test_a_failed_write_names_the_file_and_leaves_nothing(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError, match="folder") as caught:
        write_text(tmp_path / "folder", "text")
    assert caught.value.filename == str(tmp_path / "folder")
    with pytest.raises(FileNotFoundError) as caught:
        write_text(tmp_path / "none" / "a.txt", "text")
    assert caught.value.filename == str(tmp_path / "none" / "a.txt")
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


@pytest.mark.parametrize("number", range(6))
def test_a_killed_run_leaves_whole_files(tmp_path, number):
    assert disk.killed(tmp_path, number).right

"""The pictures of pages that the README shows are there, said in words, and taken by a command."""

import re
from pathlib import Path

import pytest

from tests.live import webdriver
from tests.report import screenshots

ROOT = Path(__file__).parents[2]


def size(path):
    """Width and height of a PNG, by its header."""
    head = path.read_bytes()[:24]
    assert head.startswith(b"\x89PNG")
    return int.from_bytes(head[16:20]), int.from_bytes(head[20:24])


def test_the_readme_shows_what_the_command_takes():
    shown = dict(re.findall(r"\[([^\]]+)\]\(docs/pages/(\w+)\.png\)", (ROOT / "README.md").read_text(encoding="utf-8")))
    assert {*shown.values()} == {*screenshots.SIZES}
    shown.pop("on a telephone")  # a link
    assert all(len(said) > 40 for said in shown), "what a picture shows, for who does not see it"
    for name, expected in screenshots.SIZES.items():
        assert size(screenshots.PLACE / f"{name}.png") == expected


@pytest.mark.slow
@pytest.mark.skipif(webdriver.DRIVER is None, reason="there is no Chromium with its driver")
def test_the_command_takes_them(tmp_path):
    taken = {path.stem: path for path in screenshots.take(tmp_path)}
    assert {name: size(path) for name, path in taken.items()} == screenshots.SIZES
    for name, path in taken.items():  # a page that stays empty compresses to next to nothing
        assert path.stat().st_size > 0.5 * (screenshots.PLACE / f"{name}.png").stat().st_size

"""`jaxid design`: files to drive and to read, and one-line errors."""

import json

import pandas as pd

LIMITS = ("--limit", "4", "--seconds", "4", "--interval", "0.02", "--rounds", "1", "--radius", "1")


def test_a_design_is_written(jaxid, tmp_path):
    status, out, said = jaxid("design", "axis", *LIMITS, "--noise", "v=0.01", "--experiments", 2, "--out", tmp_path)
    assert status == 0, said
    assert out.startswith("Drive the axis")
    found = json.loads((tmp_path / "design.json").read_text())
    assert [run["file"] for run in found["runs"]] == ["experiment_1.csv", "experiment_2.csv"]
    assert set(found["parameters"]) == {"M", "Fv", "Fc", "offset"}
    assert all(0 < entry["std_error"] < float("inf") for entry in found["parameters"].values())
    for run in found["runs"]:
        table = pd.read_csv(tmp_path / run["file"])
        assert list(table) == ["t", "u"] and len(table) == 200 and table["u"].abs().max() <= 4
    page = (tmp_path / "report.html").read_text()
    assert (
        found["sentence"] in page and page.count('<figure class="chart"') == 2
    )  # what to drive and to expect, for each


def test_what_cannot_be_designed_is_one_line(jaxid, tmp_path):
    for extra, words in (
        ((), "The noise of v is not known"),
        (("--noise", "v"), "write for example --noise"),
        (("--noise", "v=0.01", "--radius", "0.0001"), "radius of 0.0001 m"),
        (("--noise", "v=0.01", "--floor", "3"), "give two"),
    ):
        status, out, said = jaxid("design", "axis", *LIMITS, *extra, "--out", tmp_path)
        assert (status, out) == (1, "") and words in said, said
        assert "Traceback" not in said
    assert not list(tmp_path.glob("experiment*"))

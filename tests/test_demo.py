"""jaxid/demo.py and `jaxid demo`: the truth is recovered and the papers' tables come out."""

import json
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from jaxid import demo as demonstration
from jaxid import noise_level, read_logs
from jaxid.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What `jaxid demo` leaves behind, run once without a cache of compiled programs."""
    out = tmp_path_factory.mktemp("demo")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jaxid.cli.demo.keep_compiled_programs", lambda: None)
        with pytest.raises(SystemExit) as end:
            main(["demo", "--out", str(out)])
    assert not end.value.code
    return out


@pytest.mark.parametrize("name", demonstration.ROBOTS)
def test_output_error_recovers_the_truth_from_far_starts(folder, name):
    document = json.loads((folder / name / "fit.json").read_text())
    truth = demonstration.truth(name)
    found = document["methods"]["output_error"]
    free = {n: e for n, e in found["parameters"].items() if e["status"] != "fixed"}
    assert len(free) == len(demonstration.case(name).robot.parameters.free_names)
    for parameter, entry in free.items():
        assert entry["status"] == "identified"
        assert abs(entry["value"] - truth[parameter]) < 4 * entry["std_error"], parameter
    assert found["converged"] and 0.9 < found["check"]["normalised_rms"] < 1.1
    assert set(found["combinations"]) == ({"1/a11", "1/a22"} if name == "pioneer" else set())
    assert list((folder / name).glob("*.png")) and (folder / name / "report.html").exists()


def test_the_saved_pioneer_predicts_as_well_as_its_fit_says(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("jaxid.cli.simulate.keep_compiled_programs", lambda: None)
    paths = sorted(demonstration.folder("pioneer").glob("check_*.csv"))
    noise = noise_level(read_logs(paths, "pioneer"))
    scaled = []
    for path in paths:
        out = tmp_path / path.name
        model = folder / "pioneer" / "model.toml"
        with pytest.raises(SystemExit) as end:
            main(["simulate", "pioneer", "--log", str(path), "--model", str(model), "--out", str(out)])
        assert not end.value.code
        predicted, measured = pd.read_csv(out), pd.read_csv(path)
        assert list(predicted) == ["t", "V2", "V3", "eta1", "eta2"]
        scaled += [(predicted[channel] - measured[channel]) / noise[channel] for channel in ("eta1", "eta2")]
    document = json.loads((folder / "pioneer" / "fit.json").read_text())
    rms = math.sqrt(np.mean(np.square(np.concatenate(scaled))))
    assert rms == pytest.approx(document["methods"]["output_error"]["check"]["normalised_rms"], rel=1e-6)


def test_pioneer_tables():
    third, fourth, fifth = demonstration.pioneer_tables()
    truth = demonstration.truth("pioneer")
    # 1/a11 of equation 34 from the truth, and the frictions.
    inertia = (
        truth["M"] + 2 * truth["m"] + truth["m1"] + truth["Ir1"] / truth["R1"] ** 2 + 2 * truth["Ir"] / truth["R"] ** 2
    )

    def mean(table, column):
        return float(dict(zip(table.column("Exp."), table.column(column), strict=True))["Mean"].split(" ")[0])

    for column, true in (("1/a11 [kg]", inertia), ("Cv [N m s]", truth["Cv"]), ("Cs [N m]", truth["Cs"])):
        assert mean(third, column) == pytest.approx(true, rel=0.01)
    assert mean(fourth, "1/a22 [kg m^2]") == pytest.approx(0.42418, rel=0.03)
    assert any("centre of mass pulls it backwards" in note for note in fourth.notes)
    assert dict(zip(fifth.column("Symbol"), fifth.column("Paper"), strict=True))["Cs"] == 0.3184


def test_omni_tables():
    tables = {table.title: table for table in demonstration.omni_paper_tables()}
    assert len(tables) == 10
    truth = demonstration.truth("omni_paper")
    (frictions,) = [table for title, table in tables.items() if "method 1" in title]
    rows: Any = frictions.rows
    assert {row[0] for row in rows} == {"Bv", "Cv", "Bvn", "Cvn", "Bw", "Cw"}
    for name, value, std_error, *_ in rows:
        assert abs(value - truth[name]) < 4 * std_error

"""`jaxid change`: two sets of files, the answer on stdout, change.json, and errors of one line."""

import json

import numpy as np
import pandas as pd
import pytest

FRICTION, NOISE, DT = 1.5, 0.005, 0.02


@pytest.fixture(autouse=True)
def no_cache_of_its_own(monkeypatch):
    """The tests share one cache of compiled programs."""
    monkeypatch.setattr("jaxid.cli.change.keep_compiled_programs", lambda: None)


def axis_log(path, mass, seed):
    """A driven axis without dry friction, exact for each held input, with white noise on the speed."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-4.0, 4.0, 15), 20)
    decay, v = np.exp(-FRICTION / mass * DT), np.zeros(len(u))
    for k in range(len(u) - 1):
        v[k + 1] = decay * v[k] + (1 - decay) * u[k] / FRICTION
    table = {"t": np.arange(len(u)) * DT, "u": u, "v": v + rng.normal(0.0, NOISE, len(v))}
    pd.DataFrame(table).to_csv(path, index=False)


def test_a_load_is_named_and_written(jaxid, tmp_path):
    known = tmp_path / "known.toml"
    known.write_text("[parameters.offset]\nvalue = 0\nfree = false\n[parameters.Fc]\nvalue = 0\nfree = false\n")
    for k in range(2):
        axis_log(tmp_path / f"a{k}.csv", 1.0, k)
        axis_log(tmp_path / f"b{k}.csv", 1.3, 10 + k)
    sets = ("--before", tmp_path / "a0.csv", tmp_path / "a1.csv", "--after", tmp_path / "b*.csv")
    out = tmp_path / "new"
    code, said, remarks = jaxid("change", "axis", *sets, "--model", known, "--out", out)
    assert code == 0, remarks
    assert said.startswith("Changed: moving mass (inertia) (M): M +0.") and "Traceback" not in remarks
    document = json.loads((out / "change.json").read_text())
    low, high = document["change"]["parameters"]["M"]["difference"]["ci95"]
    page = (out / "report.html").read_text()
    assert "jaxid change: axis" in page and "Moving mass" in page and "Each set on its own" in page
    assert document["verdict"] == "named" and low - 0.01 < 0.3 < high + 0.01 and high - low < 0.1

    code, _, remarks = jaxid("change", "axis", *sets, "--held-out-after", tmp_path / "b0.csv")
    assert code == 1 and remarks.count("\n") == 1 and "of one set only" in remarks
    assert jaxid("change", "axis", "--before", tmp_path / "a0.csv")[0] == 2

"""`jaxid explain`: files, exit statuses and error lines, on short logs of an axis with a known drag."""

import json

import numpy as np
import pandas as pd
import pytest

from jaxid import Omni, demo, noise_level, read_logs
from jaxid.cli.arguments import UnusableInput
from jaxid.cli.explain import without_coupling
from jaxid.effects import effect_by_id


@pytest.fixture(autouse=True)
def no_cache_of_its_own(monkeypatch):
    """The tests share one cache of compiled programs."""
    for command in ("explain", "fit", "simulate"):
        monkeypatch.setattr(f"jaxid.cli.{command}.keep_compiled_programs", lambda: None)


def test_from_logs_to_a_model_with_its_effect(jaxid, hidden_drag, explained, tmp_path):
    out = tmp_path / "new" / "out"
    fit, held_out = sorted(hidden_drag.glob("fit_*.csv")), sorted(hidden_drag.glob("check_*.csv"))
    code, said, remarks = jaxid("explain", "axis", "--fit", *fit, "--held-out", *held_out, "--out", out)
    assert code == 0, remarks
    assert said.startswith("Missing was quadratic drag") and "Traceback" not in remarks
    assert max(map(len, said.splitlines())) <= 100
    # The same as in a notebook, and every file that is promised.
    document = json.loads((out / "explanation.json").read_text())
    assert document["verdict"] == "named" and [e["id"] for e in document["effects"]] == ["quadratic_drag"]
    assert document["gap"]["before"] == pytest.approx(explained.before.normalised_rms, rel=1e-6)
    assert document["gap"]["after"] == pytest.approx(explained.after.normalised_rms, rel=1e-6)
    fits = json.loads((out / "fit.json").read_text())["methods"]
    assert set(fits) == {"integral_least_squares", "output_error"}
    assert fits["output_error"]["parameters"]["Fv"]["value"] == pytest.approx(explained.baseline["Fv"].value, rel=1e-6)
    # One noise and one judge in both files.
    assert fits["output_error"]["check"]["normalised_rms"] == pytest.approx(document["gap"]["before"], rel=1e-9)
    page = (out / "report.html").read_text()
    assert page.startswith("<!doctype html>") and page.rstrip().endswith("</html>") and "quadratic drag" in page
    assert {"ranking.png", "before_after.png", "localisation.png"} <= {path.name for path in out.glob("*.png")}
    assert not list(out.glob(".*"))

    # The model predicts the held-out logs as well as the explanation says it does.
    noise = noise_level(read_logs(held_out, "axis"))["v"]
    errors = []
    for path in held_out:
        predicted = tmp_path / path.name
        argv = ("simulate", "axis", "--log", path, "--model", out / "model.toml", "--out", predicted)
        assert jaxid(*argv)[0] == 0
        errors.append(pd.read_csv(predicted)["v"] - pd.read_csv(path)["v"])
    rms = float(np.sqrt(np.mean(np.concatenate(errors) ** 2))) / noise
    assert rms == pytest.approx(document["gap"]["after"], rel=1e-6)

    # And it can be fitted again.
    code, said, remarks = jaxid(
        "fit", "axis", "--fit", *fit, "--model", out / "model.toml", "--out", tmp_path / "again"
    )
    assert code == 0, remarks
    again = json.loads((tmp_path / "again" / "fit.json").read_text())["methods"]["output_error"]["parameters"]
    drag = again["quadratic_drag.coefficient"]
    assert drag["status"] == "identified" and abs(drag["value"] - 1.5) < 4 * drag["std_error"]


def spoiled(folder, to):
    """Its logs with the speed 1 m/s off at a sample in fifty, as where a radio link drops bits."""
    to.mkdir()
    for seed, path in enumerate(sorted(folder.glob("*.csv"))):
        table, rng = pd.read_csv(path), np.random.default_rng(seed)
        at = rng.choice(len(table), len(table) // 50, replace=False)
        table.loc[at, "v"] += rng.choice([-1.0, 1.0], len(at))
        table.to_csv(to / path.name, index=False)
    return to


@pytest.mark.slow
def test_a_robust_loss_finds_what_is_missing_among_outliers(jaxid, hidden_drag, tmp_path):
    logs, out = spoiled(hidden_drag, tmp_path / "logs"), tmp_path / "out"
    files = ("--fit", *sorted(logs.glob("fit_*.csv")), "--held-out", *sorted(logs.glob("check_*.csv")))
    options = ("--loss", "cauchy", "--covariance", "robust", "--intersample", "hold", "--windows", "none")
    code, said, remarks = jaxid("explain", "axis", *files, *options, "--out", out)
    assert code == 0, remarks
    assert said.startswith("Missing was quadratic drag")
    document = json.loads((out / "explanation.json").read_text())
    assert [e["id"] for e in document["effects"]] == ["quadratic_drag"] and document["gap"]["after"] < 1.1
    drag = document["effects"][0]["parameters"]["coefficient"]
    assert abs(drag["value"] - 1.5) < 4 * drag["std_error"] < 0.6
    assert "jump away from their neighbours" in remarks and "20 of the held-out" in remarks
    assert json.loads((out / "fit.json").read_text())["methods"]["output_error"]["standard_errors"] == "robust"


LOOP = """
from jaxid import Controller

def law(reference, measured, state, p):
    error = reference["wanted"] - measured["v"]
    total = state["total"] + error * 0.02
    return {"u": 8.0 * error + 6.0 * total}, {"total": total}

pi = Controller(law, ("wanted",), ("total",))
"""


def loop_log(path, seed, mass=1.3, viscous=2.0, drag=1.5):
    """An axis with quadratic drag under a digital PI law: 40 explicit steps of its own equation in each sample."""
    rng, v, total, rows = np.random.default_rng(seed), 0.0, 0.0, []
    wanted = np.repeat(rng.uniform(-2.0, 2.0, 12), 25)
    for k in range(len(wanted)):
        seen = v + rng.normal(0.0, 0.01)
        total += (wanted[k] - seen) * 0.02
        u = 8.0 * (wanted[k] - seen) + 6.0 * total
        rows.append((0.02 * k, u, seen, wanted[k]))
        for _ in range(40):
            v += 0.0005 * (u - viscous * v - drag * v * abs(v)) / mass
    pd.DataFrame(rows, columns=["t", "u", "v", "wanted"]).to_csv(path, index=False)


@pytest.mark.slow
def test_what_is_missing_in_a_closed_loop(jaxid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "laws_of_a_test.py").write_text(LOOP)
    model = tmp_path / "model.toml"
    model.write_text("[parameters.offset]\nvalue = 0\nfree = false\n[parameters.Fc]\nvalue = 0\nfree = false\n")
    for seed, name in enumerate(("a", "b", "held")):
        loop_log(tmp_path / f"{name}.csv", seed)
    files = ("--fit", "a.csv", "b.csv", "--held-out", "held.csv", "--model", model, "--out", tmp_path / "out")
    code, said, remarks = jaxid("explain", "axis", *files, "--controller", "laws_of_a_test:pi")
    assert code == 0, remarks
    assert said.startswith("Missing was quadratic drag") and "the controller answers what is missing" in said
    assert "Not looked for in a closed loop: actuator dead zone" in said
    (named,) = json.loads((tmp_path / "out/explanation.json").read_text())["effects"]
    drag = named["parameters"]["coefficient"]
    assert abs(drag["value"] - 1.5) < 4 * drag["std_error"] < 0.3
    assert jaxid("explain", "axis", *files, "--controller", "laws_of_a_test:pi", "--intersample", "linear")[0] == 2


def test_options_are_those_of_fit(jaxid):
    """Every option of an estimate that `jaxid fit` takes and that means something to an explanation."""
    shown = {command: jaxid(command, "--help")[1] for command in ("fit", "explain")}
    for option in ("--loss", "--covariance", "--windows", "--controller", "--intersample"):
        assert option in shown["fit"] and option in shown["explain"]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--baseline", "uncoupled"), ("omni", "axis")),
        (("--baseline", "coupled"), ("coupled", "uncoupled")),
        (("--baseline",), ("--baseline",)),
    ],
)
def test_a_baseline_that_does_not_apply_is_status_2(jaxid, hidden_drag, tmp_path, more, words):
    logs = ("--fit", hidden_drag / "fit_crawl.csv", "--held-out", hidden_drag / "check_crawl.csv")
    code, said, remarks = jaxid("explain", "axis", *logs, "--out", tmp_path / "o", *more)
    assert code == 2 and not said and "Traceback" not in remarks
    assert all(word in remarks for word in words) and not (tmp_path / "o").exists()
    assert len(remarks.splitlines()) == 1 or len(more) == 1


def test_held_out_logs_and_a_robot_are_needed(jaxid, hidden_drag, tmp_path):
    logs = ("--fit", hidden_drag / "fit_crawl.csv")
    assert jaxid("explain", "axis", *logs, "--out", tmp_path / "o")[0] == 2
    assert jaxid("explain", "axes", *logs, "--held-out", *logs[1:], "--out", tmp_path / "o")[0] == 2


def test_unusable_input_is_one_line_and_status_1(jaxid, hidden_drag, tmp_path):
    fit, held_out = ("--fit", hidden_drag / "fit_crawl.csv"), ("--held-out", hidden_drag / "check_crawl.csv")
    model = tmp_path / "model.toml"
    model.write_text('[[effects]]\nid = "quadratic_dragg"\n')
    for argv, words in (
        ((*fit, "--held-out", tmp_path / "absent.csv"), ("absent.csv",)),
        (("--fit", tmp_path / "none_*.csv", *held_out), ("none_*.csv",)),
        ((*fit, *held_out, "--model", model), ("model.toml", "quadratic_drag")),
    ):
        code, said, remarks = jaxid("explain", "axis", *argv, "--out", tmp_path / "o")
        assert code == 1 and not said, remarks
        (line,) = remarks.splitlines()
        assert line.startswith("jaxid: ") and all(word in line for word in words)


def test_the_uncoupled_baseline_lacks_the_turning_frames_terms(jaxid, tmp_path, monkeypatch):
    robot = without_coupling(Omni())
    assert robot.parameters["coriolis"].value == 0.0 and not robot.parameters["coriolis"].free
    with pytest.raises(UnusableInput, match="coriolis_coupling"):
        without_coupling(robot + effect_by_id(robot, "coriolis_coupling"))
    started = []

    def stop(robot, logs, *more):
        started.append(robot)
        raise UnusableInput("Enough.")

    monkeypatch.setattr("jaxid.cli.explain.estimated", stop)
    for more in ((), ("--baseline", "uncoupled")):
        paths = sorted(demo.folder("omni").glob("check_*.csv"))
        argv = ("explain", "omni", "--fit", paths[0], "--held-out", paths[1], "--out", tmp_path, *more)
        assert jaxid(*argv)[0] == 1
    assert [robot.parameters["coriolis"].value for robot in started] == [1.0, 0.0]


def test_a_search_that_is_stopped_can_go_again_until_somebody_edits_its_model(
    jaxid, hidden_drag, tmp_path, monkeypatch
):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("jaxid.cli.explain.explain", stopped)
    out, held_out = tmp_path / "out", hidden_drag / "check_crawl.csv"
    argv = ("explain", "axis", "--fit", *sorted(hidden_drag.glob("fit_*.csv")), "--held-out", held_out, "--out", out)
    for _ in range(2):
        assert "has changed" not in jaxid(*argv)[2]
        assert (out / "model.toml").is_file()
    (out / "model.toml").write_text((out / "model.toml").read_text() + "# weighed\n")
    status, _, remarks = jaxid(*argv)
    assert status == 1 and "model.toml has changed" in remarks


def test_help_names_the_command(jaxid):
    assert "explain" in jaxid("--help")[1]

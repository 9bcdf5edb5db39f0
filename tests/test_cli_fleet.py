"""jaxid fleet: many robots from one folder; tables that hold every member, and one bad member that touches no other."""

import re
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jaxid import Axis, output_error, read_logs
from jaxid.cli import fleet as command
from jaxid.cli.findings import in_short
from jaxid.cli.fleet_work import why_doubted, with_findings
from jaxid.logs.finding import Finding
from tests.recordings import Ros, ns

MASSES = {"a": 1.0, "b": 2.0, "c": 4.0}
FRICTION, NOISE, DT = 1.5, 0.005, 0.02


def axis_log(path, mass, seed):
    """A driven axis without dry friction, exact for each held input, with white noise on the speed."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-4.0, 4.0, 15), 20)
    decay, v = np.exp(-FRICTION / mass * DT), np.zeros(len(u))
    for k in range(len(u) - 1):
        v[k + 1] = decay * v[k] + (1 - decay) * u[k] / FRICTION
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame({"t": np.arange(len(u)) * DT, "u": u, "v": v + rng.normal(0.0, NOISE, len(v))}).to_csv(
        path, index=False
    )


@pytest.fixture
def without_dry_friction(tmp_path):
    path = tmp_path / "known.toml"
    path.write_text("[parameters.offset]\nvalue = 0\nfree = false\n[parameters.Fc]\nvalue = 0\nfree = false\n")
    return path


@pytest.fixture
def robots(tmp_path):
    folder = tmp_path / "robots"
    for k, (name, mass) in enumerate(MASSES.items()):
        for seed in (0, 1):
            axis_log(folder / name / f"run_{seed}.csv", mass, 10 * k + seed)
    (folder / "broken").mkdir()
    (folder / "broken/run.csv").write_text("t,u,v\n0,1\n")
    (folder / "notes").mkdir()
    (folder / "notes/readme.txt").write_text("no logs here")
    return folder


def test_every_member_has_its_own_fit_and_a_broken_one_is_named(
    jaxid, robots, without_dry_friction, tmp_path, monkeypatch
):
    monkeypatch.setattr(command, "PART", 3)  # two batches
    out = tmp_path / "out"
    status, said, remarks = jaxid(
        "fleet",
        "axis",
        robots,
        "--model",
        without_dry_friction,
        "--windows",
        "none",
        "--covariance",
        "robust",
        "--out",
        out,
    )
    assert status == 0, remarks
    members = pd.read_parquet(out / "members.parquet").set_index("member")
    assert list(members.index) == ["a", "b", "broken", "c"]
    assert set(members.loc[list(MASSES), "standard_errors"]) == {"robust"}
    assert "run.csv" in members.loc["broken", "failure"] and not members.loc["broken", "trustworthy"]
    assert (members.loc[list(MASSES), "logs"] == 2).all() and (members.loc[list(MASSES), "samples"] == 600).all()
    assert members.loc[list(MASSES), "trustworthy"].all() and (members.loc[list(MASSES), "failure"] == "").all()
    estimates = pd.read_parquet(out / "estimates.parquet").set_index(["member", "parameter"])
    for name, mass in MASSES.items():
        found = estimates.loc[(name, "M")]
        assert abs(found["value"] - mass) < 4 * found["std_error"] < 0.1 * mass
        assert found["low"] < found["value"] < found["high"] and found["status"] == "identified"
    assert "3 of 4 members fitted" in said and "broken" in said
    page = (out / "report.html").read_text()
    assert all(f">{name}</td>" in page for name in MASSES) and "no fit: " in page and "M [kg]" in page
    assert "linear estimates are there" in remarks and "members side by side" in remarks  # where it is
    assert np.median([*MASSES.values()]) == pytest.approx(float(said.split("M ")[1].split()[3]), rel=0.02)


def test_what_a_sound_members_logs_do_not_determine_and_what_to_do_about_a_doubtful_one_is_said(jaxid, tmp_path):
    """One that was driven one way only, whose offset and dry friction are one; one with the sign of a command changed."""
    masses = {"a": 1.0, "b": 1.1, "one way": 1.0}
    for k, (name, mass) in enumerate(masses.items()):
        axis_log(tmp_path / "logs" / f"{name}.csv", mass, k)
    one_way = tmp_path / "logs/one way.csv"
    u = 3.0 + np.repeat(np.random.default_rng(5).uniform(0.0, 1.0, 15), 20)
    decay, v = np.exp(-FRICTION * DT), np.zeros(len(u))
    for k in range(len(u) - 1):
        v[k + 1] = decay * v[k] + (1 - decay) * u[k] / FRICTION
    noise = NOISE * np.random.default_rng(6).normal(size=len(v))
    pd.DataFrame({"t": np.arange(len(u)) * DT, "u": u, "v": v + noise}).to_csv(one_way, index=False)
    wrong = pd.read_csv(tmp_path / "logs/b.csv")
    wrong.assign(v=-wrong["v"]).to_csv(tmp_path / "logs/b.csv", index=False)
    status, said, _ = jaxid("fleet", "axis", tmp_path / "logs", "--windows", "none", "--out", tmp_path / "out")
    said = " ".join(said.split())
    assert status == 0 and "the same command with --explain and --held-out" in said
    assert re.search(r"Not determined by a sound member's logs: one way \(.*offset", said), said


def test_a_folder_of_logs_is_a_member_a_log(jaxid, without_dry_friction, tmp_path):
    for name, mass in MASSES.items():
        axis_log(tmp_path / "logs" / f"{name}.csv", mass, 5)
    out = tmp_path / "out"
    status, _, remarks = jaxid("fleet", "axis", tmp_path / "logs", "--model", without_dry_friction, "--out", out)
    assert status == 0, remarks
    assert list(pd.read_parquet(out / "members.parquet")["member"]) == ["a", "b", "c"]


def test_a_robot_without_linear_estimates_is_not_said_to_have_them(jaxid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "encoder_cart_of_a_test.py").write_text(
        "import jaxid\n"
        "P = jaxid.Parameter\n"
        "cart = jaxid.Custom(\n"
        "    dynamics=lambda s, u, p: {'q': s['v'], 'v': (u['u'] - p['fv'] * s['v']) / p['mass']},\n"
        "    state_names=('q', 'v'), output=lambda s, u, p: {'way': s['q']},\n"
        "    own_channels=jaxid.Channels(inputs=('u',), outputs=('way',)),\n"
        "    table=jaxid.ParameterTable({'mass': P(1.5, 'kg', free=True, lower=0.1), 'fv': P(1.0, 'N s/m', free=True)}))\n"
    )
    for name, mass in MASSES.items():
        rng, t = np.random.default_rng(round(10 * mass)), 0.02 * np.arange(200)
        u = np.repeat(rng.uniform(-3, 3, 10), 20)
        v, q = np.zeros(200), np.zeros(200)
        for k in range(199):  # exact for a constant force
            end, keep = u[k], np.exp(-0.02 / mass)
            v[k + 1] = end + (v[k] - end) * keep
            q[k + 1] = q[k] + 0.02 * end + (v[k] - end) * mass * (1 - keep)
        (tmp_path / "robots").mkdir(exist_ok=True)
        table = pd.DataFrame({"t": t, "u": u, "way": q + 1e-3 * rng.normal(size=200)})
        table.to_csv(tmp_path / "robots" / f"{name}.csv", index=False)
    status, _, remarks = jaxid("fleet", "encoder_cart_of_a_test:cart", tmp_path / "robots", "--out", tmp_path / "out")
    assert status == 0 and "members side by side" in remarks and "linear estimates" not in remarks, remarks


def test_folders_that_hold_no_fleet_are_named_with_the_remedy(jaxid, robots, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    axis_log(robots / "loose.csv", 1.0, 3)
    for folder, words in ((empty, "holds no logs"), (robots, "loose.csv"), (tmp_path / "nowhere", "no folder")):
        status, _, remarks = jaxid("fleet", "axis", folder, "--out", tmp_path / "out")
        assert status == 1 and str(folder) in remarks and words in remarks


def test_a_column_of_the_wrong_sign_is_said_of_its_member(jaxid, robots, without_dry_friction, tmp_path):
    wrong = robots / "b/run_1.csv"
    table = pd.read_csv(wrong)
    table.assign(v=-table["v"]).to_csv(wrong, index=False)
    out = tmp_path / "out"
    status, said, _ = jaxid(
        "fleet", "axis", robots, "--model", without_dry_friction, "--windows", "none", "--covariance", "robust",
        "--out", out,
    )  # fmt: skip
    assert status == 0
    members = pd.read_parquet(out / "members.parquet").set_index("member")
    assert not members.trustworthy["b"] and members.trustworthy["a"]
    assert "opposite sign" in members.notes["b"] and "opposite sign" not in members.notes["a"]
    assert "opposite sign" in " ".join(said.split())


def test_a_log_that_cannot_be_read_is_left_out_and_named(jaxid, robots, without_dry_friction, tmp_path):
    (robots / "a/cut.csv").write_text("t,u\n0,1\n0.1,1\n")
    (robots / "a/empty.csv").write_text("")
    out = tmp_path / "out"
    status, said, remarks = jaxid(
        "fleet", "axis", robots, "--model", without_dry_friction, "--windows", "none", "--covariance", "robust",
        "--out", out,
    )  # fmt: skip
    assert status == 0, remarks
    members = pd.read_parquet(out / "members.parquet").set_index("member")
    assert members.failure["a"] == "" and members.logs["a"] == 2 and "3 of 4 members fitted" in said
    for name, why in (("cut.csv", "'v'"), ("empty.csv", "empty")):
        assert "left out" in members.notes["a"] and name in members.notes["a"] and why in members.notes["a"]
    said = " ".join(said.split())
    assert "Sound, with something to look at in the logs: a." in said and "a: warning: left out:" in said
    assert "left out" not in members.notes["b"] and "run.csv" in members.failure["broken"]


def test_a_member_whose_held_out_logs_cannot_be_read_is_fitted_and_says_why_it_is_not_explained(
    jaxid, without_dry_friction, tmp_path
):
    axis_log(tmp_path / "robots/a/run.csv", 1.0, 1)
    (tmp_path / "robots/a/check.csv").write_text("t,u\n0,1\n0.1,1\n")
    (tmp_path / "robots/a/cut.csv").write_text("")
    out = tmp_path / "out"
    status, said, remarks = jaxid(
        "fleet", "axis", tmp_path / "robots", "--model", without_dry_friction, "--windows", "none", "--explain",
        "--held-out", "check*", "--out", out,
    )  # fmt: skip
    assert status == 0, remarks
    assert "a: no explanation: No held-out log can be used" in " ".join(said.split())
    members = pd.read_parquet(out / "members.parquet").set_index("member")
    assert members.failure["a"] == "" and "cut.csv" in members.notes["a"] and "check.csv" in members.notes["a"]
    why = pd.read_parquet(out / "explanations.parquet").set_index("member").failure["a"]
    assert "No held-out log can be used" in why and "check.csv" in why and "cut.csv" not in why


def test_what_is_wrong_with_a_held_out_log_is_said_too(tmp_path):
    """A speed of the other sign in the log that judges."""
    for seed, name in enumerate(("run", "check")):
        axis_log(tmp_path / f"{name}.csv", 1.0, seed)
    wrong = tmp_path / "check.csv"
    table = pd.read_csv(wrong)
    table.assign(v=-table["v"]).to_csv(wrong, index=False)
    run, check = (read_logs(tmp_path / f"{name}.csv", "axis") for name in ("run", "check"))
    fit = output_error(Axis(), run)
    (said,) = [note for note in with_findings(fit, run, check, ()).notes if "opposite sign" in note]
    assert "check" in said and with_findings(fit, run, run, ()).notes == fit.notes


def test_a_doubted_member_says_why_once_and_what_to_do(tmp_path):
    """Of speeds that are differences of counts, the fleet's table advised `--loss cauchy` and never the mapping that helps,
    beside a line for every column of every log."""
    axis_log(tmp_path / "run.csv", 1.0, 1)
    run = read_logs(tmp_path / "run.csv", "axis")
    fit = output_error(Axis(), run)
    found = [
        Finding(f"run{k}.csv", column, None, "warning", "coarse", f"run{k}.csv, column {column!r}: is coarse.")
        for k in range(2)
        for column in ("u", "v")
    ]
    remarks = in_short([*found, Finding("run0.csv", "v", None, "error", "sign_flipped", "has the opposite sign.")])
    assert len(remarks) == 2 and remarks[0].count("is coarse") == 1 and remarks[0].endswith("(3 more such.)")
    assert fit.trustworthy and "--map" not in why_doubted(replace(fit, notes=("Try --map.",)), remarks)
    doubted = replace(fit, judgement=fit.judgement.doubted("It lacks something."), notes=("Try --map.",))
    why = why_doubted(doubted, remarks)
    assert all(part in why for part in (*remarks, "It lacks something.", "Try --map."))


def test_a_member_far_from_the_others_is_pointed_out(jaxid, without_dry_friction, tmp_path):
    masses = {"a": 1.0, "b": 1.02, "c": 0.98, "d": 1.01, "e": 1.0, "f": 0.99, "heavy": 1.6}
    for k, (name, mass) in enumerate(masses.items()):
        axis_log(tmp_path / "logs" / f"{name}.csv", mass, k)
    out = tmp_path / "out"
    status, said, remarks = jaxid("fleet", "axis", tmp_path / "logs", "--model", without_dry_friction, "--out", out)
    assert status == 0, remarks
    said = " ".join(said.split())
    assert "Far from the others: heavy." in said and "heavy is far from the others in M: 1.6" in said
    page = (out / "report.html").read_text()
    assert "heavy is far from the others in M" in page and page.count(" far<small>") == 1
    far = pd.read_parquet(out / "estimates.parquet").set_index(["member", "parameter"])["far"]
    assert far[("heavy", "M")] > 5 and (far.drop(("heavy", "M")) == 0).all()


def fleet_of(folder, count):
    for k in range(count):
        axis_log(folder / f"robot {k}" / "run.csv", 1.0 + 0.1 * k, k)
    return folder


def tables(out):
    return [pd.read_parquet(out / f"{name}.parquet") for name in ("members", "estimates")]


def same(one, other):
    for a, b in zip(tables(one), tables(other), strict=True):
        pd.testing.assert_frame_equal(a, b, check_exact=True)


def test_what_is_done_is_not_done_again_until_its_logs_change(jaxid, without_dry_friction, tmp_path, monkeypatch):
    monkeypatch.setattr(command, "PART", 1)
    folder, out = fleet_of(tmp_path / "robots", 2), tmp_path / "out"
    argv = ("fleet", "axis", folder, "--model", without_dry_friction, "--windows", "none", "--out", out)
    assert jaxid(*argv)[0] == 0
    before, parts = tables(out), {path: path.stat().st_mtime_ns for path in (out / "parts").iterdir()}
    (out / "members.parquet").unlink()  # as after a run that was killed
    status, _, remarks = jaxid(*argv)
    assert status == 0 and "2 members are done already" in remarks
    assert {path: path.stat().st_mtime_ns for path in (out / "parts").iterdir()} == parts
    for one, other in zip(before, tables(out), strict=True):
        pd.testing.assert_frame_equal(one, other, check_exact=True)
    axis_log(folder / "robot 1" / "run.csv", 5.0, 1)
    status, _, remarks = jaxid(*argv)
    assert status == 0 and "1 members are done already" in remarks
    masses = tables(out)[1].set_index(["member", "parameter"])["value"]
    assert masses[("robot 0", "M")] == before[1].set_index(["member", "parameter"])["value"][("robot 0", "M")]
    assert masses[("robot 1", "M")] == pytest.approx(5.0, rel=0.05)
    assert len(list((out / "parts").iterdir())) == 2
    assert "done already" not in jaxid(*argv, "--loss", "huber")[2]


def test_a_fleet_is_explained_on_the_logs_held_out(jaxid, hidden_drag, explained, tmp_path):
    folder, out = tmp_path / "robots", tmp_path / "out"
    folder.mkdir()
    (folder / "one").symlink_to(hidden_drag)
    axis_log(folder / "two" / "fit_only.csv", 1.0, 0)
    status, said, remarks = jaxid("fleet", "axis", folder, "--explain", "--held-out", "check_*", "--out", out)
    assert status == 0, remarks
    found = pd.read_parquet(out / "explanations.parquet").set_index("member")
    assert found.verdict["one"] == "named" and found.effects["one"] == "quadratic_drag"
    assert found.after["one"] == pytest.approx(explained.after.normalised_rms, rel=1e-9)
    assert "no log held out" in found.failure["two"]
    drag = pd.read_parquet(out / "effects.parquet").set_index(["member", "parameter"]).loc[("one", "coefficient")]
    assert abs(drag["value"] - 1.5) < 4 * drag["std_error"]
    # The robot's own numbers are those beside the drag, without which friction took it up.
    own = pd.read_parquet(out / "estimates.parquet").set_index(["member", "parameter"]).loc["one"]
    final = explained.final
    assert set(own.index) >= {name for name in final.free_names if not name.startswith("quadratic_drag")} and not [
        name for name in own.index if name.startswith("quadratic_drag")
    ]
    assert own.value["M"] == pytest.approx(final["M"].value, rel=1e-9)
    members = pd.read_parquet(out / "members.parquet").set_index("member")
    assert members.verdict["one"] == final.judgement.verdict
    assert "Missing: quadratic drag in 1." in said and "named: quadratic drag" in (out / "report.html").read_text()
    assert jaxid("fleet", "axis", folder, "--explain", "--out", out)[0] == 2


def test_processes_and_a_scheduler_exclude_each_other_and_one_that_is_not_there_is_said(jaxid, tmp_path):
    folder = fleet_of(tmp_path / "robots", 1)
    argv = ("fleet", "axis", folder, "--out", tmp_path / "out", "--scheduler", "nonsense://here")
    assert jaxid(*argv, "--workers", "2")[0] == 2
    pytest.importorskip("distributed")
    status, _, remarks = jaxid(*argv)
    assert status == 1 and "no scheduler at nonsense://here" in remarks


@pytest.mark.slow
def test_a_run_of_workers_that_is_killed_goes_on(jaxid, without_dry_friction, tmp_path):
    """First a worker dies, then the program itself: the tables are those of a run in one process."""
    pytest.importorskip("distributed")
    psutil = pytest.importorskip("psutil")
    folder, alone, out = fleet_of(tmp_path / "robots", 8), tmp_path / "alone", tmp_path / "out"
    argv = ["fleet", "axis", str(folder), "--model", str(without_dry_friction), "--windows", "none", "--out"]
    assert jaxid(*argv, alone)[0] == 0
    code = "import sys; from jaxid.cli import fleet, main; fleet.PART = 1; main(sys.argv[1:])"
    run = [sys.executable, "-c", code, *argv, str(out), "--workers", "2"]

    def parts():
        return len(list((out / "parts").glob("[!.]*.parquet")))

    def until(condition):
        limit = time.monotonic() + 240
        while not condition():
            assert time.monotonic() < limit and process.poll() is None
            time.sleep(0.02)

    process = subprocess.Popen(run, stderr=subprocess.DEVNULL)
    until(lambda: parts() >= 1)
    children = psutil.Process(process.pid).children(recursive=True)
    worker = next(child for child in children if "spawn_main" in " ".join(child.cmdline()))
    worker.kill()
    until(lambda: parts() >= 3)
    process.kill()
    process.wait()
    done = parts()
    psutil.wait_procs(children, timeout=60)
    assert 3 <= done < 8 and not any(child.is_running() for child in children)
    again = subprocess.run(run, capture_output=True, text=True, check=True)
    assert f"{done} members are done already" in again.stderr
    same(alone, out)


def bag(folder, mass, seed, storage):
    """The run of `axis_log` as a ROS 2 bag: joint effort and velocity, in the header's time."""
    ros = Ros()
    axis_log(folder.with_suffix(".csv"), mass, seed)
    frame = pd.read_csv(folder.with_suffix(".csv"))
    folder.with_suffix(".csv").unlink()
    rows = zip(frame["t"], frame["u"], frame["v"], strict=True)
    joints = [(ns(t), ros.joints(ns(t), ["hub"], [v], effort=[u])) for t, u, v in rows]
    ros.write(folder, {"/joints": joints}, storage)


def test_fleets_of_bags(jaxid, without_dry_friction, tmp_path):
    """A member's bags as folders in its folder, a member's folder that is a bag, and one without any, which is said."""
    pytest.importorskip("rosbags", reason="bags are written and read by rosbags")
    robots, mapping = tmp_path / "robots", tmp_path / "map.toml"
    mapping.write_text('u = "/joints.effort[hub]"\nv = "/joints.velocity[hub]"\n')
    for seed in (0, 1):
        bag(robots / "a" / f"run_{seed}", MASSES["a"], seed, "mcap")
    bag(robots / "b" / "run_0", MASSES["b"], 10, "sqlite3")
    (robots / "d").mkdir()
    (robots / "d/readme.txt").write_text("no logs here")
    arguments = (
        "fleet",
        "axis",
        robots,
        "--map",
        mapping,
        "--model",
        without_dry_friction,
        "--windows",
        "none",
        "--out",
    )
    status, _, remarks = jaxid(*arguments, tmp_path / "out")
    assert status == 0 and "there is no log in it: d" in remarks
    estimates = pd.read_parquet(tmp_path / "out/estimates.parquet").query("parameter == 'M'").set_index("member")
    assert list(estimates.index) == ["a", "b"]
    for name, row in estimates.iterrows():
        assert abs(row["value"] - MASSES[name]) < 4 * row["std_error"] < 0.2
    # Every bag of one folder is a member of its own where no folder holds several.
    status, said, _ = jaxid(*arguments[:2], robots / "a", *arguments[3:], tmp_path / "alone")
    assert status == 0 and "2 of 2 members fitted" in said


@pytest.mark.slow
def test_a_member_that_never_moved_has_no_fit_and_one_without_commands_no_traceback(
    jaxid, robots, without_dry_friction, tmp_path
):
    """Pre-flight refuses the one, alone as in a fleet; the other drives, and none of its commands was logged."""
    for run in sorted((robots / "b").iterdir()):
        table = pd.read_csv(run)
        still = NOISE * np.random.default_rng(len(run.name)).normal(size=len(table))
        for name, changed in (("still", table.assign(v=still)), ("silent", table.assign(u=0.0))):
            (robots / name).mkdir(exist_ok=True)
            changed.to_csv(robots / name / run.name, index=False)
    out = tmp_path / "out"
    held_out = ("--explain", "--held-out", "run_1*")
    status, _, remarks = jaxid("fleet", "axis", robots, "--model", without_dry_friction, *held_out, "--out", out)
    assert status == 0, remarks
    members = pd.read_parquet(out / "members.parquet").set_index("member")
    assert "did not move" in members.loc["still", "failure"] and not members.loc["still", "trustworthy"]
    assert not members.loc["silent", "trustworthy"]
    assert members.loc[list(MASSES), "trustworthy"].all()
    explained = pd.read_parquet(out / "explanations.parquet").set_index("member")
    assert set(explained.loc[list(MASSES), "verdict"]) == {"adequate"}
    assert (
        explained.loc["silent", "verdict"] == "unexplained" and "jaxid failed" not in explained.loc["silent", "failure"]
    )

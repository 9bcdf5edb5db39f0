"""jaxid/cli: outputs, exit statuses and error lines of the commands, run in this process on short logs."""

import importlib
import json
import runpy
import tomllib
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pandas as pd
import pytest

from jaxid import Axis, noise_level, read_logs
from jaxid.cli import main
from jaxid.cli.arguments import repeat_flags

STATUS = {"identified", "not_identifiable", "at_bound", "fixed"}
AXIS = {"M": 2.0, "Fv": 1.5, "Fc": 0.4}
NOISE = 0.005


@pytest.fixture(scope="module", autouse=True)
def compiled_programs(tmp_path_factory):
    """Compiled programs go to a folder of the tests, and JAX forgets about it afterwards."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patch.setenv("COLUMNS", "100")
        names = ("compilation_cache_dir", "persistent_cache_min_compile_time_secs")
        names = tuple(f"jax_{name}" for name in (*names, "persistent_cache_min_entry_size_bytes"))
        before = {name: getattr(jax.config, name) for name in names}
        yield
        for name, value in before.items():
            jax.config.update(name, value)


def axis_log(path: Path, seed: int, columns=("t", "u", "v")) -> Path:
    """A driven axis that always moves forwards, integrated exactly for each held input, with white noise on the speed."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(1.0, 4.0, 15), 20)
    dt, v = 0.02, np.zeros(len(u))
    decay = np.exp(-AXIS["Fv"] / AXIS["M"] * dt)
    for k in range(len(u) - 1):
        v[k + 1] = decay * v[k] + (1 - decay) * (u[k] - AXIS["Fc"]) / AXIS["Fv"]
    v += rng.normal(0.0, NOISE, len(v))
    pd.DataFrame(dict(zip(columns, (np.arange(len(u)) * dt, u, v), strict=True))).to_csv(path, index=False)
    return path


@pytest.fixture
def axis_logs(tmp_path):
    return [axis_log(tmp_path / f"axis_{seed}.csv", seed) for seed in (1, 2, 3)]


def known_offset(tmp_path):
    """A model file with a known offset: in logs that never turn round it cannot be told from Coulomb friction."""
    path = tmp_path / "known.toml"
    path.write_text("[parameters.offset]\nvalue = 0\nfree = false\n")
    return path


def within(entry, true, errors=4.0):
    return abs(entry["value"] - true) < errors * entry["std_error"]


def check_schema(document, robot, channels, checked):
    assert set(document) == {"robot", "methods"} and document["robot"] == robot
    assert list(document["methods"]) == ["integral_least_squares", "output_error"]
    for name, method in document["methods"].items():
        keys = {"judgement", "standard_errors", "parameters", "combinations", "check"}
        assert method["judgement"]["verdict"] in ("sound", "coloured", "poor", "failed")
        own = {"converged", "iterations", "logs", "clock_offsets", "outliers"} if name == "output_error" else set()
        assert set(method) - {"notes"} == keys | own
        for entry in (*method["parameters"].values(), *method["combinations"].values()):
            assert set(entry) == {"value", "std_error", "ci95", "unit", "status"}
            assert entry["status"] in STATUS and len(entry["ci95"]) == 2
            if entry["status"] == "identified":
                low, high = entry["ci95"]
                assert low < entry["value"] < high
            if entry["status"] == "fixed":
                assert entry["std_error"] is None and entry["ci95"] == [None, None]
        if checked:
            assert set(method["check"]) == {"normalised_rms", "fit_percent"}
            assert set(method["check"]["fit_percent"]) == set(channels)
        else:
            assert method["check"] is None


def test_flags_take_many_values():
    many = ("--fit", "--held-out")
    plain = ["fit", "axis", "--fit", "a", "--fit", "b", "--held-out", "c", "--out", "d"]
    for line in (
        "fit axis --fit a b --held-out c --out d",
        "fit axis --fit a --fit b --held-out c --out d",
        "fit axis --fit=a b --held-out=c --out d",
    ):
        joined = repeat_flags(line.split(), many)
        assert [part for argument in joined for part in argument.split("=")] == plain
    assert repeat_flags("fit --fit a -- axis b".split(), many) == "fit --fit a -- axis b".split()
    assert repeat_flags(["fit", "--fit", "--out", "d"], many) == ["fit", "--fit", "--out", "d"]


def test_from_fit_to_simulation(jaxid, axis_logs, tmp_path):
    out, predicted = tmp_path / "new" / "out", tmp_path / "predicted.csv"
    argv = (
        "fit",
        "axis",
        "--fit",
        *axis_logs[:2],
        "--held-out",
        axis_logs[2],
        "--model",
        known_offset(tmp_path),
        "--out",
        out,
    )
    code, said, remarks = jaxid(*argv)
    assert code == 0, remarks
    document = json.loads((out / "fit.json").read_text())
    check_schema(document, "axis", ("v",), True)
    found = document["methods"]["output_error"]
    assert found["converged"] and 0.8 < found["check"]["normalised_rms"] < 1.2
    for name, value in AXIS.items():
        assert found["parameters"][name]["status"] == "identified"
        assert within(found["parameters"][name], value)
    assert found["parameters"]["offset"]["status"] == "fixed" and found["parameters"]["offset"]["value"] == 0
    assert "Fc" in said and "output error" in said and "Traceback" not in remarks
    assert max(map(len, said.splitlines())) <= 100
    assert list(out.glob("*.png")) and "</html>" in (out / "report.html").read_text()
    assert not list(out.glob(".*"))

    # The saved model predicts the held-out log exactly as well as the fit says it does.
    code, _, remarks = jaxid(
        "simulate", "axis", "--log", axis_logs[2], "--model", out / "model.toml", "--out", predicted
    )
    assert code == 0, remarks
    table, log = pd.read_csv(predicted), read_logs(axis_logs[2], "axis")[0]
    assert list(table) == ["t", "u", "v", "q"]
    assert np.array_equal(table["t"], log.time) and np.array_equal(table["u"], log.input("u"))
    rms = float(np.sqrt(np.mean(((table["v"] - log.output("v")) / noise_level(log)["v"]) ** 2)))
    assert rms == pytest.approx(found["check"]["normalised_rms"], rel=1e-9)


def test_axis_without_check(jaxid, axis_logs, tmp_path):
    code, said, remarks = jaxid(
        "fit", "axis", "--fit", *axis_logs[:2], "--out", tmp_path / "out", "--model", known_offset(tmp_path)
    )
    assert code == 0, remarks
    document = json.loads((tmp_path / "out" / "fit.json").read_text())
    check_schema(document, "axis", ("v",), False)
    for method in document["methods"].values():
        assert all(within(method["parameters"][name], value) for name, value in AXIS.items())
    assert "--held-out" in said and not list((tmp_path / "out").glob("*.png"))
    assert (tmp_path / "out" / "report.html").exists()


def test_the_judgement_is_not_said_before_the_results_that_it_heads(monkeypatch, capsys, axis_logs):
    from jaxid.cli import fit as command
    from jaxid.estimate.judgement import Judgement
    from tests.report.test_comparison import fit_of

    judgement = Judgement("poor", 3.0, {"v": 3.0}, False, ("What is left follows the motion.",))
    found = replace(fit_of("output_error", Axis()), judgement=judgement, notes=(judgement.sentence, "Fc is flat."))
    monkeypatch.setattr(command, "output_error", lambda *given, **options: found)
    assert command.METHODS["output_error"](found.robot, read_logs(axis_logs, "axis"), None, {}) is found
    said = capsys.readouterr().err
    assert "Fc is flat." in said and "follows the motion" not in said


def test_other_column_names(jaxid, axis_logs, tmp_path):
    renamed = [axis_log(tmp_path / f"renamed_{seed}.csv", seed, ("time", "force", "speed")) for seed in (1, 2, 3)]
    (tmp_path / "map.toml").write_text('t = "time"\nu = "force"\nv = "speed"\n')
    for logs, more, out in ((axis_logs, (), "plain"), (renamed, ("--map", tmp_path / "map.toml"), "mapped")):
        argv = ("fit", "axis", "--fit", *logs[:2], "--model", known_offset(tmp_path), *more)
        assert jaxid(*argv, "--out", tmp_path / out)[0] == 0
    plain, mapped = ((tmp_path / out / "fit.json").read_text() for out in ("plain", "mapped"))
    assert json.loads(plain) == json.loads(mapped.replace("renamed_", "axis_"))


OWN = """
from jaxid import Channels, Custom, Parameter

def cart(name="cart"):
    return Custom(
        dynamics=lambda x, u, p: {"v": (u["u"] - p["Fv"] * x["v"] - p["Fc"]) / p["M"]},
        state_names=("v",),
        own_channels=Channels(("u",), ("v",), units={"t": "s", "u": "N", "v": "m/s"}),
        table={n: Parameter(1.0, unit, free=True, lower=0.0) for n, unit in (("M", "kg"), ("Fv", "N s/m"), ("Fc", "N"))},
        title=name,
    )

ready = cart("ready cart")
number = 3

def fails():
    raise TypeError("no such gear")

def needs(mass):
    return cart()
"""


@pytest.mark.parametrize(("attribute", "name"), [("cart", "cart"), ("ready", "ready cart")])
def test_own_robot(jaxid, axis_logs, tmp_path, monkeypatch, attribute, name):
    (tmp_path / "own_robots.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    code, _, remarks = jaxid("fit", f"own_robots:{attribute}", "--fit", "axis_*.csv", "--out", "out")
    assert code == 0, remarks
    document = json.loads(Path("out/fit.json").read_text())
    assert document["robot"] == name
    assert all(within(document["methods"]["output_error"]["parameters"][n], v) for n, v in AXIS.items())
    argv = ("simulate", f"own_robots:{attribute}", "--log", "axis_1.csv", "--model", "out/model.toml", "--out", "p.csv")
    assert jaxid(*argv)[0] == 0
    error = pd.read_csv("p.csv")["v"].to_numpy() - pd.read_csv("axis_1.csv")["v"].to_numpy()
    assert np.std(error) == pytest.approx(NOISE, rel=0.2)


TOPPLES = """from jaxid import Channels, Custom, Parameter, ParameterTable
leaning = Custom(
    dynamics=lambda s, u, p: {"angle": p["a"] * s["angle"] + u["push"]},
    state_names=("angle",),
    own_channels=Channels(("push",), ("angle",), units={"push": "rad/s", "angle": "rad"}),
    table=ParameterTable({"a": Parameter(3.0, "1/s", free=True)}),
)
"""


def test_a_free_simulation_of_what_topples_says_so(jaxid, tmp_path, monkeypatch):
    """A controller holds what would fall: its record is no promise that the model by itself follows it."""
    monkeypatch.chdir(tmp_path)
    Path("topples.py").write_text(TOPPLES)
    rng, angle, rows = np.random.default_rng(3), 0.02, []
    for k in range(400):
        push = -6.0 * (angle - 0.1 * np.sin(0.05 * k)) + 0.2 * rng.normal()
        rows.append((0.02 * k, push, angle + 0.001 * rng.normal()))
        angle = angle * np.exp(0.06) + push / 3.0 * np.expm1(0.06)
    pd.DataFrame(rows, columns=["t", "push", "angle"]).to_csv("held.csv", index=False)
    Path("model.toml").write_text("[parameters.a]\nvalue = 3.0\n")
    code, _, remarks = jaxid(
        "simulate", "topples:leaning", "--log", "held.csv", "--model", "model.toml", "--out", "p.csv"
    )
    assert code == 0 and "errors double every 0.23 s" in remarks and "says nothing" in remarks
    assert len(pd.read_csv("p.csv")) == 400


def test_the_version_is_that_of_the_package(jaxid):
    stated = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]["version"]
    assert jaxid("--version") == (0, f"jaxid {stated}\n", "")
    assert importlib.import_module("jaxid").__version__ == stated


def test_python_m_runs_the_same_command(jaxid, capsys, monkeypatch):
    for argv in (["--version"], ["fit", "pionee", "--fit", "a.csv", "--out", "o"]):
        monkeypatch.setattr("sys.argv", ["jaxid", *argv])
        with pytest.raises(SystemExit) as ended:
            runpy.run_module("jaxid", run_name="__main__")
        said, remarks = capsys.readouterr()
        assert (ended.value.code, said, remarks) == jaxid(*argv)


def test_unusable_input_is_one_line_and_status_1(jaxid, axis_logs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("own_robots.py").write_text(OWN)
    Path("broken_robot.py").write_text("\n\n1 / 0\n")
    Path("lacking_robot.py").write_text("import a_module_that_is_not_there\n")
    Path("wrong.csv").write_text("t,u,speed\n0,1,0\n0.02,1,0.1\n")
    Path("bad.toml").write_text("[parameters]\nM = -1\n")
    Path("fixed.toml").write_text("".join(f"[parameters.{n}]\nfree = false\n" for n in (*AXIS, "offset")))
    Path("occupied").write_text("a file")
    noise = np.random.default_rng(0).normal(0.0, NOISE, 300)
    still = {"t": np.arange(300) * 0.02, "u": np.full(300, 0.01) * (-1) ** np.arange(300), "v": noise}
    pd.DataFrame(still).to_csv("still.csv", index=False)
    log, fit = axis_logs[0], ("fit", "axis", "--fit", axis_logs[0])
    simulate = ("simulate", "axis", "--model", known_offset(tmp_path))
    cases = [
        (("fit", "axis", "--fit", "absent.csv", "--out", "o"), ("absent.csv", "does not exist")),
        (("fit", "axis", "--fit", "none_*.csv", "--out", "o"), ("none_*.csv", "pattern")),
        (("fit", "axis", "--fit", "wrong.csv", "--out", "o"), ("wrong.csv", "'v'")),
        (("fit", "axis", "--fit", "still.csv", "--out", "o"), ("still.csv", "did not move", "drive it harder")),
        ((*fit, "--held-out", "absent.csv", "--out", "o"), ("absent.csv",)),
        ((*fit, "--model", "bad.toml", "--out", "o"), ("bad.toml", "parameters.M.value")),
        ((*fit, "--model", "absent.toml", "--out", "o"), ("absent.toml", "check the path")),
        ((*fit, "--model", "fixed.toml", "--out", "o"), ("no parameter is free", "free = true")),
        ((*fit, "--map", "absent.toml", "--out", "o"), ("absent.toml",)),
        ((*fit, "--out", "occupied"), ("occupied", "cannot be used")),
        ((*fit, "--out", "occupied/below"), ("occupied", "cannot be used")),
        (("fit", "broken_robot:x", "--fit", log, "--out", "o"), ("broken_robot.py:3", "ZeroDivisionError")),
        (("fit", "lacking_robot:x", "--fit", log, "--out", "o"), ("a_module_that_is_not_there", "install")),
        (("fit", "own_robots:number", "--fit", log, "--out", "o"), ("own_robots:number", "int")),
        (("fit", "own_robots:needs", "--fit", log, "--out", "o"), ("own_robots:needs", "without arguments")),
        (("fit", "own_robots:fails", "--fit", log, "--out", "o"), ("own_robots:fails", "TypeError: no such gear")),
        ((*fit, "--controller", "own_robots:number", "--out", "o"), ("own_robots:number", "int, no controller")),
        ((*simulate, "--log", "axis_*.csv", "--out", "p.csv"), ("3 files", "one log")),
        ((*simulate, "--log", log, "--out", "nowhere/p.csv"), ("nowhere", "cannot be used")),
    ]
    for argv, words in cases:
        code, said, remarks = jaxid(*argv)
        assert code == 1, (argv, remarks)
        (line,) = remarks.splitlines()
        assert line.startswith("jaxid: ") and not said
        for word in words:
            assert word in line, (word, line)
    assert Path("occupied").read_text() == "a file"


@pytest.mark.parametrize(
    "argv",
    [
        ["fit", "pionee", "--fit", "a.csv", "--out", "o"],
        ["fit", "no_such_module_here:robot", "--fit", "a.csv", "--out", "o"],
        ["fit", "jaxid.robots:Pionier", "--fit", "a.csv", "--out", "o"],
        ["fit", "axis", "--out", "o"],
        ["fit", "axis", "--fit", "--out", "o"],
        ["fit", "axis", "--fit", "a.csv"],
        ["fit", "axis", "--fit", "a.csv", "--out", "o", "--fast"],
        ["simulate", "axis", "--log", "a.csv", "--out", "p.csv"],
        ["explode"],
    ],
)
def test_wrong_arguments_are_status_2(jaxid, argv):
    code, said, remarks = jaxid(*argv)
    assert code == 2 and not said and "Traceback" not in remarks


def test_a_fit_that_fails_leaves_earlier_results_alone(jaxid, tmp_path, monkeypatch, axis_logs):
    out = tmp_path / "out"
    out.mkdir()
    (out / "fit.json").write_text("earlier")
    monkeypatch.setattr("jaxid._json.json.dumps", lambda *a, **k: 1 / 0)
    with pytest.raises(ZeroDivisionError):  # a bug keeps its traceback
        main(
            [
                "fit",
                "axis",
                "--fit",
                *map(str, axis_logs[:2]),
                "--model",
                str(known_offset(tmp_path)),
                "--out",
                str(out),
            ]
        )
    assert [path.name for path in out.iterdir()] == ["fit.json"] and (out / "fit.json").read_text() == "earlier"


def test_a_cache_that_cannot_be_written_does_no_harm(jaxid, tmp_path, monkeypatch):
    from jaxid.cli.cache import keep_compiled_programs

    def cache_folder():
        return jax.config.values["jax_compilation_cache_dir"]

    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    jax.config.update("jax_compilation_cache_dir", None)
    keep_compiled_programs()
    assert cache_folder() is None
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    keep_compiled_programs()
    assert cache_folder() == str(tmp_path / "jaxid")


def test_help_names_every_command(jaxid):
    code, said, _ = jaxid("--help")
    assert code == 0 and all(command in said for command in ("fit", "simulate", "demo"))


def test_outliers_are_weighed_down_and_listed_and_a_clock_offset_is_told(tmp_path, axis_logs, jaxid):
    rng = np.random.default_rng(5)
    for path in axis_logs:
        table = pd.read_csv(path)
        table.loc[rng.choice(len(table), 12, replace=False), "v"] += 2.0
        table.to_csv(path, index=False)
    out = tmp_path / "out"
    argv = ["fit", "axis", "--fit", *axis_logs, "--model", known_offset(tmp_path), "--out", out]
    code, _, remarks = jaxid(*argv, "--loss", "cauchy", "--covariance", "robust", "--clock-offset")
    assert code == 0, remarks
    found = json.loads((out / "fit.json").read_text())["methods"]["output_error"]
    for name, value in AXIS.items():
        assert within(found["parameters"][name], value)
    assert sum(outlier["samples"] for outlier in found["outliers"]) == pytest.approx(36, abs=3)
    assert set(found["logs"].values()) == {"fitted"} and len(found["clock_offsets"]) == 3
    for offset in found["clock_offsets"].values():
        assert within(offset, 0.0)
    assert "had little weight" in remarks and "clock is" in remarks

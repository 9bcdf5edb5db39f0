"""Results that are saved and loaded: the same numbers, the same words, ready for what comes next; files that are not ours."""

import dataclasses
import json
import sys
import types
import zipfile

import jax.numpy as jnp
import numpy as np
import pytest

import jaxid
from jaxid import Axis, Channels, Custom, Log, LogSet, Parameter, ResultFileError, load, output_error, save

TRUTH = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}


@pytest.fixture(scope="module")
def logs(axis_log):
    inputs = np.repeat([3.0, -2.0, 4.0, 0.5], 30)
    return LogSet([axis_log(f"{k}.csv", np.roll(inputs, 30 * k), 0.01, k, position=False, **TRUTH) for k in range(3)])


@pytest.fixture(scope="module")
def fit(logs):
    return output_error(Axis(), logs[:2], start=jaxid.integral_least_squares(Axis(), logs[:2]))


@pytest.fixture(scope="module")
def results(fit, logs):
    """Every kind of result that needs no search."""
    return {
        "Fit": fit,
        "Fleet": jaxid.fit_fleet(Axis(), {"one": logs[:1], "other": logs[1:2]}),
        "Profiles": jaxid.profile_likelihood(fit, logs[:2], ["Fc"]),
        "MultiStart": jaxid.multi_start(Axis(), logs[:2], starts=4, seed=5),
        "Repeatability": jaxid.repeatability(Axis(), logs),
        "Identifiability": jaxid.identifiability(Axis(), logs),
        "Comparison": jaxid.compare(fit, held_out=logs[2:]),
        "Design": jaxid.design_experiment(
            Axis(), limit=4.0, seconds=2.0, interval=0.02, rounds=1, noise={"v": 0.01}, seed=2
        ),
        "ExplainedChange": jaxid.explain_change(fit, output_error(Axis(), logs[2:]), logs[:2], logs[2:]),
        "LogSet": logs,
        "Axis": Axis() + jaxid.effects.effect_by_id(Axis(), "quadratic_drag"),
    }


KINDS = ("Fit", "Fleet", "Profiles", "MultiStart", "Repeatability", "Identifiability", "Comparison", "Design",
         "ExplainedChange", "LogSet", "Axis")  # fmt: skip


def back(result, path):
    return load(save(result, path))


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_loaded_is_what_was_saved(results, kind, tmp_path):
    result = results[kind]
    found = back(result, tmp_path / "a.jaxid")
    assert type(found) is type(result) and type(found).__name__ == kind
    assert repr(found) == repr(result) and found._repr_html_() == result._repr_html_()
    save(found, tmp_path / "b.jaxid")  # to the last digit: saved again, the file has the same bytes
    assert (tmp_path / "a.jaxid").read_bytes() == (tmp_path / "b.jaxid").read_bytes()


def test_numbers_keep_every_digit_and_their_kind(fit, logs, tmp_path):
    found = back(fit, tmp_path / "fit.jaxid")
    assert np.array_equal(found.covariance, fit.covariance) and found.covariance.dtype == fit.covariance.dtype
    assert found.parameters == fit.parameters or all(
        repr(found[name]) == repr(fit[name]) and found[name].value == fit[name].value for name in fit.parameters
    )
    assert found.robot == fit.robot and found.robot.parameters.numbers == fit.robot.parameters.numbers
    own = back(logs, tmp_path / "logs.jaxid")
    assert [log.sha256 for log in own] == [log.sha256 for log in logs]


def test_a_loaded_fit_is_compared_explained_and_started_from(fit, logs, tmp_path):
    found = back(fit, tmp_path / "fit.jaxid")
    assert repr(jaxid.compare(found, held_out=logs[2:])) == repr(jaxid.compare(fit, held_out=logs[2:]))
    again = output_error(found.robot, logs[:2], start=found)
    assert again["M"].value == pytest.approx(fit["M"].value, rel=1e-6)
    assert jaxid.explain(found, logs[:2], logs[2:]).verdict == "adequate"


def test_an_explanation_is_loaded_with_its_page(explained, tmp_path):
    from jaxid.report.document import rendered
    from jaxid.report.explanation_page import page_of

    found = back(explained, tmp_path / "explained.jaxid")
    assert found.sentence == explained.sentence and found.to_dict() == explained.to_dict()
    assert repr(found) == repr(explained)
    assert found.final.robot == explained.final.robot and found.gap_closed == explained.gap_closed
    assert np.array_equal(found.after.residuals[0], explained.after.residuals[0], equal_nan=True)
    words = [len(rendered(page_of(own))) for own in (found, explained)]
    assert abs(words[0] - words[1]) < 200  # identifiers of drawings are random
    assert found.origin.logs["held_out"] == explained.origin.logs["held_out"] != ()


# -- where a result came from ------------------------------------------------------------------------------------------
def test_a_result_knows_its_logs_arguments_seeds_and_versions(results, logs, tmp_path):
    origin = back(results["MultiStart"], tmp_path / "a.jaxid").origin
    assert origin.function == "multi_start" and origin.arguments["seed"] == 5 and origin.arguments["starts"] == 4
    assert [own.sha256 for own in origin.logs["logs"]] == [log.sha256 for log in logs[:2]]
    assert {"python", "jaxid", "jax", "optimistix", "numpy"} <= origin.versions.keys()
    again = getattr(jaxid, origin.function)(logs=logs[:2], **origin.arguments)
    assert again.basins == results["MultiStart"].basins
    assert results["Design"].origin.arguments["seed"] == 2
    assert set(results["Fleet"].origin.logs) == {"fleet: one", "fleet: other"}


def test_other_logs_are_told(fit, logs, axis_log):
    assert fit.origin.differences(logs=logs[:2]) == ()
    other = axis_log("1.csv", np.repeat([3.0, -2.0], 30), 0.01, 9, position=False, **TRUTH)
    missing, new, changed = fit.origin.differences(logs=LogSet([logs[2], other]))
    assert missing == "logs: 0.csv is missing." and new == "logs: 2.csv was not used."
    assert changed.startswith("logs: 1.csv has another content")


def test_other_logs_of_a_fleet_are_told(results, logs):
    origin = results["Fleet"].origin
    used = {name.removeprefix("fleet: "): [own.sha256 for own in logs_of] for name, logs_of in origin.logs.items()}
    given = {name: LogSet([log for log in logs if log.sha256 in own]) for name, own in used.items()}
    assert origin.differences(fleet=given) == ()
    missing, new = origin.differences(fleet={"one": given["one"], "third": logs[:1]})
    assert missing == "fleet: other is missing." and new == f"fleet: third: {logs[0].name} was not used."


def test_the_hash_is_of_the_content_alone(logs, tmp_path):
    log = logs[0]
    log.to_csv(tmp_path / "other name.csv")
    read = jaxid.read_logs(tmp_path / "other name.csv", robot="axis")[0]
    assert read.sha256 == log.sha256 and read.source.endswith("other name.csv")
    moved = log.outputs.copy()
    moved[7, 0] = np.nextafter(moved[7, 0], np.inf)
    assert Log(log.name, log.time, log.inputs, moved, log.channels).sha256 != log.sha256
    with_pose = Log(log.name, log.time, log.inputs, log.outputs, log.channels, log.to_frame()[["t"]])
    assert with_pose.sha256 != log.sha256


# -- robots of the user's own -----------------------------------------------------------------------------------------
def falling(state, given, p):
    return {"v": (given["u"] - p["drag"] * state["v"]) / p["mass"]}


def rover(dynamics=falling):
    table = {"mass": Parameter(2.0, "kg", free=True, lower=0.0), "drag": Parameter(1.0, "N s/m", free=True)}
    own = Channels(("u",), ("v",), units={"u": "N", "v": "m/s"})
    return Custom(dynamics=dynamics, state_names=("v",), own_channels=own, table=table)


def module_of_ones_own(name):
    """As if somebody had written a module with `falling` in it, and imported it."""
    module = types.ModuleType(name)
    exec(
        "def falling(state, given, p):\n    return {'v': (given['u'] - p['drag'] * state['v']) / p['mass']}",
        vars(module),
    )
    return module


def test_a_robot_of_ones_own_is_found_by_name(monkeypatch, tmp_path):
    module = module_of_ones_own("rovers_for_this_test")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    path = save(rover(module.falling).with_values(mass=3.0), tmp_path / "rover.jaxid")
    found = load(path)
    assert found.dynamics is module.falling and found.parameters.numbers["mass"] == 3.0
    assert found == rover(module.falling).with_values(mass=3.0)
    monkeypatch.delitem(sys.modules, module.__name__)
    with pytest.raises(ResultFileError, match="rovers_for_this_test:falling, which is not imported; import rovers"):
        load(path)
    other = module_of_ones_own("rovers_for_this_test")
    assert load(path, known=[other]).dynamics is other.falling
    assert load(path, known=[other.falling]).dynamics is other.falling


@pytest.mark.parametrize("dynamics", [lambda state, given, p: {"v": 0.0 * state["v"]}])
def test_a_function_without_a_name_is_refused_when_saving(dynamics, tmp_path):
    with pytest.raises(ResultFileError, match="lambda.*define it at the top of a module"):
        save(rover(dynamics), tmp_path / "rover.jaxid")
    assert list(tmp_path.iterdir()) == []


def test_an_argument_without_a_name_is_left_out_of_the_origin(fit, tmp_path):
    class Local(jaxid.Huber):
        pass

    found = dataclasses.replace(fit.origin, arguments={**fit.origin.arguments, "loss": Local(), "law": lambda x: x})
    own = back(dataclasses.replace(fit, origin=found), tmp_path / "fit.jaxid").origin.arguments
    assert set(found.arguments) - set(own) == {"loss", "law"} and own["max_steps"] == 100


# -- files that are not ours -------------------------------------------------------------------------------------------
def rewritten(path, change):
    """The file with its page of JSON changed."""
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    header = json.loads(files["result.json"])
    change(header)
    files["result.json"] = json.dumps(header).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


@pytest.mark.parametrize(
    "name",
    ["os:system", "subprocess:Popen", "builtins:exec", "shutil:rmtree", "jaxid.cli.app:main", "jaxid._atomic:write_text",
     "json:loads", "pathlib:Path", "jaxid.saved_results:load", "numpy:ndarray"],
)  # fmt: skip
def test_a_file_chooses_no_function_to_be_called(name, monkeypatch, tmp_path):
    module = module_of_ones_own("rovers_for_this_test")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    path = save(rover(module.falling), tmp_path / "rover.jaxid")

    def change(header):
        text = json.dumps(header).replace("rovers_for_this_test:falling", name)
        header.update(json.loads(text))

    with pytest.raises(ResultFileError, match=f"{name}"):
        load(rewritten(path, change))
    first = json.loads(zipfile.ZipFile(path).read("result.json"))["objects"][0]["class"]
    path = save(Axis(), tmp_path / "axis.jaxid")
    with pytest.raises(ResultFileError, match=f"{name}"):
        load(rewritten(path, lambda header: header["objects"][0].update({"class": name})))
    assert first.startswith("jaxid.")


def test_nothing_that_a_file_names_is_imported(tmp_path):
    path = save(Axis(), tmp_path / "axis.jaxid")
    with pytest.raises(ResultFileError, match="antigravity:fly, which is not imported"):
        load(rewritten(path, lambda header: header["objects"][0].update({"class": "antigravity:fly"})))
    assert "antigravity" not in sys.modules


def test_strange_newer_and_damaged_files_are_told_in_a_sentence(fit, tmp_path):
    path = save(fit, tmp_path / "fit.jaxid")
    whole = path.read_bytes()
    with pytest.raises(ResultFileError, match=r"absent.jaxid cannot be opened .*; check the path"):
        load(tmp_path / "absent.jaxid")
    with pytest.raises(ResultFileError, match="cannot be opened"):
        load(tmp_path)
    for data in (b"", b"t,u,v\n0,1,2\n", b"\x80\x04K\x01."):  # the last: a pickle
        path.write_bytes(data)
        with pytest.raises(ResultFileError, match="fit.jaxid is no file that jaxid.save wrote"):
            load(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("something.txt", "else")
    with pytest.raises(ResultFileError, match="is no file that jaxid.save wrote"):
        load(path)
    path.write_bytes(whole)
    newer = rewritten(path, lambda header: header.update(version=7, versions={"jaxid": "9.0"}))
    with pytest.raises(ResultFileError, match=r"format 7, written by jaxid 9.0; .*newer"):
        load(newer)
    path.write_bytes(whole)
    with pytest.raises(ResultFileError, match="'verdicts'.*written by jaxid"):
        load(rewritten(path, lambda header: header["objects"][-1]["fields"].update(verdicts=1)))
    rng = np.random.default_rng(4)
    for _ in range(60):
        damaged = bytearray(whole[: rng.integers(1, len(whole))] if rng.random() < 0.3 else whole)
        damaged[rng.integers(len(damaged))] ^= int(rng.integers(1, 256))
        path.write_bytes(bytes(damaged))
        try:
            assert repr(load(path)) == repr(fit)  # what the archive says of itself may change unseen
        except ResultFileError as error:
            assert "fit.jaxid" in str(error)


def test_what_cannot_be_written_leaves_the_file_before(fit, tmp_path):
    path = save(fit, tmp_path / "fit.jaxid")
    before = path.read_bytes()
    for thing in (3.0, {"a": fit}, jnp.zeros(3), object()):
        with pytest.raises(ResultFileError, match="fit.jaxid: the .* cannot be saved"):
            save(thing, path)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]

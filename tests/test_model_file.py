"""jaxid/model_file.py: what a model file changes, what it cannot, and that writing and reading lose nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, Custom, DifferentialDrive, Effect, Log, LogSet, Omni, Parameter, Pioneer, simulate
from jaxid.effects import catalogue, effect_by_id
from jaxid.logs import Channels
from jaxid.model_file import ModelFileError, model_text, read_model, write_model


def written(tmp_path, text):
    path = tmp_path / "model.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_overrides_what_it_mentions_and_nothing_else(tmp_path):
    path = written(
        tmp_path,
        """
        robot = "pioneer"
        [parameters]
        Cs = 0.3
        M = 16
        [parameters.Cv]
        value = 0.05
        free = false
        [parameters.I0]
        lower = 0.1
        upper = inf
        prior = [0.31, 0.05]
        std_error = 0.2
        unit = "kg m^2"
        """,
    )
    own, robot = Pioneer().parameters, read_model(path, Pioneer()).parameters
    assert robot["Cs"] == replace(own["Cs"], value=0.3)
    assert robot["M"] == replace(own["M"], value=16.0)
    assert robot["Cv"] == replace(own["Cv"], value=0.05, free=False)
    assert robot["I0"] == replace(own["I0"], lower=0.1, upper=math.inf, prior=(0.31, 0.05))
    untouched = set(own) - {"Cs", "M", "Cv", "I0"}
    assert all(robot[name] == own[name] for name in untouched)


@pytest.mark.parametrize("robot", [Pioneer(), Omni(), Axis()], ids=lambda robot: robot.name)
def test_writing_and_reading_give_the_same_table(tmp_path, robot):
    rng = np.random.default_rng(3)
    for name, p in robot.parameters.items():
        robot = robot.change(name, value=p.value * (1 + rng.uniform(0, 1)), free=bool(rng.integers(2)))
    first, second = list(robot.parameters)[:2]
    value = robot.parameters[second].value
    robot = robot.change(first, prior=(0.1 + 0.2, 1e-7), upper=1e9).change(second, lower=value - abs(value) / 3)
    write_model(tmp_path / "model.toml", robot, {first: 0.1, second: math.nan}, "output_error")
    assert read_model(tmp_path / "model.toml", type(robot)()).parameters == robot.parameters


def test_a_removed_bound_stays_removed(tmp_path):
    own = {"k": Parameter(1.0, "1/s", free=True, lower=-5.0, upper=5.0)}
    robot = Custom(
        dynamics=lambda x, u, p: {"v": u["u"] - p["k"] * x["v"]},
        state_names=("v",),
        own_channels=Channels(("u",), ("v",)),
        table=own,
    )
    wide = robot.change("k", lower=-math.inf, upper=math.inf)
    write_model(tmp_path / "model.toml", wide)
    assert read_model(tmp_path / "model.toml", robot).parameters == wide.parameters


def test_a_read_model_simulates_as_the_one_written(tmp_path):
    time = np.arange(200) * 0.02
    volts = np.stack([6 * np.sin(2 * time) + 1, 5 * np.sin(1.7 * time)], axis=1)
    logs = LogSet([Log.from_arrays("run", time, volts, np.zeros((200, 2)), "pioneer")])
    robot = Pioneer().with_values(Cs=0.1 + 0.2, M=15.123456789012345, Ir1=2.2e-4 / 3)
    write_model(tmp_path / "model.toml", robot)
    again = read_model(tmp_path / "model.toml", Pioneer())
    assert np.array_equal(simulate(robot, logs)[0], simulate(again, logs)[0])
    assert not np.array_equal(simulate(Pioneer(), logs)[0], simulate(again, logs)[0])


def test_the_integration_step_that_a_fit_needed_is_kept(tmp_path):
    robot = replace(Axis(), longest_step=0.003)
    path = tmp_path / "model.toml"
    write_model(path, robot)
    assert read_model(path, Axis()).longest_step == 0.003
    assert "longest_step" not in model_text(Axis())
    path = written(tmp_path, "longest_step = 0.0")
    with pytest.raises(ModelFileError, match="longest_step = 0 is no integration step"):
        read_model(path, Axis())


def test_standard_errors_stand_in_the_file_where_there_are_any():
    text = model_text(Axis(), {"M": 0.25, "Fv": math.nan}, "output_error")
    assert text.count("std_error") == 1 and "std_error = 0.25" in text and 'method = "output_error"' in text


def test_why_a_model_is_not_to_be_trusted_stands_above_it(tmp_path):
    why = "Failed: the residual is 48 times the noise that the sensors show, and the model does not follow its logs at all."
    path = tmp_path / "model.toml"
    write_model(path, Axis(), remark=why)
    lines = path.read_text().splitlines()
    said = [line for line in lines if line.startswith("# ")]
    assert lines[: len(said)] == said and " ".join(line[2:] for line in said) == why
    assert read_model(path, Axis()).parameters == Axis().parameters


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Cs = 0.3", ("'Cs'", "[parameters]")),
        ("[parameters", ("not TOML",)),
        ('robot = "omni"', ("'omni'", "'pioneer'")),
        ("[parameters]\nCz = 1", ("parameters.Cz", "Cs")),
        ("[parameters.Cs]\nvalu = 1", ("parameters.Cs", "'valu'", "value")),
        ('[parameters]\nCs = "big"', ("parameters.Cs.value", "'big'", "number")),
        ("[parameters]\nCs = nan", ("parameters.Cs.value", "finite")),
        ("[parameters]\nCs = true", ("parameters.Cs.value", "number")),
        (f"[parameters]\nCs = 1{'0' * 400}", ("parameters.Cs.value", "finite")),
        ("[parameters]\nM = -15.5", ("parameters.M.value", "negative")),
        ("[parameters.M]\nlower = -1", ("parameters.M.lower", "negative")),
        ("[parameters]\nR = 0", ("parameters.R.value", "above zero")),
        ("[parameters.Cs]\nlower = 2\nupper = 1", ("Cs", "lower bound 2", "widen")),
        ("[parameters.Cs]\nvalue = 3\nupper = 1", ("Cs", "outside its bounds", "change")),
        ("[parameters.Cs]\nprior = [0.3, 0]", ("parameters.Cs.prior", "above zero")),
        ("[parameters.Cs]\nprior = 0.3", ("parameters.Cs.prior", "[mean, standard deviation]")),
        ('[parameters.Cs]\nfree = "yes"', ("parameters.Cs.free", "true")),
        ('[parameters.Cs]\nunit = "mN m"', ("parameters.Cs.unit", "'N m'", "convert")),
        ("parameters = 3", ("parameters", "table")),
        ('[[effects]]\nid = "motor_lagg"', ("'motor_lagg'", "'motor_lag'", "catalogue")),
        ('[[effects]]\nid = "coriolis_coupling"', ("'coriolis_coupling'", "'pioneer'", "module:attribute")),
        ('[[effects]]\nid = "motor_lag"\n[[effects]]\nid = "motor_lag"', ("motor_lag", "twice")),
        ('[[effects]]\nid = "motor_lag"\n[parameters]\n"motor_lag.time" = 1', ("motor_lag.time", "time_constant")),
        ("effects = 1", ("effects", "[[effects]]")),
    ],
)
def test_every_error_is_one_sentence_with_file_key_and_remedy(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(ModelFileError) as caught:
        read_model(path, Pioneer())
    message = str(caught.value)
    assert "model.toml" in message and "\n" not in message and message.endswith(".")
    for word in words:
        assert word in message


def test_files_that_cannot_be_opened(tmp_path):
    for path in (tmp_path / "absent.toml", tmp_path):
        with pytest.raises(ModelFileError, match="cannot be opened"):
            read_model(path, Pioneer())
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelFileError, match="not TOML"):
        read_model(tmp_path / "binary.toml", Pioneer())


class Rope(Effect):
    """A user's own effect, which no catalogue has."""

    id = "rope"

    def parameters(self, robot):
        return {self.key("c"): Parameter(0.0, "N s/m", free=True, lower=0.0)}


def test_a_users_own_effects_come_with_the_robot(tmp_path):
    robot = (Axis() + Rope()).with_values(**{"rope.c": 0.7})
    write_model(tmp_path / "model.toml", robot)
    assert read_model(tmp_path / "model.toml", Axis() + Rope()).parameters == robot.parameters
    with pytest.raises(ModelFileError, match="rope"):
        read_model(tmp_path / "model.toml", Axis())
    named = robot + effect_by_id(robot, "motor_lag")
    write_model(tmp_path / "model.toml", named)
    assert read_model(tmp_path / "model.toml", Axis() + Rope()) == named
    with pytest.raises(ModelFileError, match="has motor_lag; give the robot"):
        read_model(tmp_path / "model.toml", Axis() + effect_by_id(Axis(), "motor_lag"))


@pytest.mark.parametrize("robot", [Pioneer(), Omni().with_values(coriolis=0.0), Axis()], ids=lambda robot: robot.name)
def test_every_catalogue_effect_comes_back_from_a_file(tmp_path, robot):
    rng = np.random.default_rng(5)
    effects = catalogue(robot)
    assert len(effects) >= 14
    for one in effects:
        model = robot + one
        model = model + next(e for e in catalogue(model) if e.id != one.id)  # a second one knows of the first
        values = {n: p.value + 0.01 * rng.uniform(1, 2) for n, p in model.parameters.items() if p.free}
        model = model.with_values(**values)
        write_model(tmp_path / "model.toml", model)
        again = read_model(tmp_path / "model.toml", type(robot)())
        # Equal robots are one compiled program with the same numbers: they simulate alike.
        assert again == model and again.structure == model.structure, one.id
        assert len(set(model.parameters) - set(robot.parameters)) > 0 or one.frees(robot)


def test_laws_that_hang_on_the_robots_numbers_come_back_from_a_file(tmp_path):
    """A winding's resistance is no gain only where motors have a back-EMF, of which this robot has none by itself."""
    robot = DifferentialDrive().with_values(back_emf=4.0, gain=5.0)
    model = robot + effect_by_id(robot, "motor_gain_mismatch", "winding_resistance")
    model = model.with_values(**{"motor_gain_mismatch.excess_u_left": 0.1})
    write_model(tmp_path / "model.toml", model)
    read = read_model(tmp_path / "model.toml", DifferentialDrive())
    assert read == model and read.parameters == model.parameters


def test_a_read_model_with_effects_simulates_as_the_one_written(tmp_path):
    time = np.arange(300) * 0.02
    logs = LogSet([Log.from_arrays("run", time, 3 * np.sin(2 * time)[:, None], {"v": np.zeros(300)}, "axis")])
    model = Axis()
    for name in ("stribeck_friction", "cogging_torque", "sensor_lag"):
        model = model + effect_by_id(model, name)
    added = {n: 0.05 if "periods" not in n else 4.0 for n in model.parameters if "." in n}
    model = model.with_values(**added)
    write_model(tmp_path / "model.toml", model)
    (first,), (again,) = simulate(model, logs), simulate(read_model(tmp_path / "model.toml", Axis()), logs)
    assert np.array_equal(first, again)
    assert np.max(np.abs(first - simulate(Axis(), logs)[0])) > 0.01

"""Tables of parameters: what they refuse, and that nothing changes in place."""

import math
import pickle

import pytest

from jaxid import Axis, Parameter, ParameterError, ParameterTable, Pioneer
from jaxid.effects.catalogue import effect_by_id


@pytest.fixture
def table():
    return ParameterTable(
        {
            "mass": Parameter(2.0, "kg", free=True, lower=0.0, meaning="moving mass"),
            "drag": Parameter(0.5, "N s/m", lower=0.0, upper=1.0),
        }
    )


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        (dict(value=math.nan), ("drag", "finite", "N s/m")),
        (dict(value=math.inf), ("drag", "finite")),
        (dict(value=1.5), ("drag", "1.5", "[0.0, 1.0]", "change the value or the bounds")),
        (dict(lower=2.0), ("drag", "2.0", "1.0", "widen")),
        (dict(lower=1.0), ("drag", "not below")),
        (dict(prior=(0.5, 0.0)), ("drag", "prior", "positive deviation")),
        (dict(prior=(math.nan, 1.0)), ("drag", "prior", "mean")),
    ],
)
def test_a_contradiction_names_the_parameter_and_the_remedy(table, fields, words):
    with pytest.raises(ParameterError) as error:
        table.change("drag", **fields)
    assert all(word in str(error.value) for word in words)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "call", [lambda t: t["mas"], lambda t: t.change("mas", value=1.0), lambda t: t.with_free("mas")]
)
def test_an_unknown_name_is_answered_with_the_known_ones(table, call):
    with pytest.raises(ParameterError, match="no parameter 'mas'; the parameters are mass, drag"):
        call(table)
    with pytest.raises(ParameterError, match="no parameter 'mas'"):
        table.with_values({"mas": 1.0})


def test_every_change_returns_a_new_table(table):
    before = repr(table), table.numbers
    changed = table.change("drag", value=0.7).with_values({"mass": 3}).with_free("drag")
    assert (repr(table), table.numbers) == before
    assert changed.numbers == {"mass": 3.0, "drag": 0.7}
    assert changed.free_names == ("drag",)
    assert changed["drag"].upper == 1.0 and changed["mass"].meaning == "moving mass"
    longer = table.merge({"gain": Parameter(1.0)})
    assert list(longer) == ["mass", "drag", "gain"] and list(table) == ["mass", "drag"]
    with pytest.raises(TypeError):
        table["mass"] = Parameter(1.0)  # type: ignore[index]
    with pytest.raises(AttributeError):
        table["mass"].value = 1.0  # type: ignore[misc]


def test_equal_tables_are_equal_and_hash_alike_and_survive_pickling(table):
    again = pickle.loads(pickle.dumps(table))
    assert again == table and hash(again) == hash(table)
    assert table.change("drag", value=0.6) != table
    assert "mas" not in table and "mass" in table and len(table) == 2


def test_a_robot_changes_by_name_and_stays_as_it_was():
    robot = Pioneer()
    heavier = robot.with_values(M=16.0).change("M", free=True)
    assert heavier.parameters["M"].value == 16.0 and heavier.parameters["M"].free
    assert robot.parameters["M"].value == 15.5 and not robot.parameters["M"].free
    with pytest.raises(ParameterError, match="no parameter 'mass'"):
        robot.with_values(mass=16.0)
    with pytest.raises(ParameterError, match="R = -1"):
        robot.with_values(R=-1.0)


def test_every_default_says_where_it_comes_from_and_what_it_means():
    from jaxid.robots import BUILT_IN

    for kind in BUILT_IN.values():
        for name, parameter in kind().parameters.items():
            assert parameter.source and parameter.meaning, f"{kind.name}: {name}"


def test_a_robot_shows_its_channels_effects_and_table():
    robot = Axis() + effect_by_id(Axis(), "stribeck_friction")
    text, page = repr(robot), robot._repr_html_()
    first, header, *rows = text.splitlines()
    assert first == "axis: inputs u [V or N]; outputs v [m/s or rad/s]; with Stribeck friction"
    assert len(rows) == len(robot.parameters) and max(map(len, rows)) < 100
    assert {row[header.index("unit") :].split()[0] for row in rows} >= {"kg", "N"}  # columns stay columns
    assert "with Stribeck friction" in page and page.count("<tr>") == 1 + len(rows)


def test_a_table_becomes_a_data_frame_with_everything_that_it_says():
    table = Pioneer().parameters.change("Cs", prior=(0.3, 0.1))
    frame = table.to_pandas()
    assert list(frame.index) == list(table) and frame.index.name == "parameter"
    assert frame["value"].to_dict() == table.numbers
    assert tuple(frame.index[frame["free"]]) == table.free_names
    assert frame.loc["Cs", "prior"] == (0.3, 0.1) and frame.loc["Cs", "unit"] == "N m" and frame.loc["Cs", "meaning"]

"""jaxid/logs/channels.py."""

import copy
import pickle

import pytest

from jaxid.logs import AXIS, OMNI, PIONEER, Channels


def test_standard_channels_carry_the_papers_names_and_signs():
    assert PIONEER.inputs == ("V2", "V3") and PIONEER.outputs == ("eta1", "eta2")
    assert PIONEER.mixing["eta2"] == (1, -1)  # the right wheel turns the robot to the left
    assert OMNI.mixing["V"] == (0, -1, 0, 1) and OMNI.mixing["Vn"] == (1, 0, -1, 0)
    assert OMNI.measured == ("V", "Vn", "W", "i1", "i2", "i3", "i4")
    assert AXIS.substitutes == {"v": "q"}
    assert PIONEER.units["theta"] == "rad" and OMNI.units["i3"] == "A"


@pytest.mark.parametrize("channels", [PIONEER, OMNI, AXIS])
def test_channels_hash_pickle_and_copy(channels):
    for twin in (pickle.loads(pickle.dumps(channels)), copy.deepcopy(channels)):
        assert twin == channels and hash(twin) == hash(channels)
    with pytest.raises(TypeError):
        channels.units["V2"] = "mV"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (dict(inputs=(), outputs=("y",)), "at least one"),
        (dict(inputs=("u", "u"), outputs=("y",)), "'u' twice"),
        (dict(inputs=("t",), outputs=("y",)), "'t' twice"),
        pytest.param(dict(inputs=("u",), outputs=("y", 3)), "3", marks=pytest.mark.wrong_types),
        (dict(inputs=("u",), outputs=("y",), mixing={"z": (1,)}), "'z'"),
        (dict(inputs=("u",), outputs=("y",), mixing={"y": (1, 2)}), "2 numbers"),
        (dict(inputs=("u",), outputs=("y",), substitutes={"y": "q"}), "'q'"),
    ],
)
def test_channels_that_do_not_fit_together_are_refused(arguments, says):
    with pytest.raises(ValueError, match=says):
        Channels(**arguments)


def test_several_channels_may_stand_in_for_an_output_together():
    channels = Channels(("u",), ("v", "w"), ("a", "b"), substitutes={"v": ("a", "b"), "w": "b"})
    assert channels.stand_ins("v") == ("a", "b") and channels.stand_ins("w") == ("b",)
    assert channels.positions == ("a", "b")
    assert channels.stood_in("w", {"b"}) and not channels.stood_in("v", {"b"})
    with pytest.raises(ValueError, match="'c'"):
        Channels(("u",), ("v",), ("a",), substitutes={"v": ("a", "c")})


def test_positions_can_be_added():
    channels = PIONEER.with_positions(("a", "b"), "rad", ("eta1",), {"a": (1, 0)})
    assert channels.measured == ("eta1", "eta2", "a", "b") and channels.units["a"] == "rad"
    assert channels.stand_ins("eta1") == ("a", "b") and not channels.stand_ins("eta2")

"""What an explanation says, keeps and writes, on an axis with a known drag hidden in its logs."""

import json
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jaxid import Axis, output_error, read_logs, simulate
from jaxid.estimate.noise_colour import Colour
from jaxid.explanation.left.coloured import OnlyColour
from jaxid.explanation.left.heldout import held_out_state
from jaxid.explanation.next_experiment import NextExperiment
from jaxid.explanation.verdict import still_doubted
from jaxid.explanation.where.localise import channel_name
from jaxid.model_file import read_model

TRUTH = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}


@pytest.fixture(scope="module")
def proposed():
    """A proposed experiment, written by hand."""
    time = np.arange(100) * 0.02
    inputs = 2.0 * np.sign(np.sin(3 * time + 0.1))[:, None]
    return NextExperiment(("quadratic_drag", "sensor_lag"), "with a wave at 2 N", 5.0, 0.4, time, inputs, ("u",))


def test_the_drag_is_named_with_its_size_and_the_bias_it_caused_is_gone(explained):
    assert explained.verdict == "named" and [e.id for e in explained.effects] == ["quadratic_drag"]
    drag = explained.effects[0].parameters["coefficient"]
    assert abs(drag.value - 1.5) < 4 * drag.std_error and drag.unit == "N s^2/m^2"
    assert explained.before.normalised_rms > 2 and explained.after.adequate and explained.gap_closed > 0.95
    assert set(explained.moved) == {"M", "Fv", "Fc", "offset"}
    for name, value in TRUTH.items():
        before, after = explained.moved[name]
        assert abs(after.value - value) < 4 * after.std_error < abs(before.value - value), name
    assert "quadratic drag" in explained.sentence and repr(explained).startswith("Missing was quadratic drag")


def test_where_a_name_is_doubted_and_nothing_is_left_no_rest_is_spoken_of(explained):
    doubted = replace(explained, verdict="unexplained", doubts=("its errors do not exclude that there is none",))
    assert doubted.sentence == (
        f"Something is missing: the held-out error is {explained.before.normalised_rms:.4g} times the noise, and "
        f"{explained.after.normalised_rms:.2f} with quadratic drag. Yet no name is given, since its errors do not exclude that "
        "there is none."
    )
    gone_on = replace(explained, verdict="unexplained", doubts=doubted.doubts, after=explained.before)
    assert "fits no known effect" in gone_on.sentence
    two = replace(gone_on, effects=(replace(explained.effects[0], equivalent_to=("sensor_lag", "input_delay")),))
    assert "noise; quadratic drag (or sensor lag, input delay) explains part of it" in two.sentence


def test_slow_noise_beside_a_name_is_told_as_what_it_may_be(explained):
    slow = OnlyColour({"v": Colour((0.5, 0.3), 1.0, 0.7)}, simple=False, faster=False)
    left = replace(explained, verdict="unexplained", colour=slow, after=explained.before)
    assert "quadratic drag explains part of it" in left.sentence and "fits no known effect" not in left.sentence
    assert "looks like slow noise of v (AR(2), neighbours 0.70) or a disturbance of the motion" in left.sentence


def test_the_json_file_is_as_agreed(explained, tmp_path):
    explained.save(tmp_path)
    found = json.loads((tmp_path / "explanation.json").read_text())
    assert (found["robot"], found["verdict"]) == ("axis", "named")
    assert {"effects", "gap", "localisation", "next_experiment"} <= set(found)
    (effect,) = found["effects"]
    assert effect["id"] == "quadratic_drag" and effect["where"] == "body" and effect["equivalent_to"] == []
    entry = effect["parameters"]["coefficient"]
    assert entry["unit"] == "N s^2/m^2" and entry["ci95"][0] < entry["value"] < entry["ci95"][1]
    gap = found["gap"]
    assert gap["before"] == explained.before.normalised_rms and gap["after"] == explained.after.normalised_rms
    assert gap["noise_floor"] == 1.0
    assert found["localisation"]["sentence"] == explained.localisation.sentence


def test_what_was_added_is_an_ordinary_model(explained, hidden_drag, tmp_path):
    explained.save(tmp_path)
    model, held_out = read_model(tmp_path / "model.toml", Axis()), explained.held_out
    assert model == explained.model
    for one, other in zip(simulate(model, held_out), simulate(explained.model, held_out), strict=True):
        assert np.array_equal(one, other)
    assert held_out_state(model, held_out, explained.before.noise).normalised_rms == explained.after.normalised_rms
    again = output_error(model, read_logs(hidden_drag / "fit_*.csv", "axis"))
    for name, estimate in again.parameters.items():
        if estimate.status == "identified":
            assert abs(estimate.value - explained.final[name].value) < 0.05 * estimate.std_error, name


@pytest.mark.slow
def test_the_model_file_says_why_it_is_to_be_doubted(explained, tmp_path):
    explained.save(tmp_path)
    assert not (tmp_path / "model.toml").read_text().startswith("#")
    poor = replace(explained.final, judgement=explained.final.judgement.doubted("What is left follows the speed."))
    doubted = replace(explained, final=poor, verdict="unexplained", doubts=("it hardly is",))
    doubted.save(tmp_path)
    text = " ".join((tmp_path / "model.toml").read_text().replace("\n# ", " ").split())
    assert text.startswith("# Something is missing: the held-out error is ")
    assert "it hardly is" in text and "What is left follows the speed." in text
    assert read_model(tmp_path / "model.toml", Axis()) == explained.model


@pytest.mark.slow
def test_a_proposed_experiment_is_a_log_ready_file_and_goes_with_its_explanation(explained, proposed, tmp_path):
    paths = replace(explained, next_experiment=proposed).save(tmp_path)
    table = pd.read_csv(tmp_path / "next_experiment.csv")
    assert list(table) == ["t", "u"]
    np.testing.assert_allclose(table.to_numpy(), np.column_stack((proposed.time, proposed.inputs)), rtol=1e-5)
    assert all(path.exists() for path in paths)
    # The next explanation in this folder proposes nothing and leaves no file that says otherwise.
    replace(explained, next_experiment=None).save(tmp_path)
    assert not (tmp_path / "next_experiment.csv").exists() and not (tmp_path / "next_experiment.png").exists()


def test_where_there_was_no_gap_none_is_closed(explained):
    closed = replace(explained, before=replace(explained.before, normalised_rms=0.99))
    assert math.isnan(closed.gap_closed) and json.loads(json.dumps(closed.to_dict()))["gap"]["closed"] is None


def test_a_fit_that_stays_poor_with_what_was_added_says_so(explained):
    """On the page and in explanation.json, and without advice to explain what is being explained."""
    final = explained.final
    assert final.judgement.verdict == "sound" and still_doubted(final) == ""
    poor = replace(final, judgement=final.judgement.doubted("What is left follows the speed."))
    said = still_doubted(poor)
    assert "itself to be doubted. Poor: What is left follows the speed." in said and "looks further" not in said


def test_a_channels_words_are_not_said_twice():
    words = {"speed": "forward speed", "eta1": "forward speed"}
    named = [channel_name(channel, words) for channel in ("speed", "eta1", "q")]
    assert named == ["forward speed", "forward speed eta1", "q"]


def test_names_that_leave_a_poor_fit_say_that_they_are_not_all(explained):
    judgement = explained.final.judgement
    assert judgement is not None and not judgement.doubt and "missing that has" not in explained.sentence
    poor = replace(judgement, verdict="poor", sentences=("What is left follows the motion.",), follows={"v": "u"})
    final = replace(explained.final, judgement=poor)
    little = replace(explained, final=final)
    assert little.sentence == f"{explained.sentence} The fit with it is poor all the same: more may be missing."
    more = replace(little, after=replace(explained.before, noise_error=0.0))
    assert more.sentence.endswith(
        "More is missing that has no name here: what is left is more than noise, and follows the motion in v."
    )

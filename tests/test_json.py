"""JSON of results: whatever is not a finite number is null, wherever it stands."""

import json
import math

import numpy as np
import pytest

from jaxid._json import as_json


def test_what_is_not_finite_is_null_at_any_depth():
    document = {
        "a": math.nan,
        "b": [1.5, -math.inf, {"c": (np.float64("nan"), np.int64(3))}],
        "d": np.array([1.0, np.inf]),
    }
    assert json.loads(as_json(document)) == {"a": None, "b": [1.5, None, {"c": [None, 3]}], "d": [1.0, None]}


def test_truth_text_and_nothing_stay_what_they_are():
    document = {"yes": True, "no": np.bool_(False), "text": "µ", "none": None, "count": 2}
    assert json.loads(as_json(document)) == {"yes": True, "no": False, "text": "µ", "none": None, "count": 2}


def test_what_json_cannot_hold_is_an_error():
    with pytest.raises(TypeError, match="set"):
        as_json({"a": {1, 2}})

"""What a fit or an explanation is doing goes to the standard library's loggers, where somebody listens."""

import logging

import numpy as np
import pytest

import jaxid


@pytest.fixture(scope="module")
def logs(axis_log):
    inputs = np.repeat([3.0, -2.0, 4.0, 0.5, -4.0], 40)
    return jaxid.LogSet([axis_log("a", inputs, 0.01, 1, position=False)])


def test_progress_goes_to_the_logger_of_the_function(logs, caplog):
    with caplog.at_level(logging.INFO, logger="jaxid"):
        fit = jaxid.output_error(jaxid.Axis(), logs)
    assert {record.name for record in caplog.records} == {"jaxid.output_error"}
    assert "first minimum found" in caplog.messages
    assert fit.origin is not None and "report" not in fit.origin.arguments


def test_whoever_gives_a_report_gets_it_alone_and_nobody_is_told_unasked(logs, caplog):
    told = []
    with caplog.at_level(logging.INFO, logger="jaxid"):
        jaxid.output_error(jaxid.Axis(), logs, report=told.append)
    assert told and not caplog.records
    jaxid.output_error(jaxid.Axis(), logs)
    assert not [record for record in caplog.records if record.name.startswith("jaxid")]

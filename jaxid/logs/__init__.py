"""Logs of experiments: read them, look before fitting, prepare them if asked to, and design the next ones."""

from . import signals
from .batch import Batch
from .channels import (
    AXIS,
    DIFFERENTIAL,
    DIFFERENTIAL_WAYS,
    DIFFERENTIAL_WHEELS,
    DIFFERENTIAL_WHEELS_WAYS,
    OMNI,
    OMNI_ANGLES,
    PIONEER,
    PIONEER_ANGLES,
    Channels,
)
from .finding import Finding, LogError, LogWarning
from .log import Log, LogSet, channels_of
from .noise import noise_level, noise_scale
from .prepare import Removed, prepare
from .read import read_logs

__all__ = [
    "AXIS",
    "DIFFERENTIAL",
    "DIFFERENTIAL_WAYS",
    "DIFFERENTIAL_WHEELS",
    "DIFFERENTIAL_WHEELS_WAYS",
    "OMNI",
    "OMNI_ANGLES",
    "PIONEER",
    "PIONEER_ANGLES",
    "Batch",
    "Channels",
    "Finding",
    "Log",
    "LogError",
    "LogSet",
    "LogWarning",
    "Removed",
    "channels_of",
    "noise_level",
    "noise_scale",
    "prepare",
    "read_logs",
    "signals",
]

"""Pre-flight: look at a log before anything is fitted to it."""

from ..logs.log import look_with
from .preflight import preflight

look_with(preflight)

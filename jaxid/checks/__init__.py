"""Pre-flight: look at a log before anything is fitted to it."""

from ..logs.log import look_with
from .among import among as _among
from .preflight import preflight as _look

look_with(_look, _among)

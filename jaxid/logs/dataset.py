"""A log as an xarray data set."""

from typing import TYPE_CHECKING

from .._labelled import labelled

if TYPE_CHECKING:
    import xarray

    from .log import Log


def log_dataset(log: "Log") -> "xarray.Dataset":
    """Inputs, measured outputs and further columns over the time `t` [s], each with `units` where the channels say one; name,
    source and hash of the content are attributes of the whole.

    Needs xarray (`pip install jaxid-robots[xarray]`); raises `ImportError` without it.
    """
    frame, units = log.to_frame(), log.channels.units
    named = {name: {"units": units[name]} if units.get(name) else {} for name in frame.columns}
    columns = {str(name): (("t",), frame[name].to_numpy(), named[name]) for name in frame.columns if name != "t"}
    over = {"t": ("t", log.time, {"units": "s"})}
    return labelled(over, columns, {"name": log.name, "source": log.source, "sha256": log.sha256})

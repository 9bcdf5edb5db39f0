"""Which columns a robot's log has: names, units, and how each input is expected to act on each output."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

# Pose columns (m, rad) that any log may carry; they give the initial pose and are kept among the extra columns.
POSE = ("x", "y", "theta", "beta")
_POSE_UNITS = {"t": "s", "x": "m", "y": "m", "theta": "rad", "beta": "rad"}


def _tuple(names: Any, field_name: str) -> tuple[str, ...]:
    names = (names,) if isinstance(names, str) else tuple(names)
    for name in names:
        if not isinstance(name, str) or not name:
            raise ValueError(f"Channels.{field_name} holds {name!r}, which is no column name; give strings.")
    return names


@dataclass(frozen=True)
class Channels:
    """The columns of a robot's log (besides time, `t` in seconds).

    **Arguments:**

    - `inputs`: the commanded channels, in the order of the model's input vector.
    - `outputs`: the measured channels that the estimators use, in the order of the model's output vector.
    - `optional`: measured channels that a log may lack (a `Log` then holds NaN in their place).
    - `units`: column name to SI unit, for messages and figures.
    - `mixing`: output name to one number for each input: the sign (and relative gain) with which a positive input acts
      on that output. Pre-flight compares the data with it to find swapped and sign-flipped channels.
    - `substitutes`: output name to the optional channel that may stand in for it (an axis whose position is measured
      but not its speed), or to several that do so together (a body's speed, and the angles of its wheels).

    Raises `ValueError` where a name is used twice, or `mixing` or `substitutes` do not fit the names.

    >>> import jaxid
    >>> lift = jaxid.Channels(inputs=("volts",), outputs=("speed",), units={"volts": "V", "speed": "m/s"})
    >>> lift.units["speed"], "speed" in lift.measured
    ('m/s', True)
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    optional: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    mixing: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    substitutes: Mapping[str, str | tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("inputs", "outputs", "optional"):
            object.__setattr__(self, name, _tuple(getattr(self, name), name))
        mixing = {name: tuple(float(gain) for gain in gains) for name, gains in self.mixing.items()}
        object.__setattr__(self, "units", MappingProxyType(_POSE_UNITS | dict(self.units)))
        object.__setattr__(self, "mixing", MappingProxyType(mixing))
        given = {name: own if isinstance(own, str) else tuple(own) for name, own in self.substitutes.items()}
        object.__setattr__(self, "substitutes", MappingProxyType(given))

        if not self.inputs or not self.outputs:
            raise ValueError("Channels needs at least one input and one output; name the log's columns.")
        names = ("t", *self.inputs, *self.measured)
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"Channels uses the column name {name!r} twice; every channel needs its own name.")
        for name, gains in self.mixing.items():
            if name not in self.measured:
                raise ValueError(
                    f"Channels.mixing names {name!r}, which is no output; use one of {list(self.measured)}."
                )
            if len(gains) != len(self.inputs):
                raise ValueError(
                    f"Channels.mixing[{name!r}] has {len(gains)} numbers for {len(self.inputs)} inputs; give one each."
                )
        for name, substitute in self.substitutes.items():
            own = self.stand_ins(name)
            if name not in self.outputs or not own or not set(own) <= set(self.optional):
                raise ValueError(
                    f"Channels.substitutes says {substitute!r} may replace {name!r}; it must map an output to an "
                    "optional channel, or to several."
                )

    @property
    def measured(self) -> tuple[str, ...]:
        """Outputs, then optional outputs: the columns of `Log.outputs`, in order."""
        return self.outputs + self.optional

    def stand_ins(self, name: str) -> tuple[str, ...]:
        """The optional channels that, all together, may stand in for an output; empty where none do."""
        own = self.substitutes.get(name, ())
        return (own,) if isinstance(own, str) else own

    def stood_in(self, name: str, there: Collection[str]) -> bool:
        """Whether what stands in for an output is all `there`."""
        own = self.stand_ins(name)
        return bool(own) and set(own) <= set(there)

    @property
    def positions(self) -> tuple[str, ...]:
        """The channels that stand in for others: positions that may be measured in the place of speeds."""
        return tuple(dict.fromkeys(own for name in self.outputs for own in self.stand_ins(name)))

    def with_positions(
        self, names: tuple[str, ...], unit: str, standing_for: tuple[str, ...], mixing: Mapping[str, Any] | None = None
    ) -> "Channels":
        """The same with optional channels that, all together, stand in for the outputs `standing_for`."""
        return replace(
            self,
            optional=(*self.optional, *names),
            units={**self.units, **dict.fromkeys(names, unit)},
            mixing={**self.mixing, **(mixing or {})},
            substitutes={**self.substitutes, **dict.fromkeys(standing_for, names)},
        )

    def __iter__(self) -> Iterator[str]:
        return iter((*self.inputs, *self.measured))

    # Mappings do not hash and their read-only views do not pickle: both are spelled out, so that a Channels can be a
    # static field of an equinox Module and travel to another process.
    def __hash__(self) -> int:
        return hash((self.inputs, self.outputs, self.optional, tuple(sorted(self.mixing.items()))))

    def __reduce__(self) -> tuple[Any, ...]:
        maps = dict(self.units), dict(self.mixing), dict(self.substitutes)
        return Channels, (self.inputs, self.outputs, self.optional, *maps)


_OMNI_UNITS = {"V": "m/s", "Vn": "m/s", "W": "rad/s"} | {f"u{k}": "V" for k in range(1, 5)}

PIONEER = Channels(
    inputs=("V2", "V3"),
    outputs=("eta1", "eta2"),
    units={"V2": "V", "V3": "V", "eta1": "m/s", "eta2": "rad/s"},
    mixing={"eta1": (1, 1), "eta2": (1, -1)},
)
"""Differential drive with a caster (Innocenti et al.): V2 right, V3 left voltage; forward speed, yaw rate."""

PIONEER_ANGLES = PIONEER.with_positions(("phi2", "phi3"), "rad", PIONEER.outputs, {"phi2": (1, 0), "phi3": (0, 1)})
"""The same with the angles of the right and the left driving wheel, beside or in the place of the speeds."""

OMNI = Channels(
    inputs=("u1", "u2", "u3", "u4"),
    outputs=("V", "Vn", "W"),
    optional=("i1", "i2", "i3", "i4"),
    units=_OMNI_UNITS | {f"i{k}": "A" for k in range(1, 5)},
    mixing={"V": (0, -1, 0, 1), "Vn": (1, 0, -1, 0), "W": (1, 1, 1, 1)},
)
"""Four omni wheels (Conceição, Moreira & Costa, signs restored): Fv = f4 - f2, Fvn = f1 - f3, Gamma = b sum f."""

OMNI_ANGLES = OMNI.with_positions(
    ("phi1", "phi2", "phi3", "phi4"),
    "rad",
    OMNI.outputs,
    {"phi1": (2, 1, 0, 1), "phi2": (1, 2, 1, 0), "phi3": (0, 1, 2, 1), "phi4": (1, 0, 1, 2)},
)
"""The same with the angles of the four wheels, beside or in the place of the speeds."""

AXIS = Channels(
    inputs=("u",),
    outputs=("v",),
    optional=("q",),
    units={"u": "V or N", "v": "m/s or rad/s", "q": "m or rad"},
    mixing={"v": (1,)},
    substitutes={"v": "q"},
)
"""One drive axis: voltage or force in; speed v, position q, or both, out."""

DIFFERENTIAL = Channels(
    inputs=("u_right", "u_left"),
    outputs=("v", "w"),
    units={"u_right": "unit of u", "u_left": "unit of u", "v": "m/s", "w": "rad/s"},
    mixing={"v": (1, 1), "w": (1, -1)},
)
"""A plain differential drive that measures its body: commands of the sides in; forward speed, yaw rate to the left out."""

DIFFERENTIAL_WHEELS = Channels(
    inputs=("u_right", "u_left"),
    outputs=("v_right", "v_left"),
    units={"u_right": "unit of u", "u_left": "unit of u", "v_right": "m/s", "v_left": "m/s"},
    mixing={"v_right": (1, 0), "v_left": (0, 1)},
)
"""The same, measured at the wheels' rims."""

DIFFERENTIAL_WAYS = DIFFERENTIAL.with_positions(
    ("way_right", "way_left"), "m", DIFFERENTIAL.outputs, {"way_right": (1, 0), "way_left": (0, 1)}
)
"""The plain differential drive with the ways that its wheels' rims have rolled, beside or in the place of the speeds."""

DIFFERENTIAL_WHEELS_WAYS = replace(
    DIFFERENTIAL_WHEELS,
    optional=DIFFERENTIAL_WAYS.optional,
    units={**DIFFERENTIAL_WHEELS.units, "way_right": "m", "way_left": "m"},
    mixing={**DIFFERENTIAL_WHEELS.mixing, "way_right": (1, 0), "way_left": (0, 1)},
    substitutes={"v_right": "way_right", "v_left": "way_left"},
)
"""The same, of a drive that is measured at its wheels' rims."""

STANDARD = {"pioneer": PIONEER, "omni": OMNI, "axis": AXIS, "differential": DIFFERENTIAL} | {
    "differential_wheels": DIFFERENTIAL_WHEELS
}
"""Layouts of logs by the names that the command line knows."""

BY_COLUMNS: Mapping[str, tuple[Channels, ...]] = MappingProxyType(
    {
        "pioneer": (PIONEER, PIONEER_ANGLES),
        "omni": (OMNI, OMNI_ANGLES),
        "differential": (DIFFERENTIAL, DIFFERENTIAL_WHEELS, DIFFERENTIAL_WAYS),
    }
)
"""Layouts of one robot, of which a log's columns say which one it has: speeds first."""


def layout_of(layouts: tuple[Channels, ...], columns: Collection[str]) -> Channels:
    """The first of the layouts whose outputs, or what stands in for them, are all among the columns; else the first of those of
    which the most outputs are there."""
    for own in layouts:
        if all(name in columns or own.stood_in(name, columns) for name in own.outputs):
            return own
    return max(layouts, key=lambda own: sum(name in columns for name in own.outputs))

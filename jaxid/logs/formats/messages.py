"""ROS messages as numbers: every numeric field under its path, whatever the message's type.

A path is the topic, a dot, and the fields: `/odom.twist.twist.linear.x`. Joints stand under their names,
`/joint_states.velocity[left_wheel]`, transforms under their frames, `/tf[odom->base_link].rotation.yaw`, other arrays under
their indices, `/volts.data[0]`. Besides a quaternion's four numbers there is its `yaw` [rad], the heading of a robot on flat
ground. Left out are covariances, arrays of more than 32 numbers (images, scans) and text.
"""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

LONGEST_ARRAY = 32
_UNITS = (
    ("linear_acceleration", "m/s^2"),
    ("angular_velocity", "rad/s"),
    ("twist.angular", "rad/s"),
    ("twist.linear", "m/s"),
    ("angular", "rad/s"),
    ("linear", "m/s"),
    ("yaw", "rad"),
    ("translation", "m"),
    ("pose.position", "m"),
)
"""Units by the end of a path's fields, the first that fits."""
_JOINT_UNITS = {"position": "rad or m", "velocity": "rad/s or m/s", "effort": "N m or N"}
_BATTERY_UNITS = {"voltage": "V", "current": "A", "temperature": "degC", "charge": "A h", "capacity": "A h"}


class Part(NamedTuple):
    """What one message (or one transform of several) says: numbers by path, the sender's stamp [ns], frame, and what is
    wrong with it, `(path, text)`."""

    names: tuple[str, ...]
    numbers: tuple[float, ...]
    stamp: int | None
    frame: str
    faults: tuple[tuple[str, str], ...] = ()


def _stamp(message: Any) -> int | None:
    """The stamp of a message's header [ns]; None where it has none, or nobody has filled it in."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None:
        return None
    return (int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)) or None


def _frame(message: Any) -> str:
    child = getattr(message, "child_frame_id", "")
    own = getattr(getattr(message, "header", None), "frame_id", "")
    return f"{own} -> {child}" if child and own else own


def yaw(x: float, y: float, z: float, w: float) -> float:
    """Heading [rad] of a unit quaternion, about the vertical: the first of the angles z-y-x."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _walk(prefix: str, value: Any) -> Iterator[tuple[str, float]]:
    """Numbers below `value` with their paths."""
    if isinstance(value, bool | int | float | np.number | np.bool_):
        yield prefix, float(value)
    elif isinstance(value, np.ndarray | list):
        if len(value) <= LONGEST_ARRAY:
            for index, entry in enumerate(value):
                yield from _walk(f"{prefix}[{index}]", entry)
    elif hasattr(value, "__dataclass_fields__"):
        fields = value.__dataclass_fields__
        for name in fields:
            if name in ("header", "layout", "__msgtype__") or name.endswith("covariance") or name.isupper():
                continue
            yield from _walk(f"{prefix}.{name}", getattr(value, name))
        if tuple(name for name in fields if name != "__msgtype__") == ("x", "y", "z", "w"):
            yield f"{prefix}.yaw", yaw(value.x, value.y, value.z, value.w)


def _joints(topic: str, message: Any) -> Part:
    pairs, faults = [], []
    names = [str(name) for name in message.name]
    for field in _JOINT_UNITS:
        values = getattr(message, field)
        if len(values) not in (0, len(names)):
            text = f"a message names {len(names)} joints and has {len(values)} numbers in {field}"
            faults.append((f"{topic}.{field}", text))
        pairs += [(f"{topic}.{field}[{name}]", float(v)) for name, v in zip(names, values, strict=False)]
    return _part(pairs, message, tuple(faults))


def _part(pairs: list[tuple[str, float]], message: Any, faults: tuple[tuple[str, str], ...] = ()) -> Part:
    return Part(tuple(n for n, _ in pairs), tuple(v for _, v in pairs), _stamp(message), _frame(message), faults)


def parts(topic: str, kind: str, message: Any) -> list[Part]:
    """The numbers of one message of type `kind` (such as `sensor_msgs/msg/JointState`)."""
    plain = kind.rpartition("/")[2]
    if plain == "JointState":
        return [_joints(topic, message)]
    if plain in ("TFMessage", "tfMessage"):
        found = []
        for transform in message.transforms:
            place = f"{topic}[{transform.header.frame_id}->{transform.child_frame_id}]"
            found.append(_part(list(_walk(place, transform.transform)), transform))
        return found
    return [_part(list(_walk(topic, message)), message)]


def unit_of(kind: str, path: str) -> str:
    """SI unit of a field of a standard message, empty where its type says none."""
    plain = kind.rpartition("/")[2]
    fields = path.partition(".")[2]
    last = fields.rpartition(".")[2].partition("[")[0]
    if plain == "JointState":
        return _JOINT_UNITS.get(last, "")
    if plain == "BatteryState":
        return _BATTERY_UNITS.get(last, "")
    if fields.startswith("linear_acceleration"):
        return "m/s^2"
    if fields.rpartition(".")[2] == "yaw":
        return "rad"
    if last not in ("x", "y", "z"):
        return ""
    return next((unit for end, unit in _UNITS if fields.rpartition(".")[0].endswith(end)), "")

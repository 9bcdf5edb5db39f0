"""Recordings for the tests, written by the formats' own libraries: rosbags, robotpy-wpiutil, SciPy."""

from pathlib import Path

import numpy as np

START = 1_700_000_000_000_000_000
"""Nanoseconds since 1970 at which the recordings begin."""


def ns(seconds):
    """A time of a recording [ns] from seconds after its start."""
    return START + round(seconds * 1e9)


class Ros:
    """Messages of ROS by short calls: `Ros(1)` or `Ros(2)`."""

    def __init__(self, version=2, extra=()):
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.version = version
        self.store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
        transforms = ("tf2_msgs/msg/TFMessage", "geometry_msgs/TransformStamped[] transforms")
        for name, text in (*extra, *((transforms,) if version == 1 else ())):
            self.store.register(get_types_from_msg(text, name))

    def make(self, kind, **fields):
        return self.store.types[kind](**fields)

    def header(self, time, frame=""):
        stamp = self.make("builtin_interfaces/msg/Time", sec=time // 10**9, nanosec=time % 10**9)
        more = {"seq": 0} if self.version == 1 else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **more)

    def vector(self, x=0.0, y=0.0, z=0.0):
        return self.make("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))

    def heading(self, yaw):
        return self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2))

    def twist(self, v, w):
        return self.make("geometry_msgs/msg/Twist", linear=self.vector(v), angular=self.vector(z=w))

    def odometry(self, time, v, w, x=0.0, y=0.0, yaw=0.0):
        point = self.make("geometry_msgs/msg/Point", x=float(x), y=float(y), z=0.0)
        pose = self.make("geometry_msgs/msg/Pose", position=point, orientation=self.heading(yaw))
        zero = np.zeros(36)
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(time, "odom"),
            child_frame_id="base_link",
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=zero),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=self.twist(v, w), covariance=zero),
        )

    def imu(self, time, rate, acceleration=0.0):
        nine = np.zeros(9)
        return self.make(
            "sensor_msgs/msg/Imu",
            header=self.header(time, "imu"),
            orientation=self.heading(0.0),
            orientation_covariance=nine,
            angular_velocity=self.vector(z=rate),
            angular_velocity_covariance=nine,
            linear_acceleration=self.vector(acceleration, 0.0, 9.81),
            linear_acceleration_covariance=nine,
        )

    def joints(self, time, names, velocity=(), position=(), effort=()):
        arrays = (np.array(values, dtype=float) for values in (position, velocity, effort))
        position, velocity, effort = arrays
        return self.make(
            "sensor_msgs/msg/JointState",
            header=self.header(time),
            name=list(names),
            position=position,
            velocity=velocity,
            effort=effort,
        )

    def transform(self, time, parent, child, x, y, yaw):
        inner = self.make("geometry_msgs/msg/Transform", translation=self.vector(x, y), rotation=self.heading(yaw))
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(time, parent),
            child_frame_id=child,
            transform=inner,
        )

    def transforms(self, *each):
        return self.make("tf2_msgs/msg/TFMessage", transforms=list(each))

    def numbers(self, values):
        layout = self.make("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
        return self.make("std_msgs/msg/Float64MultiArray", layout=layout, data=np.array(values, dtype=float))

    def number(self, value):
        return self.make("std_msgs/msg/Float64", data=float(value))

    def text(self, value):
        return self.make("std_msgs/msg/String", data=value)

    def _bytes(self, message):
        kind = message.__msgtype__
        serialised = self.store.serialize_ros1 if self.version == 1 else self.store.serialize_cdr
        return serialised(message, kind)

    def write(self, path, topics, storage="mcap"):
        """A bag of `topics`, `{name: [(received [ns], message)]}` (or a type's name, for one without messages).

        ROS 1: the file `path`; ROS 2: the folder `path`. Returns the file with the messages.
        """
        path = Path(path)
        if self.version == 1:
            from rosbags.rosbag1 import Writer

            writer = Writer(path)
        else:
            from rosbags.rosbag2 import StoragePlugin
            from rosbags.rosbag2 import Writer as Writer2

            plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
            writer = Writer2(path, version=9, storage_plugin=plugin)
        with writer:
            rows = []
            for number, (topic, messages) in enumerate(topics.items()):
                kind = messages if isinstance(messages, str) else messages[0][1].__msgtype__
                connection = writer.add_connection(topic, kind, typestore=self.store)
                if not isinstance(messages, str):
                    rows += [(time, number, connection, message) for time, message in messages]
            for time, _, connection, message in sorted(rows, key=lambda row: row[:2]):
                writer.write(connection, time, self._bytes(message))
        return path if self.version == 1 else next(path.glob("*.mcap" if storage == "mcap" else "*.db3"))


def write_wpilog(path, entries, structs=()):
    """A WPILib data log of `entries`, `{name: [(seconds, value)]}`: numbers, lists of numbers, text."""
    from wpiutil import DataLogWriter
    from wpiutil import log as kinds

    writer = DataLogWriter(str(path))
    made = {}
    for name, values in entries.items():
        first = values[0][1]
        array = isinstance(first, list | tuple)
        inner = type(first[0]) if array else type(first)
        word = {float: "Double", int: "Integer", bool: "Boolean", str: "String"}[inner] + ("Array" if array else "")
        made[name] = getattr(kinds, f"{word}LogEntry")(writer, name, 1)
    rows = sorted((time, name, value) for name, values in entries.items() for time, value in values)
    for time, name, value in rows:
        made[name].append(value, max(1, round(time * 1e6)))
    writer.flush()
    writer.stop()
    return Path(path)


def write_mat(path, variables):
    """A MATLAB file of version 7."""
    import scipy.io

    scipy.io.savemat(path, variables, do_compression=True)
    return Path(path)

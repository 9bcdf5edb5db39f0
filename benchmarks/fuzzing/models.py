"""Model files and mappings that cannot be right, as text; and a few that only look odd."""

from collections.abc import Callable

import numpy as np

from jaxid.model_file import model_text
from jaxid.robots import Robot

Text = Callable[[Robot, np.random.Generator], str | bytes]


def _names(robot: Robot, positive: bool = False) -> list[str]:
    return [name for name, p in robot.parameters.items() if p.value != 0 and (p.lower >= 0 or not positive)]


def _entry(line: str, positive: bool = False) -> Text:
    """A table of one of the robot's parameters with these lines; {value} is its own, {name} its name."""

    def make(robot: Robot, rng: np.random.Generator) -> str:
        name = str(rng.choice(_names(robot, positive)))
        return f'[parameters."{name}"]\n' + line.replace("{value}", repr(robot.parameters[name].value)).replace(
            "{name}", name
        )

    return make


def _text(text: str | bytes) -> Text:
    return lambda robot, rng: text


def _other(robot: Robot) -> str:
    return "omni" if robot.name != "omni" else "axis"


_BAD_VALUES = {
    "NaN": "nan",
    "infinite": "inf",
    "text": '"big"',
    "number as text": '"0.3"',
    "truth value": "true",
    "date": "2024-05-01",
    "list": "[0.3]",
    "table": "{ a = 1 }",
    "400 digits": "1" + "0" * 400,
    "5000 digits": "9" * 5000,
    "1e300": "1e300",
    "1e-300": "1e-300",
    "1e400": "1e400",
    "nested table": "{ value = 1 }",
}

BROKEN: dict[str, Text] = {
    **{f"value: {name}": _entry(f"value = {text}") for name, text in _BAD_VALUES.items()},
    **{
        f"lower bound: {n}": _entry(f"lower = {t}")
        for n, t in _BAD_VALUES.items()
        if n not in ("infinite", "1e400", "1e-300")
    },
    "lower bound infinite": _entry("lower = inf"),
    "upper bound: NaN": _entry("upper = nan"),
    "upper bound: minus infinity": _entry("upper = -inf"),
    "negative": _entry("value = -{value}", positive=True),
    "negative zero side": _entry("lower = -1", positive=True),
    "lower above upper": _entry("lower = 2e3\nupper = 1e3\nvalue = 1.5e3"),
    "bounds equal": _entry("lower = {value}\nupper = {value}"),
    "value below its bounds": _entry("lower = 1e6\nupper = 1e7"),
    "value above its bounds": _entry("value = 10\nlower = 0\nupper = 1"),
    "prior without deviation": _entry("prior = [0.3]"),
    "prior of three": _entry("prior = [0.3, 0.1, 0.1]"),
    "prior a number": _entry("prior = 0.3"),
    "prior's deviation zero": _entry("prior = [0.3, 0]"),
    "prior's deviation negative": _entry("prior = [0.3, -0.1]"),
    "prior's deviation NaN": _entry("prior = [0.3, nan]"),
    "prior's deviation tiny": _entry("prior = [0.3, 1e-300]"),
    "prior's mean infinite": _entry("prior = [inf, 0.1]"),
    "free as text": _entry('free = "yes"'),
    "free as number": _entry("free = 1"),
    "unit wrong": _entry('unit = "furlong"'),
    "unit a number": _entry("unit = 3"),
    "unknown key": _entry("vlaue = 1"),
    "unknown key of many characters": _entry(f'"{"x" * 100000}" = 1'),
    "unknown key of two lines": _entry('"a\\nb" = 1'),
    "nested junk": _entry("value = { a = [{ b = [[1, { c = 2 }]] }] }"),
    "value twice": _entry("value = {value}\nvalue = {value}"),
    "table twice": _entry('value = {value}\n[parameters."{name}"]\nfree = true'),
    "unknown parameter": _text("[parameters]\nmas = 1"),
    "unknown parameter of two lines": _text('[parameters]\n"a\\nb" = 1'),
    "empty name": _text('[parameters]\n"" = 1'),
    "parameter outside of its table": lambda robot, rng: f'"{_names(robot)[0]}" = 1',
    "unknown section": _text("[parametres]\nM = 1"),
    "parameters a number": _text("parameters = 3"),
    "parameters a list": _text("[[parameters]]\nM = 1"),
    "another robot's": lambda robot, rng: f'robot = "{_other(robot)}"\n',
    "another robot's parameters": _text("[parameters]\nno_such_inertia = 1\n"),
    "robot a list": lambda robot, rng: f'robot = ["{robot.name}"]',
    "robot is code": _text('robot = "os:system"'),
    "unknown effect": _text('[[effects]]\nid = "motor_lagg"'),
    "effect is code": _text('[[effects]]\nid = "os:getcwd"'),
    "effect twice": _text('[[effects]]\nid = "motor_lag"\n[[effects]]\nid = "motor_lag"'),
    "effect without id": _text('[[effects]]\nname = "motor_lag"'),
    "effects a text": _text('effects = "motor_lag"'),
    "effect's id of two lines": _text('[[effects]]\nid = "a\\nb"'),
    "effect's unknown parameter": _text('[[effects]]\nid = "motor_lag"\n[parameters]\n"motor_lag.x" = 1'),
    "not TOML": _text("M: 16\nCs: 0.3\n"),
    "JSON": _text('{"robot": "pioneer"}'),
    "YAML tag that runs code": _text("!!python/object/apply:os.system ['true']\n"),
    "pickle": _text(b"\x80\x04\x95\x1d\x00\x00\x00\x00\x00\x00\x00\x8c\x05posix\x94\x8c\x06system\x94\x93\x94."),
    "binary": _text(bytes(range(256))),
    "zeros": _text(bytes(1000)),
    "UTF-16": lambda robot, rng: model_text(robot).encode("utf-16"),
    "brackets nested 100,000 deep": _text("a = " + "[" * 100000),
    "tables nested 5,000 deep": _text("a = " + "{ a = " * 5000),
    "string never closed": _text('robot = "pioneer'),
    "random bytes": lambda robot, rng: rng.integers(0, 256, 2000, dtype=np.uint8).tobytes(),
    "cut in a string": lambda robot, rng: model_text(robot)[: model_text(robot).index('"') + 2],
}
"""Each must be refused."""

ODD: dict[str, Text] = {
    "as written": lambda robot, rng: model_text(robot),
    "empty": _text(""),
    "comments only": _text("# nothing\n"),
    "empty tables": _text("[parameters]\n"),
    "byte-order mark": lambda robot, rng: b"\xef\xbb\xbf" + model_text(robot).encode(),
    "CRLF": lambda robot, rng: model_text(robot).replace("\n", "\r\n"),
    "remarks ignored": _entry('value = {value}\nmeaning = "Größe"\nstd_error = nan'),
}
"""Each leaves the robot as it is."""

BROKEN_MAPPINGS: dict[str, str | bytes] = {
    "unknown name": 'eta9 = "speed"',
    "column not there": 'eta1 = "speed"',
    "a number": "eta1 = 3",
    "a list": 'eta1 = ["eta1"]',
    "unknown entry": 'eta1 = { column = "eta1", factor = 2 }',
    "scale as text": 'eta1 = { scale = "2" }',
    "scale zero": "eta1 = { scale = 0 }",
    "scale NaN": "eta1 = { scale = nan }",
    "scale infinite": "eta1 = { scale = inf }",
    "scale of 400 digits": "eta1 = { scale = 1" + "0" * 400 + " }",
    "scale 1e300": "eta1 = { scale = 1e300 }",
    "scale 1e-300": "eta1 = { scale = 1e-300 }",
    "input's scale 1e300": "V2 = { scale = 1e300 }",
    "scale 1000": "eta1 = { scale = 1000 }",
    "scale -1": "eta1 = { scale = -1 }",
    "offset 100": "eta1 = { offset = 100 }",
    "offset of 400 digits": "eta1 = { offset = 1" + "0" * 400 + " }",
    "interval zero": "t = { interval = 0 }",
    "interval negative": "t = { interval = -0.02 }",
    "interval 1e300": "t = { interval = 1e300 }",
    "interval 1e-300": "t = { interval = 1e-300 }",
    "interval of milliseconds": "t = { interval = 20 }",
    "interval and column": 't = { interval = 0.02, column = "t" }',
    "interval of an output": "eta1 = { interval = 0.02 }",
    "two outputs from one column": 'eta1 = "eta2"',
    "output from an input": 'eta1 = "V2"',
    "time from an output": 't = "eta1"',
    "wheels swapped": 'V2 = "V3"\nV3 = "V2"',
    "outputs swapped": 'eta1 = "eta2"\neta2 = "eta1"',
    "a name twice": 'V2 = "V2"\nV2 = "V3"',
    "nested junk": "eta1 = { column = { column = [1] } }",
    "not TOML": "V2: right",
    "binary": bytes(range(256)),
    "zeros": bytes(100),
    "brackets nested 100,000 deep": "V2 = " + "[" * 100000,
    "5000 digits": "V2 = { scale = " + "9" * 5000 + " }",
    "name of many characters": f'"{"x" * 100000}" = "V2"',
    "name of two lines": '"a\\nb" = "V2"',
    "entry of two lines": 'V2 = "a\\nb"',
    "entry of many characters": f'V2 = "{"x" * 100000}"',
    "entry a long list": f"V2 = [{'1, ' * 50000}]",
}
"""For a Pioneer's log that has the standard names: each must be refused or found."""

ODD_MAPPINGS: dict[str, str | bytes] = {
    "empty": "",
    "byte-order mark": b"\xef\xbb\xbfV2 = 'V2'",
    "names to themselves": 'V2 = "V2"\neta1 = { column = "eta1", scale = 1 }',
}
"""Each leaves the log as it is."""

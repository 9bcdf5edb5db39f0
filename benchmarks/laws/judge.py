"""What counts as right: mechanisms, and the sets of names that stand for one and the same."""

from typing import Any

from reference.law_table import LAWS

Entry = dict[str, Any]

SAME = {
    "asymmetric_friction/with_viscous": {"asymmetric_viscous_friction"},  # both are hidden
    "sublinear_viscous_friction/cubic": {"quadratic_drag"},  # faster than linear: laws.md has both in one row
    "quadratic_drag/cubic": {"sublinear_viscous_friction"},
    "motor_lag/drawn": {"input_delay"},  # a step response without a formula
    "sensor_lag/moving_average": {"sensor_delay"},
    "sensor_lag/drawn": {"sensor_delay"},
    "freewheeling_driver/below": {"actuator_dead_zone"},  # the command map near zero
}
"""Names beside the mechanism's own that are right for a law."""
ROWS = (
    {"asymmetric_friction", "asymmetric_viscous_friction"},
    {"sublinear_viscous_friction", "quadratic_drag"},
    {"actuator_dead_zone", "voltage_saturation", "freewheeling_driver"},
    {"motor_lag", "input_delay", "sensor_lag", "sensor_delay"},
    {"ground_slope", "surface_change"},
    {"sensor_bias", "sensor_scale", "sensor_cross_talk"},
    {"stribeck_friction", "load_dependent_friction"},
)
"""Neighbours: names that lead to the right place of the robot, if not to the right part."""
KNOWN_AS = {
    "stribeck_friction/root": {"exponent_one_half"},
    "stribeck_friction/relative": {"share_of_coulomb"},
    "stribeck_friction/one_wheel": {"per_wheel", "per_axis"},
    "traction_limit/one_wheel": {"per_wheel"},
    "asymmetric_friction/one_wheel": {"per_axis", "per_wheel"},
    "asymmetric_friction/mirrored": {"per_axis", "per_wheel"},
    "asymmetric_viscous_friction/one_wheel": {"per_axis", "per_wheel"},
    "asymmetric_viscous_friction/mirrored": {"per_axis", "per_wheel"},
    "quadratic_drag/one_axis": {"per_axis"},
    "actuator_dead_zone/unequal": {"unequal_edges"},
    "actuator_dead_zone/one_motor": {"per_motor"},
    "voltage_saturation/unequal": {"unequal_limits"},
    "battery_sag/total_current": {"sum_of_currents"},
    "battery_sag/recovery": {"with_recovery"},
    "battery_sag/charge": {"discharge"},
    "motor_heating/cooling": {"with_cooling"},
    "motor_lag/one_motor": {"per_motor", "per_input"},
    "motor_lag/slew": {"ramp"},
    "input_delay/one_motor": {"per_motor", "per_input"},
    "sensor_lag/one_channel": {"per_channel"},
    "sensor_delay/one_channel": {"per_channel"},
    "sensor_scale/one_direction": {"by_direction"},
    "load_dependent_friction/level": {"share_of_torque"},
    "load_dependent_friction/efficiency": {"driving_and_driven"},
    "turning_friction/coulomb_viscous": {"coulomb_and_viscous"},
    "turning_friction/scrub": {"by_turn_radius"},
    "effective_track/by_direction": {"by_direction"},
    "ground_slope/bowl": {"curved"},
}
"""What an explanation calls a law, where it is not the law's own name; a drawn curve's is "shape"."""
UNLISTED = {
    "asymmetric_friction/with_viscous",
    "ground_slope/two_planes",
    "cogging_torque/by_current",
    "sensor_bias/warming",
    "freewheeling_driver/below",
    "freewheeling_driver/no_braking",
    "stribeck_friction/lugre",
    "traction_limit/creep",
    "sensor_cross_talk/misaligned",
    "sensor_cross_talk/rotated",
    "motor_cross_talk/one_way",
    "motor_cross_talk/mutual",
    "payload_change/leaking",
    "effective_track/wider",
    "backlash/command",
    "wheel_radius_mismatch/one_wheel",
}
"""Laws whose name is not asked for: no common name, or the only one of their mechanism."""
CONSTANTS = "table_constants"
"""What stands among the names where wrong constants of the table would do the same; right where they are wrong."""


def accepted(law: str) -> set[str]:
    """Names that are right for a hidden law."""
    return {law.split("/")[0]} | SAME.get(law, set())


def answers(entry: Entry) -> list[set[str]]:
    """For every named effect the set of ids it was declared as."""
    return [{name, *entry["equivalent"].get(name, [])} for name in entry["named"]]


def names_right(entry: Entry) -> bool:
    """Every hidden law has a name, and every name a hidden law."""
    found = answers(entry)
    wanted = [accepted(law) for law in entry["hidden"]]
    found = [
        ids for ids in found if not (entry.get("off") and CONSTANTS in ids) or any(ids & right for right in wanted)
    ]
    return (
        bool(found)
        and all(any(ids & right for ids in found) for right in wanted)
        and all(any(ids & right for right in wanted) for ids in found)
    )


def right(entry: Entry) -> bool:
    """The names are right and believed; nothing hidden: adequate."""
    if not entry["hidden"]:
        named = entry["verdict"] in ("named", "ambiguous") and bool(entry["named"])
        return entry["verdict"] == "adequate" or (named and not wrong_as_fact(entry))
    return entry["verdict"] in ("named", "ambiguous") and names_right(entry)


def wrong_as_fact(entry: Entry) -> bool:
    """A believed name that is no hidden mechanism's."""
    everything = set().union(*(accepted(law) for law in entry["hidden"]), {CONSTANTS} if entry.get("off") else set())
    return entry["verdict"] in ("named", "ambiguous") and not all(ids & everything for ids in answers(entry))


def near(entry: Entry) -> bool:
    """A believed wrong name that is a neighbour of a hidden mechanism."""
    rows = [row for law in entry["hidden"] for row in ROWS if law.split("/")[0] in row]
    everything = set().union(*(accepted(law) for law in entry["hidden"]), *rows, set())
    return wrong_as_fact(entry) and all(ids & everything for ids in answers(entry))


def visible(entry: Entry) -> bool:
    """Whether what is hidden shows on the held-out logs."""
    return entry["before"] > 1.1


def closed(entry: Entry) -> float:
    """Share of the gap between baseline and noise that the answer closed."""
    return (entry["before"] - entry["after"]) / (entry["before"] - 1.0)


def sort(law: str) -> str:
    """What sort of law it is: with a common name, without one, or a drawn curve."""
    if law.endswith("/drawn"):
        return "drawn curves"
    return "laws without a common name" if law in UNLISTED else "laws with a name"


def law_right(entry: Entry) -> bool | None:
    """Whether the hidden law is the one told or among those told to be alike; None where none is told or asked for."""
    laws = list(entry["hidden"])
    told = {law for ids in entry["laws"].values() for law in ids or ()}
    if len(laws) != 1 or laws[0] in UNLISTED or not told or not names_right(entry):
        return None
    word = laws[0].split("/")[1]
    return bool(told & KNOWN_AS.get(laws[0], {"shape" if word == "drawn" else word}))


def outcome(entry: Entry) -> str:
    """A case in a word."""
    if "error" in entry or "unseen" in entry:
        return "error" if "error" in entry else "does not show"
    if right(entry):
        return "right"
    if wrong_as_fact(entry):
        return "neighbour named" if near(entry) else "wrong name"
    if entry["hidden"] and names_right(entry):
        return "right, not believed"
    if entry["hidden"] and any(ids & accepted(law) for ids in answers(entry) for law in entry["hidden"]):
        return "right among others"
    return entry["verdict"]


assert set(SAME) | set(KNOWN_AS) | UNLISTED <= set(LAWS)

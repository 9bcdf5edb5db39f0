"""jaxid/explanation/not_looked_for.py: a robot that keeps something to itself is told which effects that hides."""

from dataclasses import replace

from jaxid import Channels, Custom, DriveAxis, Parameter, Pioneer
from jaxid.explanation.not_looked_for import not_looked_for


def cart(**declared) -> Custom:
    return Custom(
        dynamics=lambda s, u, p: {"v": (u["u"] - p["b"] * s["v"]) / p["m"]},
        state_names=("v",),
        own_channels=Channels(inputs=("u",), outputs=("v",)),
        table={"m": Parameter(2.0, free=True), "b": Parameter(0.5, free=True)},
        title="cart",
        **declared,
    )


def test_effects_that_a_declaration_would_admit_are_named_with_it():
    found = not_looked_for(cart())
    assert "'cart'" in found and "quadratic drag (`forces=`)" in found
    assert "input delay" not in found and "sensor bias" not in found  # any robot can have these
    assert "motor gain mismatch" not in found  # with one motor there is none
    assert "quadratic drag" not in not_looked_for(cart(forces={"v": "m"}))


def test_what_was_declared_is_not_asked_for_again():
    found = not_looked_for(cart(forces={"v": "m"}))
    assert "ground slope (plane) (`plane=`, `mass=`)" in found  # along a line it is looked for
    driven = cart(axes={"wheel": DriveAxis("v", torque=lambda s, u, p: u["u"])}, forces={"v": "m"})
    assert "cogging torque (`axes=` with `angle`)" in not_looked_for(driven)


def test_dry_friction_that_a_robot_has_not_and_cannot_have_is_named():
    driven = DriveAxis("v", torque=lambda s, u, p: u["u"])
    bare = not_looked_for(cart(axes={}, forces={"v": "m"}))
    assert "dry friction (`axes=` with `coulomb`, or `dry_friction=`)" in bare and "Coulomb friction" in bare
    # With a drive axis it is an effect that is looked for.
    said = not_looked_for(cart(axes={"wheel": driven}, forces={"v": "m"}))
    assert "dry friction" not in said and "Coulomb friction" not in said
    assert "dry friction" not in not_looked_for(cart(axes={"wheel": replace(driven, coulomb="b")}, forces={"v": "m"}))
    assert "dry friction" not in not_looked_for(cart(dry_friction={"wheel": ("v", "b")}, forces={"v": "m"}))


def test_what_a_built_in_robot_lacks_it_cannot_have():
    assert not_looked_for(Pioneer()) == ""


def test_mechanisms_that_take_a_parameter_of_the_robot_s_own_are_named_where_its_motion_admits_them():
    table = {"m": Parameter(2.0, free=True), "b": Parameter(0.5, free=True), "J": Parameter(0.1, free=True)}

    def moving(*names, **declared):
        return Custom(
            dynamics=lambda s, u, p: {name: u["u"] - p["b"] * s[name] for name in names},
            state_names=names,
            own_channels=Channels(inputs=("u",), outputs=names),
            table=table,
            forces={name: "J" if name == "w" else "m" for name in names},
            turning="w" if "w" in names else "",
            title="base",
            **declared,
        )

    along, turns, sideways = (not_looked_for(moving(*names)) for names in (("v",), ("v", "w"), ("v", "side", "w")))
    assert "payload change (`mechanisms=`)" in along and "wheel radius mismatch" not in along
    assert "wheel radius mismatch" in turns and "Coriolis coupling" not in turns
    assert "Coriolis coupling" in sideways and "(`mechanisms=`)" in sideways
    said = not_looked_for(moving("v", "w", mechanisms={"payload_change": ("m", "J"), "effective_track": ("b",)}))
    assert "payload change" not in said and "effective track" not in said and "wheel radius mismatch" in said

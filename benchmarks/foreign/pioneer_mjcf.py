"""The Pioneer as a MuJoCo model: body on a free joint, two driven wheels, a caster's fork and wheel, contacts with a floor.

Body frame as in jaxid: x to the right, y forward, origin midway between the driving wheels at the height of their axle.
What jaxid's equations assume, the engine has to bring about: wheels are thin ellipsoids that touch the floor at one point
each, and roll because contact friction holds them. Constants in SI units under the paper's symbols. Keywords of the format:
https://mujoco.readthedocs.io/en/stable/XMLreference.html
"""

from collections.abc import Mapping
from dataclasses import dataclass

GRAVITY = 9.81


@dataclass(frozen=True)
class World:
    """What the model knows nothing of.

    Contact friction coefficient `grip`; `torsion` [m], the contact's friction against turning on the spot as a length
    (MuJoCo's torsional friction), 0 for none; `contact_time` [s], the time constant of the contacts and of the dry
    friction, larger is softer; `slope_x`, `slope_y`, gravity along the floor's x and y in units of g; `extra_loss` [N m],
    dry friction of the right driving wheel beyond the left one's; `shift` [m], centre of mass moved to the right; `height`
    [m], the body's centre of mass above the axle, which says how load moves between the wheels and when one lifts.
    `timestep` [s] is the engine's; the contacts' time constant has to be twice it or more.
    """

    grip: float = 0.9
    torsion: float = 0.0
    contact_time: float = 0.002
    slope_x: float = 0.0
    slope_y: float = 0.0
    extra_loss: float = 0.0
    shift: float = 0.0
    height: float = 0.0
    timestep: float = 0.0005


THIN = 0.004
"""Half the width of a wheel [m]: an ellipsoid, so that it touches at one point whatever it leans."""


def _spin(name: str, mass: float, radius: float, spin: float, upright: float, joint: str = "") -> str:
    """Joint, inertia and contact of a wheel; turning about -x rolls it forwards.

    Both inertias across the axle are the upright one: the wheel's axes turn with it. No solid disc has more than twice
    that about its axle, so what is beyond is the rotor's (the joint's armature), which adds to the spin alone.
    """
    solid = min(spin, 2.0 * upright)
    return f"""<joint name="{name}" type="hinge" axis="-1 0 0" armature="{spin - solid:.9g}" {joint}/>
        <inertial pos="0 0 0" mass="{mass:.9g}" diaginertia="{solid:.9g} {upright:.9g} {upright:.9g}"/>
        <geom name="{name}" type="ellipsoid" size="{THIN} {radius:.9g} {radius:.9g}"/>"""


def _wheel(name: str, p: Mapping[str, float], x: float, loss: float) -> str:
    rubbing = f'damping="{p["Cv"]:.9g}" frictionloss="{loss:.9g}"'
    return f"""<body name="{name}" pos="{x:.9g} 0 0">
        {_spin(name, p["m"], p["R"], p["Ir"], p["Ip"], rubbing)}
      </body>"""


def _motor(name: str, p: Mapping[str, float]) -> str:
    # Eq. 28: tr mu KT (V - KE tr w) / Ra. The motor's own friction is in the joint's friction loss.
    gain = p["tr"] * p["mu"] * p["KT"] / p["Ra"]
    back = gain * p["KE"] * p["tr"]
    return (
        f'<general name="{name}" joint="{name}" gaintype="fixed" gainprm="{gain:.9g}" biastype="affine" '
        f'biasprm="0 0 {-back:.9g}"/>'
    )


def mjcf(p: Mapping[str, float], world: World | None = None) -> str:
    """The XML of the robot with constants `p` in `world`. Actuators `right` and `left` take volts."""
    world = world or World()
    loss = p["Cs"] + p["tr"] * p["mu"] * p["tau_fr"]
    soft = f"{world.contact_time:.9g} 1"
    dims, torsion = (4, world.torsion) if world.torsion > 0 else (3, 0.0)
    return f"""<mujoco model="pioneer">
  <compiler angle="radian" balanceinertia="false"/>
  <option timestep="{world.timestep:.9g}" integrator="implicitfast" cone="elliptic" impratio="100" solver="Newton"
    iterations="50" tolerance="1e-12" gravity="{GRAVITY * world.slope_x:.9g} {GRAVITY * world.slope_y:.9g} {-GRAVITY}"/>
  <default>
    <geom condim="{dims}" friction="{world.grip:.9g} {torsion:.9g} 0" solref="{soft}" solimp="0.98 0.999 0.0005"
      contype="0" conaffinity="1"/>
    <joint solreffriction="{soft}" solimpfriction="0.999 0.999 0.001"/>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" contype="1" conaffinity="0"/>
    <body name="robot" pos="0 0 {p["R"]:.9g}">
      <freejoint/>
      <inertial pos="{p["xm"] + world.shift:.9g} {p["ym"]:.9g} {world.height:.9g}" mass="{p["M"]:.9g}"
        diaginertia="{0.6 * p["I0"]:.9g} {0.6 * p["I0"]:.9g} {p["I0"]:.9g}"/>
      {_wheel("right", p, p["L"], loss + world.extra_loss)}
      {_wheel("left", p, -p["L"], loss)}
      <body name="fork" pos="0 {-p["l1"]:.9g} 0">
        <joint name="pivot" type="hinge" axis="0 0 1" damping="{p["Cv1"]:.9g}" frictionloss="{p["Cs1"]:.9g}"/>
        <inertial pos="0 0 0" mass="1e-4" diaginertia="1e-8 1e-8 1e-8"/>
        <body name="caster" pos="0 {-p["d"]:.9g} {p["R1"] - p["R"]:.9g}">
          {_spin("caster", p["m1"], p["R1"], p["Ir1"], p["Ip1"])}
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    {_motor("right", p)}
    {_motor("left", p)}
  </actuator>
</mujoco>
"""

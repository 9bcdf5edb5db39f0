"""`mujoco.sysid` on the pendulum of `other_robots`, as its documentation shows it.

MuJoCo's hinge with armature, damping and a point mass hanging from it has the pendulum's equation: inertia = armature + mass
lever² + the body's own, weight = mass g lever; its Runge-Kutta integrator takes the same steps. Parameters are armature, mass
and damping; derivatives are `mujoco.sysid`'s finite differences, the solver its own default.
"""

import contextlib
import io
from typing import Any

import numpy as np

from .other_robots import OFF, PENDULUM, OtherProblem

LEVER, GRAVITY, OWN = 0.2, 9.81, 1e-6
"""Metres, m/s², and the body's own inertia, kg m², which MuJoCo wants above zero."""
_XML = """
<mujoco>
  <option timestep="{step}" integrator="RK4" gravity="0 0 -{gravity}"><flag contact="disable"/></option>
  <worldbody>
    <body name="bob">
      <joint name="hinge" type="hinge" axis="0 1 0" damping="{damping}" armature="{armature}"/>
      <inertial pos="0 0 -{lever}" mass="{mass}" diaginertia="{own} {own} {own}"/>
    </body>
  </worldbody>
  <actuator><motor name="u" joint="hinge" gear="1"/></actuator>
  <sensor><jointpos name="q" joint="hinge"/><jointvel name="w" joint="hinge"/></sensor>
</mujoco>
"""


def absent() -> str | None:
    """Why this row is left out, or None."""
    try:
        from mujoco import sysid
    except ImportError:
        return "not installed: pip install 'mujoco[sysid]>=4'"
    return None if hasattr(sysid, "optimize") else "its requirements are not installed: pip install 'mujoco[sysid]>=4'"


def _of(theta: dict[str, float]) -> dict[str, float]:
    """MuJoCo's numbers of the pendulum's."""
    mass = theta["weight"] / (GRAVITY * LEVER)
    return {"mass": mass, "damping": theta["friction"], "armature": theta["inertia"] - mass * LEVER**2 - OWN}


def fit(problem: OtherProblem) -> tuple[np.ndarray, int]:
    """The parameters over the truth, and the solver's iterations."""
    import mujoco
    from mujoco import sysid

    start = _of({name: OFF * value for name, value in PENDULUM.items()})
    xml = _XML.format(step=problem.interval, gravity=GRAVITY, lever=LEVER, own=OWN, **start)
    spec = mujoco.MjSpec.from_string(xml)
    model = spec.compile()
    data = mujoco.MjData(model)
    begin = sysid.create_initial_state(model, data.qpos, data.qvel, data.act)
    params = sysid.ParameterDict()

    def mass(s: Any, p: Any) -> None:
        s.body("bob").mass = p.value[0]

    def damping(s: Any, p: Any) -> None:
        s.joint("hinge").damping[0] = p.value[0]  # the linear one of a polynomial

    def armature(s: Any, p: Any) -> None:
        s.joint("hinge").armature = p.value[0]

    for name, modifier in (("mass", mass), ("damping", damping), ("armature", armature)):
        size = start[name]
        params.add(sysid.Parameter(name, size, 0.2 * size, 5 * size, modifier=modifier))
    logs = list(problem.logs)
    times = logs[0].time

    def weighted(params: Any, predicted: Any, measured: Any, model: Any, everything: bool, state: Any) -> Any:
        """The common residual, from the states that each step ends in; the first sample does not depend on parameters."""
        return (state[:, 1:3] - measured.data[1:]) / problem.sigma, predicted, measured

    sequences = sysid.ModelSequences(
        "pendulum",
        spec,
        [f"run {e}" for e in range(len(logs))],
        [begin] * len(logs),
        [sysid.TimeSeries(times, log.inputs) for log in logs],
        [sysid.TimeSeries.from_names(times, log.outputs, model) for log in logs],
    )
    residual = sysid.build_residual_fn(
        models_sequences=[sequences], modify_residual=weighted, n_threads=1, resample_true=False
    )
    with contextlib.redirect_stdout(io.StringIO()) as said:
        found, _ = sysid.optimize(initial_params=params, residual_fn=residual, verbose=False)
    m, damped, a = (float(found[name].value[0]) for name in ("mass", "damping", "armature"))
    theta = {"inertia": a + m * LEVER**2 + OWN, "weight": m * GRAVITY * LEVER, "friction": damped}
    steps = said.getvalue().count("iter:")
    return np.array([theta[name] / PENDULUM[name] for name in PENDULUM]), steps

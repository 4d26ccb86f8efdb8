"""mujoco.sysid: armature, damping, spring, dry friction and weight of a joint, by its own least squares."""

import mujoco
import numpy as np
from common import NotApplicable, PeerCase, PeerResult
from mujoco import sysid

PARTS = 4
"""Steps of the simulation in a sample."""
ARM = 1e-4
"""m, of the weight: so short that the weight has no inertia of its own."""
XML = """<mujoco><option timestep="{step}" integrator="implicitfast"><flag contact="disable"/></option>
<worldbody><body name="link">
<inertial pos="0 0 -{arm}" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/>
<joint name="joint" type="{kind}" axis="1 0 0" armature="{inertia}" damping="{damping}"
stiffness="{stiffness}" frictionloss="{friction}"/></body></worldbody>
<actuator><motor name="motor" joint="joint"/></actuator>
<sensor><jointpos name="position" joint="joint"/><jointvel name="velocity" joint="joint"/></sensor>
</mujoco>"""
MODIFIED = {"inertia": "armature", "damping": "damping", "stiffness": "stiffness", "friction": "frictionloss"}


def mujoco_sysid(case: PeerCase) -> PeerResult:
    """Fit what the case states, and dry friction."""
    if case.meta["physics"] not in ("sea", "drive", "joint"):
        raise NotApplicable("no joint of MuJoCo: a hardening spring or no physics at all")
    stated = {"damping": 0.0, "stiffness": 0.0, "gravity": 0.0, **case.meta["stated"]}
    start = {n: stated[n] for n in ("inertia", "damping", "stiffness")}
    start["friction"] = 0.01 * case.meta["torque"]
    spec = mujoco.MjSpec.from_string(_xml(case, start, stated["gravity"]))
    model = spec.compile()
    data = mujoco.MjData(model)
    fine = np.repeat(case.u, PARTS)[:, None]
    times = np.arange(len(fine)) * model.opt.timestep
    state = sysid.create_initial_state(model, data.qpos, data.qvel, data.act)
    used = case.split * PARTS
    measured = _measure(case, model)
    controls = sysid.TimeSeries(times[:used], fine[:used])
    group = sysid.ModelSequences("case", spec, "train", state, controls, measured)
    optimum, _ = sysid.optimize(
        initial_params=_parameters(start, stated["gravity"]), optimizer="mujoco", verbose=False,
        residual_fn=sysid.build_residual_fn(models_sequences=[group], n_threads=1),
    )  # fmt: skip
    values = {name: float(optimum[name].value[0]) for name in optimum.keys()}  # noqa: SIM118
    run = _run(_xml(case, values, values.get("gravity", 0.0)), fine)
    q, v = run[PARTS - 1 :: PARTS].T
    is_sea = case.meta["physics"] == "sea"
    y = values["stiffness"] * q + stated["spring_damping"] * v if is_sea else q
    return PeerResult(y[case.split :], values)


def _xml(case: PeerCase, values: dict[str, float], gravity: float) -> str:
    kind = "slide" if case.meta["physics"] == "drive" else "hinge"
    shown = {n: values.get(n, 0.0) for n in MODIFIED}
    mass = max(gravity / (9.81 * ARM), 1e-6)
    return XML.format(step=case.period / PARTS, kind=kind, arm=ARM, mass=mass, **shown)


def _parameters(start: dict[str, float], gravity: float):
    parameters = sysid.ParameterDict()
    for name, field in MODIFIED.items():
        if start[name] > 0.0:
            modifier = _setter(field)
            low, high = (0.05, 20.0) if name != "friction" else (0.0, 100.0)
            value = start[name]
            parameters.add(sysid.Parameter(name, value, low * value, high * value, modifier=modifier))
    if gravity > 0.0:

        def weigh(spec, p):
            spec.body("link").mass = p.value[0] / (9.81 * ARM)

        parameters.add(sysid.Parameter("gravity", gravity, 0.1 * gravity, 10.0 * gravity, modifier=weigh))
    return parameters


def _setter(field: str):
    def modifier(spec, p):
        joint = spec.joint("joint")
        now = getattr(joint, field)
        if np.ndim(now):
            now[0] = p.value[0]
        else:
            setattr(joint, field, p.value[0])

    return modifier


def _measure(case: PeerCase, model):
    """Return the position, and the velocity where it is measured, at the ends of the samples."""
    times = (np.arange(case.split) + 1) * case.period
    position = case.position[: case.split] if case.position.size else case.y[: case.split]
    velocity = case.velocity[: case.split] if case.velocity.size else np.gradient(position, case.period)
    return sysid.TimeSeries.from_names(times, np.column_stack([position, velocity]), model)


def _run(xml: str, controls):
    """Return position and velocity after every step, shape (n, 2)."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    out = np.zeros((len(controls), 2))
    for k, control in enumerate(controls):
        data.ctrl[0] = control[0]
        mujoco.mj_step(model, data)
        out[k] = data.qpos[0], data.qvel[0]
    return out

"""The Pinocchio model has MuJoCo's mass matrix, bias force and kinematics."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from fbid_gym.dynamics import frames
from fbid_gym.dynamics.pinocchio_model import pinocchio_model
from fbid_gym.errors import RobotError
from tests.dynamics.models import ASSETS, random_mjcf, random_states, relative_error

MODELS = [*range(12), "humanoid.xml", "humanoidstandup.xml", "ant.xml"]
AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@pytest.fixture(scope="module", params=MODELS)
def model(request):
    if isinstance(request.param, int):
        return mujoco.MjModel.from_xml_string(random_mjcf(request.param))
    return mujoco.MjModel.from_xml_path(str(ASSETS / request.param))


@pytest.fixture(scope="module")
def states(model):
    return list(zip(*random_states(model, 3), strict=True))


def to_pinocchio(model, qpos, qvel):
    rotation = frames.quaternion_to_matrix(qpos[3:7])
    q = frames.configuration_to_pinocchio(qpos, model.qpos0)
    v, a = frames.velocity_to_pinocchio(qvel, rotation), frames.velocity_product(qvel, rotation)
    return q, v, a, rotation


def test_bodies_are_mujocos(model, states):
    """Pose, Jacobian and acceleration at vdot = 0 of every body, welded and static ones too."""
    pin_model = pinocchio_model(model)
    pin_data = pin_model.createData()
    data = mujoco.MjData(model)
    jacobian, rate = np.zeros((6, model.nv)), np.zeros((6, model.nv))
    for data.qpos[:], data.qvel[:] in states:
        mujoco.mj_forward(model, data)
        q, v, a, rotation = to_pinocchio(model, data.qpos, data.qvel)
        pin.computeJointJacobians(pin_model, pin_data, q)
        pin.forwardKinematics(pin_model, pin_data, q, v, a)
        pin.updateFramePlacements(pin_model, pin_data)
        for body in range(model.nbody):
            placement = pin_data.oMf[body]
            assert relative_error(placement.translation, data.xpos[body]) < 1e-9
            assert relative_error(placement.rotation.ravel(), data.xmat[body]) < 1e-9
            point = data.xpos[body]
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], point, body)
            mujoco.mj_jacDot(model, data, rate[:3], rate[3:], point, body)
            actual = pin.getFrameJacobian(pin_model, pin_data, body, AXES)
            actual = frames.jacobian_from_pinocchio(actual, rotation)
            assert relative_error(actual, jacobian) < 1e-9
            actual = pin.getFrameClassicalAcceleration(pin_model, pin_data, body, AXES)
            assert relative_error(np.asarray(actual), rate @ data.qvel) < 1e-9


def test_armature_of_actuators_is_in_the_mass_matrix():
    """Reflected through the gear, as MuJoCo does."""
    spec = mujoco.MjSpec.from_string(random_mjcf(4))
    for number, actuator in enumerate(spec.actuators):
        actuator.armature = 1e-3 * number
    model = spec.compile()
    data, expected = mujoco.MjData(model), np.empty((model.nv, model.nv))
    data.qpos[:] = random_states(model, 1)[0]
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, expected)
    q, _, _, rotation = to_pinocchio(model, data.qpos, data.qvel)
    pin_model = pinocchio_model(model)
    matrix = pin.crba(pin_model, pin_model.createData(), q)
    actual = frames.mass_matrix_from_pinocchio(matrix, rotation)
    np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-9)
    assert not np.allclose(pin_model.armature, model.dof_armature)


TREE = """
<mujoco>
  <worldbody>
    {before}
    <body name="base">
      {base}
      <geom size="0.1"/>
      <body name="arm" pos="0.2 0 0">{joint}<geom size="0.1" pos="0.1 0 0"/></body>
    </body>
    {after}
  </worldbody>
  {rest}
</mujoco>"""
PARTS = {"before": "", "base": "<freejoint/>", "after": "", "rest": ""}
PARTS |= {"joint": '<joint name="hinge" axis="0 1 0"/>'}
CABLE = '<tendon><fixed name="cable"{}><joint joint="hinge" coef="1"/></fixed></tendon>'
WINCH = '<actuator><motor name="winch" tendon="cable" armature="1"/></actuator>'
ARMATURE = "has armature.* Expected armature on joints"
LOOP = '<equality><joint joint1="hinge"/></equality>'
CRATE = '<body name="crate" pos="1 0 0">{}<geom size="0.1"/></body>'


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ({"base": ""}, r"free joints at positions \[\] .* Expected exactly one"),
        ({"after": CRATE.format("<freejoint/>")}, r"positions \[0, 2\] .* Expected exactly one"),
        ({"before": CRATE.format("<joint/>")}, r"positions \[1\] .* before all other joints"),
        ({"joint": '<joint name="hip" type="ball"/>'}, "'hip' is a ball joint. Expected hinge"),
        ({"rest": LOOP}, "1 equality constraints.* Expected a tree"),
        ({"rest": CABLE.format(' armature="1"')}, f"Tendon 'cable' {ARMATURE}"),
        ({"rest": CABLE.format("") + WINCH}, f"Actuator 'winch' {ARMATURE}"),
    ],
)
def test_what_cannot_be_represented_is_refused(part, message):
    model = mujoco.MjModel.from_xml_string(TREE.format(**(PARTS | part)))
    with pytest.raises(RobotError, match=message):
        pinocchio_model(model)


def test_unnamed_bodies_and_joints():
    tree = TREE.format(**PARTS).replace('name="arm"', "").replace('name="hinge"', "")
    pin_model = pinocchio_model(mujoco.MjModel.from_xml_string(tree))
    assert [frame.name for frame in pin_model.frames] == ["universe", "base", "body 2"]
    clash = tree.replace('name="base"', 'name="body 2"')
    with pytest.raises(RobotError, match="Body 2 is unnamed, and another body is called 'body 2'"):
        pinocchio_model(mujoco.MjModel.from_xml_string(clash))

"""Torques from inverse dynamics, put through Pinocchio's own constrained forward dynamics.

Inverse dynamics promises an acceleration and contact forces. Pinocchio's forward dynamics knows
neither our coordinates nor our Jacobians nor [M10]: it is given the torque and where the contacts
are. Contacts are at rest, as contacts are, and everything else moves.
"""

import numpy as np
import pinocchio as pin
import pytest

from fbid_gym import robots
from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.dynamics import frames
from fbid_gym.dynamics.pinocchio_dynamics import PinocchioDynamics

AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
# Robot, the feet that stand, and how many of the six base directions these cannot push.
STANCES = {
    "both feet": ("biped", (0, 1), 0),
    "right foot": ("biped", (1,), 0),
    "biped in flight": ("biped", (), 6),
    "four points": ("quadruped", (0, 1, 2, 3), 0),
    "three points": ("quadruped", (0, 1, 3), 0),
    "trot pair": ("quadruped", (0, 3), 1),
    "one point": ("quadruped", (2,), 3),
}


def acceleration_from_pinocchio(acceleration, qvel, rotation):
    """Generalized acceleration in MuJoCo's coordinates, X^-1 (a_pin - Xdot v)."""
    own = acceleration - frames.velocity_product(qvel, rotation)
    return frames.velocity_to_pinocchio(own, rotation.mT)


class Stance:
    """States of a robot whose standing feet are at rest, and the rows that keep them there.

    Flat feet hold six rows, points three. A point is nailed to the ground here, as in Pinocchio:
    it does not roll.
    """

    def __init__(self, name, random_states, count=4):
        robot_name, self.standing, self.beyond = STANCES[name]
        self.robot = robots.load(robot_name)
        self.dynamics = PinocchioDynamics(self.robot)
        self.rows = 6 if self.robot.feet[0].num_points > 1 else 3
        self.drop = np.array([[0.0, 0.0, -foot.radius] for foot in self.robot.feet])
        self.qpos, self.qvel = random_states(self.robot.model, count, seed=5)
        jacobian = self.jacobian_of(self.dynamics.terms(self.qpos, self.qvel))
        self.qvel -= np.matvec(np.linalg.pinv(jacobian), np.matvec(jacobian, self.qvel))
        self.terms = self.dynamics.terms(self.qpos, self.qvel)
        self.jacobian = self.jacobian_of(self.terms)
        spin = frames.skew(self.terms.foot_velocity[..., 3:])
        bias = self.terms.foot_bias.copy()
        bias[..., :3] += np.matvec(spin, np.matvec(spin, self.drop))
        self.bias = bias[:, list(self.standing), : self.rows].reshape(count, -1)

    def jacobian_of(self, terms):
        jacobian = terms.foot_jacobian[:, list(self.standing), : self.rows]
        return jacobian.reshape(len(jacobian), -1, self.robot.nv)

    def forward(self, index, torque):
        """Pinocchio's acceleration (nv,) and stacked contact forces (k,) of one state."""
        model = self.dynamics.model
        data = model.createData()
        qpos, qvel = self.qpos[index], self.qvel[index]
        rotation = frames.quaternion_to_matrix(qpos[3:7])
        q = frames.configuration_to_pinocchio(qpos, self.robot.model.qpos0)
        v = frames.velocity_to_pinocchio(qvel, rotation)
        force = np.concatenate((np.zeros(6), torque))
        if not self.standing:
            acceleration = pin.aba(model, data, q, v, force)
            return acceleration_from_pinocchio(acceleration, qvel, rotation), np.zeros(0)

        pin.forwardKinematics(model, data, q, v)
        kind = pin.ContactType.CONTACT_6D if self.rows == 6 else pin.ContactType.CONTACT_3D
        contacts, results = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        for number in self.standing:
            foot = self.robot.feet[number]
            body = model.frames[foot.body]
            pose = data.oMi[body.parentJoint] * body.placement
            local = pose.actInv(pose.act(foot.points.mean(axis=0)) + self.drop[number])
            placement = body.placement * pin.SE3(np.eye(3), local)
            contacts.append(
                pin.RigidConstraintModel(kind, model, body.parentJoint, placement, AXES)
            )
            results.append(contacts[-1].createData())
        pin.initConstraintDynamics(model, data, contacts, results)
        settings = pin.ProximalSettings(1e-14, 1e-9, 100)
        acceleration = pin.constraintDynamics(model, data, q, v, force, contacts, results, settings)
        forces = [np.asarray(result.contact_force)[: self.rows] for result in results]
        acceleration = acceleration_from_pinocchio(acceleration, qvel, rotation)
        return acceleration, np.concatenate(forces)


@pytest.fixture(params=STANCES)
def stance(request, random_states):
    return Stance(request.param, random_states)


@pytest.mark.parametrize("weighted", [False, True])
def test_promised_acceleration_and_forces_come_true(rng, stance, weighted, relative_error):
    count, joints = len(stance.qpos), stance.robot.num_joints
    cost = 10 ** rng.uniform(-1, 1, size=joints) if weighted else None
    result = orthogonal_inverse_dynamics(
        stance.terms.mass_matrix,
        stance.terms.bias,
        stance.jacobian,
        rng.normal(size=(count, stance.robot.nv)) * 3,
        stance.bias,
        torque_cost=cost,
    )
    np.testing.assert_array_equal(result.underactuation, stance.beyond)
    for index in range(count):
        acceleration, force = stance.forward(index, result.torque[index])
        assert relative_error(acceleration, result.acceleration[index]) < 1e-9
        if stance.standing:
            assert relative_error(force, result.contact_force[index]) < 1e-9

"""A robot's model in one pose, measured once: what touches, what is welded, how low it reaches."""

import copy
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from fbid_gym.robots.mjcf import object_name, warnings_heard

_GEOM = mujoco.mjtGeom
_JOINT = mujoco.mjtJoint

# They go by boxes about the geoms of a body that are compiled from other margins.
_BOXES = int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)

# Limbs that end no higher above the lowest, in heights of the centre of mass, are legs.
LEGS = 0.15
_CIRCLE = 8  # points that stand for one


@dataclass(frozen=True, eq=False)
class MeasuredModel:
    """One floating robot in a pose. Nothing of it may be changed."""

    model: mujoco.MjModel  # whose first joint is the free one
    qpos: np.ndarray  # (nq,) the pose

    @cached_property
    def data(self) -> mujoco.MjData:
        """Kinematics of the pose, centres of mass among them."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.qpos
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        return data

    @cached_property
    def forward(self) -> mujoco.MjData:
        """The same with all that MuJoCo computes of it at rest, contacts and forces among it."""
        with warnings_heard():
            mujoco.mj_forward(self.model, self.data)
        return self.data

    @cached_property
    def base(self) -> int:
        """Id of the floating body."""
        return int(self.model.jnt_bodyid[0])

    @cached_property
    def com(self) -> np.ndarray:
        """(3,) m, world: the centre of mass."""
        return np.array(self.data.subtree_com[self.base])

    @cached_property
    def gravity(self) -> float:
        """Size of gravity, m/s²."""
        return float(np.linalg.norm(self.model.opt.gravity))

    @cached_property
    def weight(self) -> float:
        """Weight of the robot, N."""
        return float(self.model.body_subtreemass[self.base]) * self.gravity

    @cached_property
    def touching(self) -> np.ndarray:
        """(ngeom,) bool, geoms that can touch the ground.

        A `<pair>` does not count: no robot has one with the ground, see `normalise`.
        """
        return (self.model.geom_contype != 0) | (self.model.geom_conaffinity != 0)

    @cached_property
    def ground(self) -> np.ndarray:
        """(ngeom,) bool, geoms of the static world, or that only a mocap moves, that can touch."""
        root = self.model.body_weldid[self.model.geom_bodyid]
        return ((root == 0) | (self.model.body_mocapid[root] >= 0)) & self.touching

    def meeting(self, geoms: np.ndarray) -> np.ndarray:
        """(ngeom, K) bool, which geoms may touch K of them by contype and conaffinity."""
        types, affinities = self.model.geom_contype, self.model.geom_conaffinity
        meets = (types[:, None] & affinities[geoms]) | (affinities[:, None] & types[geoms])
        return np.asarray(meets != 0)

    def with_contacts(self, distance: float, among: np.ndarray) -> mujoco.MjData:
        """Return the pose with contacts among geoms, (ngeom,) bool, so near (m), as MuJoCo does."""
        near = copy.copy(self.model)
        near.geom_margin[:] = distance
        near.geom_contype[~among] = near.geom_conaffinity[~among] = 0
        near.opt.disableflags |= _BOXES
        data = mujoco.MjData(near)
        data.qpos[:] = self.qpos
        mujoco.mj_kinematics(near, data)
        mujoco.mj_collision(near, data)
        return data

    @cached_property
    def limb_ends(self) -> list[int]:
        """Ids of the moving bodies on which nothing hangs that moves by itself."""
        weld = self.model.body_weldid
        moving = [b for b in range(1, self.model.nbody) if weld[b] == b]
        carries = {int(weld[self.model.body_parentid[b]]) for b in moving}
        return [body for body in moving if body not in carries]

    def limb_mass(self, end: int) -> float:
        """Mass of a limb, kg: from where it branches off to its end."""
        carry = Counter(above for tip in self.limb_ends for above in self.bodies_above(tip))
        limb = [above for above in self.bodies_above(end) if carry[above] == 1]
        return float(self.model.body_subtreemass[limb[-1]])

    def bodies_above(self, body: int) -> list[int]:
        """Ids of a body and those it hangs from, up to the base."""
        chain = [body]
        while chain[-1] not in (0, self.base):
            chain.append(int(self.model.body_parentid[chain[-1]]))
        return chain

    def roundness(self, geoms: np.ndarray) -> float:
        """Radius of the largest cylinder or capsule among some geoms, m; 0 without one."""
        kinds = (int(_GEOM.mjGEOM_CYLINDER), int(_GEOM.mjGEOM_CAPSULE))
        found = geoms[np.isin(self.model.geom_type[geoms], kinds)]
        return float(self.model.geom_size[found, 0].max(initial=0.0))

    def body_name(self, body: int) -> str:
        """Name of a body, or its number where the file gives none."""
        return object_name(self.model, mujoco.mjtObj.mjOBJ_BODY, body)

    def rotation(self, body: int) -> np.ndarray:
        """(3, 3) orientation of a body in the world."""
        return np.array(self.data.xmat[body].reshape(3, 3))

    def welded_geoms(self, body: int) -> np.ndarray:
        """Ids of the geoms that can touch, of a body and of what is welded to it."""
        weld = self.model.body_weldid
        return np.flatnonzero((weld[self.model.geom_bodyid] == weld[body]) & self.touching)

    def joints_above(self, body: int) -> list[int]:
        """Ids of the joints between the base and a body, from the base on."""
        moved = [above for above in self.bodies_above(body) if above not in (0, self.base)]
        return [int(j) for j in np.flatnonzero(np.isin(self.model.jnt_bodyid, moved))]

    def hinges_above(self, body: int) -> list[int]:
        """Ids of the hinges among them."""
        hinge = _JOINT.mjJNT_HINGE
        return [j for j in self.joints_above(body) if self.model.jnt_type[j] == hinge]

    def falling_stiffness(self, feet: Sequence[int]) -> np.ndarray:
        """(n,) N·m/rad that a joint needs to carry the weight; 0 for those that bear no foot."""
        needed = np.zeros(self.model.nv - 6)
        for joint in {joint for foot in feet for joint in self.hinges_above(foot)}:
            lever = float(self.com[2] - self.data.xanchor[joint][2])
            needed[int(self.model.jnt_dofadr[joint]) - 6] = self.weight * max(lever, 0.0)
        return needed

    def lowest(self, geoms: Sequence[int] | np.ndarray) -> float:
        """World height of the lowest point of some geoms, m; infinite for none."""
        ends = [self.ends_of(int(geom)) for geom in geoms]
        return min(
            (float(np.min(points[:, 2]) - radius) for points, radius in ends), default=np.inf
        )

    def ends_of(self, geom: int) -> tuple[np.ndarray, float]:
        """Return points (K, 3) m, world, and a radius: a geom lies within spheres about them."""
        model, place = self.model, self.data.geom_xpos[geom]
        rotation = self.data.geom_xmat[geom].reshape(3, 3)
        size, kind = model.geom_size[geom], int(model.geom_type[geom])
        if kind == _GEOM.mjGEOM_SPHERE:
            return place[None].copy(), float(size[0])
        if kind == _GEOM.mjGEOM_CAPSULE:
            return place + np.array([[-size[1]], [size[1]]]) * rotation[:, 2], float(size[0])
        if kind == _GEOM.mjGEOM_BOX:
            local = size * (np.array(list(np.ndindex(2, 2, 2))) * 2.0 - 1.0)
        elif kind == _GEOM.mjGEOM_CYLINDER:
            local = _rims(size, rotation[2])
        elif kind == _GEOM.mjGEOM_ELLIPSOID:
            local = -(size**2 * rotation[2] / np.linalg.norm(size * rotation[2]))[None]
        elif kind == _GEOM.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            first = model.mesh_vertadr[mesh]
            local = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float)
        else:
            return np.array([[0.0, 0.0, np.inf]]), 0.0  # planes and height fields are no feet
        return place + local @ rotation.T, 0.0


def _rims(size: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Points (K, 3) m on both rims of a cylinder, its lowest ones among them; `up` in its frame."""
    first = np.arctan2(-up[1], -up[0])
    angle = first + 2.0 * np.pi * np.arange(_CIRCLE) / _CIRCLE
    circle = size[0] * np.column_stack([np.cos(angle), np.sin(angle)])
    ends = [np.column_stack([circle, np.full(_CIRCLE, end)]) for end in (-size[1], size[1])]
    return np.concatenate(ends)

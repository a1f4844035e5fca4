"""Ground that is not level: obstacles and a rock board, [M10] IV.E, laid around a robot's world.

One model serves all robots of a batch: the ground is large and random, so a robot that starts at a
random place with a random heading meets a terrain of its own. Places to start from are level. All
lengths but the height follow the robot's size.
"""

from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np

from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.robots.robot import Robot

TERRAINS = ("flat", "obstacles", "rocks")
"""Names of the terrains."""

_GEOM = mujoco.mjtGeom

# In units of the robot's reach, see `_reach`: 0.12 m for the built-in quadruped.
_HALF_SIZE = 28.0
_START_SPACING = 10.0
_CLEARING = 1.8
_PLANKS_PER_AREA = 0.13
_PLANK_LENGTH, _PLANK_WIDTH = (1.0, 4.0), (0.5, 1.0)
_CELL = 0.17
_ROCK_SPACING = 0.75
_ROCK_RADIUS = (0.4, 0.8)
_SHALLOW = 1e-3  # m that the lowest points of the rock board lie below the ground plane


class Terrain(Protocol):
    """Ground on top of the plane z = 0."""

    @property
    def starts(self) -> np.ndarray:
        """(K, 2) m, centres of level places at height 0."""
        ...

    @property
    def clearing(self) -> float:
        """Radius of these places, m."""
        ...

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Add the ground to a robot's world."""
        ...

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return how high the ground is, in m, at places x and y, of any one shape, in m."""
        ...


def make_terrain(name: str, robot: Robot, *, height: float = 0.04, seed: int = 0) -> Terrain:
    """Make a terrain for a robot.

    Args:
        name: "flat"; "obstacles", planks lying about, from half of `height` to `height` tall; or
            "rocks", a board of rounded stones of up to `height`.
        robot: for whose size.
        height: m, of the highest point. 0 is flat.
        seed: decides where everything lies.

    Raises:
        UnknownOptionError: no terrain of this name.
        InvalidValueError: `height` is negative or more than the height of the robot's base.
    """
    if name not in TERRAINS:
        raise UnknownOptionError("terrain", name, TERRAINS)
    base = float(robot.home_qpos[2])
    if not 0.0 <= height <= base:
        raise InvalidValueError(
            "terrain height",
            height,
            f"metres from 0 to {base:.3g}, where {robot.name!r} has its base",
        )
    reach, rng = _reach(robot), np.random.default_rng(seed)
    if name == "flat" or height == 0.0:
        return Flat(np.zeros((1, 2)), np.inf)
    line = _START_SPACING * reach * np.array([-1.0, 0.0, 1.0])
    starts = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    if name == "obstacles":
        return _random_obstacles(reach, height, starts, rng)
    return _random_rocks(reach, height, starts, rng)


def compile_world(robot: Robot, terrain: Terrain) -> mujoco.MjModel:
    """Compile the robot's world with a terrain in it; the robot keeps its coordinates."""
    spec = robot.spec.copy()
    terrain.add_to(spec)
    return spec.compile()


def _reach(robot: Robot) -> float:
    """Largest horizontal distance of a contact point from the base at home, m."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.home_qpos
    mujoco.mj_kinematics(robot.model, data)
    points = [data.xpos[f.body] + f.points @ data.xmat[f.body].reshape(3, 3).T for f in robot.feet]
    offset = (np.concatenate(points) - data.xpos[robot.base_body])[:, :2]
    return float(np.linalg.norm(offset, axis=1).max())


@dataclass(frozen=True, eq=False)
class Flat:
    """The plane alone; a `Terrain`."""

    starts: np.ndarray
    clearing: float

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """See `Terrain`."""

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """See `Terrain`."""
        return np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Planks lying on the plane, one across the other at times; a `Terrain`.

    Attributes:
        starts: see `Terrain`.
        clearing: see `Terrain`.
        centre: (B, 2) m.
        heading: (B,) rad, of the long side.
        half: (B, 2) m, half length and half width.
        top: (B,) m, height.
        cell: m, edge of the square cells of `near`.
        near: (R, R, L) planks that touch a cell, B where there are fewer than L.
    """

    starts: np.ndarray
    clearing: float
    centre: np.ndarray
    heading: np.ndarray
    half: np.ndarray
    top: np.ndarray
    cell: float
    near: np.ndarray

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """See `Terrain`."""
        spec.add_material(name="fbid_plank", rgba=[0.72, 0.58, 0.42, 1.0], specular=0.1)
        for (x, y), turn, half, top in zip(
            self.centre, self.heading, self.half, self.top, strict=True
        ):
            spec.worldbody.add_geom(
                type=_GEOM.mjGEOM_BOX,
                size=[*half, 0.5 * top],
                pos=[x, y, 0.5 * top],
                quat=[np.cos(0.5 * turn), 0.0, 0.0, np.sin(0.5 * turn)],
                contype=1,
                conaffinity=1,
                material="fbid_plank",
            )

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """See `Terrain`."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        size = len(self.near)
        row, column = (np.floor(v / self.cell).astype(int) + size // 2 for v in (y, x))
        outside = (np.minimum(row, column) < 0) | (np.maximum(row, column) >= size)
        plank = self.near[np.where(outside, 0, row), np.where(outside, 0, column)]
        known = np.minimum(plank, len(self.top) - 1)
        dx, dy = x[..., None] - self.centre[known, 0], y[..., None] - self.centre[known, 1]
        cosine, sine = np.cos(self.heading[known]), np.sin(self.heading[known])
        along, across = cosine * dx + sine * dy, cosine * dy - sine * dx
        half = self.half[known]
        on = (np.abs(along) <= half[..., 0]) & (np.abs(across) <= half[..., 1])
        on &= (plank < len(self.top)) & ~outside[..., None]
        return np.where(on, self.top[known], 0.0).max(axis=-1)


def _random_obstacles(
    reach: float, height: float, starts: np.ndarray, rng: np.random.Generator
) -> Obstacles:
    size, clearing = _HALF_SIZE * reach, _CLEARING * reach
    count = round(_PLANKS_PER_AREA * (2 * _HALF_SIZE) ** 2)
    centre = rng.uniform(-size, size, (count, 2))
    heading = rng.uniform(-np.pi, np.pi, count)
    half = (
        0.5
        * reach
        * np.stack([rng.uniform(*_PLANK_LENGTH, count), rng.uniform(*_PLANK_WIDTH, count)], axis=1)
    )
    top = rng.uniform(0.5 * height, height, count)

    # Away with planks that reach into a clearing.
    offset = starts[:, None] - centre
    cosine, sine = np.cos(heading), np.sin(heading)
    along = np.abs(cosine * offset[..., 0] + sine * offset[..., 1]) - half[:, 0]
    across = np.abs(cosine * offset[..., 1] - sine * offset[..., 0]) - half[:, 1]
    gap = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
    kept = (gap > clearing).all(axis=0)
    centre, heading, half, top = (part[kept] for part in (centre, heading, half, top))

    cell = 2.0 * reach
    around = np.hypot(*half.T)  # radius of the circle about a plank
    edge = int(np.ceil((size + around.max()) / cell))
    middles = cell * (np.arange(-edge, edge) + 0.5)
    apart = np.abs(middles[:, None] - centre.T[:, None])  # (2, 2 edge, B)
    close = apart <= 0.5 * cell + around
    touching = close[1][:, None] & close[0]
    most = int(touching.sum(axis=-1).max())
    # Stable sorting puts the planks of a cell first, in order.
    order = np.argsort(~touching, axis=-1, kind="stable")[..., :most]
    near = np.where(np.take_along_axis(touching, order, axis=-1), order, len(top))
    return Obstacles(starts, clearing, centre, heading, half, top, cell, near)


@dataclass(frozen=True, eq=False)
class RockBoard:
    """A height field of rounded stones; a `Terrain`.

    Attributes:
        starts: see `Terrain`.
        clearing: see `Terrain`.
        half_size: m, of the square board.
        elevation: (R, R) m at the nodes of its grid; rows along y, columns along x. Negative where
            the plane is higher.
    """

    starts: np.ndarray
    clearing: float
    half_size: float
    elevation: np.ndarray

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """See `Terrain`."""
        low, high = self.elevation.min(), self.elevation.max()
        spec.add_material(name="fbid_rock", rgba=[0.55, 0.54, 0.52, 1.0], specular=0.1)
        spec.add_hfield(
            name="fbid_rocks",
            size=[self.half_size, self.half_size, high - low, 0.05],
            nrow=self.elevation.shape[0],
            ncol=self.elevation.shape[1],
            userdata=((self.elevation - low) / (high - low)).ravel(),
        )
        spec.worldbody.add_geom(
            type=_GEOM.mjGEOM_HFIELD,
            hfieldname="fbid_rocks",
            pos=[0.0, 0.0, low],
            contype=1,
            conaffinity=1,
            material="fbid_rock",
        )

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """See `Terrain`."""
        last = len(self.elevation) - 1
        u, v = ((np.asarray(w, float) / self.half_size + 1.0) * 0.5 * last for w in (x, y))
        u, v = np.broadcast_arrays(u, v)
        outside = (np.minimum(u, v) < 0) | (np.maximum(u, v) > last)
        column, row = (np.clip(np.floor(w).astype(int), 0, last - 1) for w in (u, v))
        s, t = u - column, v - row
        # Each cell is two triangles, split from (row, column) to (row + 1, column + 1).
        corner, far = self.elevation[row, column], self.elevation[row + 1, column + 1]
        right, above = self.elevation[row, column + 1], self.elevation[row + 1, column]
        found = corner + np.where(
            s > t,
            s * (right - corner) + t * (far - right),
            t * (above - corner) + s * (far - above),
        )
        return np.where(outside, 0.0, np.maximum(found, 0.0))


def _random_rocks(
    reach: float, height: float, starts: np.ndarray, rng: np.random.Generator
) -> RockBoard:
    size, clearing = _HALF_SIZE * reach, _CLEARING * reach
    nodes = 2 * round(_HALF_SIZE / _CELL) + 1
    line = np.linspace(-size, size, nodes)
    x, y = np.meshgrid(line, line)

    # One stone in every square of a coarser grid, anywhere in it.
    spacing = _ROCK_SPACING * reach
    squares = int(np.ceil(2 * size / spacing)) + 2
    corner = -0.5 * squares * spacing
    index = np.stack(np.meshgrid(np.arange(squares), np.arange(squares)), axis=-1)
    centre = corner + spacing * (index + rng.uniform(0.0, 1.0, index.shape))
    radius = reach * rng.uniform(*_ROCK_RADIUS, (squares, squares))
    top = height * rng.uniform(0.3, 1.0, (squares, squares))
    own = [np.floor((w - corner) / spacing).astype(int) for w in (y, x)]
    elevation = np.zeros_like(x)
    for up in (-1, 0, 1):
        for right in (-1, 0, 1):
            square = tuple(
                np.clip(o + d, 0, squares - 1) for o, d in zip(own, (up, right), strict=True)
            )
            offset = np.hypot(x - centre[square][..., 0], y - centre[square][..., 1])
            # Half an ellipsoid.
            dome = np.sqrt(np.maximum(1.0 - (offset / radius[square]) ** 2, 0.0))
            elevation = np.maximum(elevation, top[square] * dome)
    elevation *= height / elevation.max()

    from_start = np.linalg.norm(np.stack([x, y], axis=-1)[..., None, :] - starts, axis=-1)
    # The board begins gently at its edge and around clearings, a cell's diagonal away from them:
    # the triangles at a node reach that far.
    diagonal = np.sqrt(2.0) * (line[1] - line[0])
    from_clearing = from_start.min(axis=-1) - clearing - diagonal
    free = np.minimum(from_clearing, size - np.maximum(abs(x), abs(y)))
    elevation *= np.clip(free / (0.5 * reach), 0.0, 1.0)
    elevation[elevation < _SHALLOW] = -_SHALLOW
    return RockBoard(starts, clearing, size, elevation)

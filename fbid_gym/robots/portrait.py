"""A picture of a robot at home: its contact points, their hull, and its centre of mass."""

import copy
import struct
import zlib
from pathlib import Path

import mujoco
import numpy as np

from fbid_gym.robots.geoms import add_ball, add_line, offscreen
from fbid_gym.robots.polygon import convex_hull
from fbid_gym.robots.robot import Robot

_WIDTH, _HEIGHT = 1280, 960
_POINT = (0.9, 0.25, 0.1, 1.0)
_HULL = (0.95, 0.6, 0.1, 1.0)
_BONE = (0.35, 0.35, 0.35, 0.6)
_COM = (0.1, 0.35, 0.85, 1.0)


def portrait(robot: Robot) -> np.ndarray:
    """Draw a robot at home, its shapes half transparent: (960, 1280, 3) uint8; see `offscreen`.

    Red are the contact points, yellow is their hull, blue the centre of mass, with its place on the
    ground; grey lines join the bodies' origins.
    """
    data, points, com = robot.at_home.forward, robot.points_at_home, robot.at_home.com
    robots_own = robot.model.body_weldid[robot.model.geom_bodyid] != 0
    centres = np.concatenate([data.geom_xpos[robots_own], points])
    middle, size = 0.5 * (centres.min(axis=0) + centres.max(axis=0)), np.ptp(centres, axis=0)
    reach = float(np.linalg.norm(size))
    option, camera = mujoco.MjvOption(), mujoco.MjvCamera()
    option.flags[mujoco.mjtVisFlag.mjVIS_TRANSPARENT] = True
    camera.lookat[:] = middle
    camera.distance, camera.azimuth, camera.elevation = 1.7 * reach, 130.0, -25.0
    model = copy.copy(robot.model)
    if not model.nlight:
        model.vis.headlight.ambient, model.vis.headlight.diffuse = [0.6] * 3, [0.8] * 3
    model.vis.global_.offwidth, model.vis.global_.offheight = _WIDTH, _HEIGHT
    with offscreen(model, _HEIGHT, _WIDTH) as renderer:
        renderer.update_scene(data, camera, option)
        thin = 0.004 * reach
        for body in range(robot.base_body + 1, model.nbody):
            parent = data.xpos[model.body_parentid[body]]
            add_line(renderer.scene, parent, data.xpos[body], thin, _BONE)
        corners = points[convex_hull(points[:, :2])]
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            add_line(renderer.scene, start, end, thin, _HULL)
        below = np.array([*com[:2], points[:, 2].min()])
        add_line(renderer.scene, com, below, 0.5 * thin, _COM)
        for place in points:
            add_ball(renderer.scene, place, 2.0 * thin, _POINT)
        add_ball(renderer.scene, com, 3.0 * thin, _COM)
        add_ball(renderer.scene, below, 1.5 * thin, _COM)
        return np.asarray(renderer.render())


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Write pixels (H, W, 3) uint8 as a PNG."""
    height, width, _ = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = (b"IHDR" + header, b"IDAT" + zlib.compress(rows.tobytes()), b"IEND")
    path.parent.mkdir(parents=True, exist_ok=True)
    framed = (struct.pack(">I", len(c) - 4) + c + struct.pack(">I", zlib.crc32(c)) for c in chunks)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(framed))

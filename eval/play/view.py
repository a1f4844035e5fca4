"""From where a viewer first looks at the robots."""

import numpy as np
import viser

_AWAY = np.array([1.6, -1.9, 0.9])  # sizes of the robot
_AIM = 0.8  # of the height of its base
_RAISED = 0.45
"""Half heights of the picture by which the robots are above its middle where the panel is below:
it takes three fifths of a narrow window."""


def view(size: float, height: float, aspect: float, fov: float) -> tuple[np.ndarray, np.ndarray]:
    """Return from where robots are seen whole, and where to look, (3,) m each from their middle.

    `size` is that of the robots and `height` that of their bases, m; `aspect` is the width of the
    picture over its height, `fov` its vertical field of view, rad. On a phone the picture is high,
    and the panel lies over it.
    """
    aim = np.array([0.0, 0.0, _AIM * height])
    position = _AWAY * size
    if aspect >= 1.0:
        return position, aim
    position = aim + (position - aim) / aspect
    ahead = aim - position
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    up = np.cross(right / np.linalg.norm(right), ahead)  # as long as `ahead`
    return position, aim - _RAISED * np.tan(0.5 * fov) * up


def show_from(server: viser.ViserServer, size: float, height: float) -> None:
    """Let those who come, and those who are there, see the robots whole."""
    first = server.initial_camera
    first.position, first.look_at = view(size, height, 1.0, first.fov)
    for client in server.get_clients().values():
        aim(client, size, height)


def aim(client: viser.ClientHandle, size: float, height: float) -> None:
    """Let one see the robots whole."""
    camera = client.camera
    with client.atomic():
        camera.position, camera.look_at = view(size, height, camera.aspect, camera.fov)

"""Live plots of the last seconds."""

from collections import deque

import numpy as np
import viser
from viser import uplot

from eval.play.lane import Lane
from fbid_gym.motions.gait.heading import along, axes_of_trunk
from fbid_gym.runtime.observer import BODY
from fbid_gym.tasks.body_view import own_units

_SECONDS, _HZ = 8.0, 25.0
_COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#7f7f7f")


class Plots:
    """Velocity beside its command, torques as shares of their limits, the law's figures."""

    def __init__(self, server: viser.ViserServer, lanes: list[Lane]) -> None:
        """Send empty plots for these robots."""
        self._walks = lanes[0].batch.task.kind.gait
        ways = ("ahead", "to the left") if self._walks else ("x", "y")
        two = [f" {place + 1}" for place in range(len(lanes))] if len(lanes) > 1 else [""]
        speeds = [f"{way}{mark}" for mark in two for way in ways]
        commands = [f"{way}, command" for way in ways] if self._walks else []
        joints = list(lanes[0].batch.robot.joint_names)
        law = [f"{name}{mark}" for mark in two for name in ("residual", "saturation")]
        self._folder = server.gui.add_folder("Plots", expand_by_default=False)
        with self._folder:
            self._handles = [
                _plot(server, "velocity of the base (m/s)", [*speeds, *commands], True),
                _plot(server, "torques of robot 1, shares of their limits", joints, False),
                _plot(server, "law: residual (weights), saturation (share)", law, True),
            ]
        length = round(_SECONDS * _HZ)
        self._rows: list[deque[np.ndarray]] = [deque(maxlen=length) for _ in self._handles]
        self._times: deque[float] = deque(maxlen=length)
        self._sent = -1.0

    def note(self, time: float, lanes: list[Lane]) -> None:
        """Take the figures of the last policy step, at a time in s of the session."""
        told = [lane.last.info for lane in lanes if lane.last is not None]
        if len(told) < len(lanes):
            return
        speeds = [_velocity(lane, self._walks) for lane in lanes]
        commands = [_command(lanes[0])] if self._walks else []
        shares = told[0]["torque"][0] / lanes[0].batch.robot.torque_limit
        law = [
            float(info.get(name, [np.nan])[0])  # NaN where there is no law
            for info in told
            for name in ("layer_residual", "layer_saturation")
        ]
        rows = (np.concatenate([*speeds, *commands]), shares, np.array(law))
        for kept, row in zip(self._rows, rows, strict=True):
            kept.append(row)
        self._times.append(time)

    def remove(self) -> None:
        """Take them off the page."""
        self._folder.remove()

    def draw(self) -> None:
        """Send what was noted."""
        if len(self._times) < 2 or self._times[-1] == self._sent:
            return
        self._sent = self._times[-1]
        times = np.array(self._times)
        for handle, rows in zip(self._handles, self._rows, strict=True):
            handle.data = (times, *np.array(rows).T)


def _plot(
    server: viser.ViserServer, title: str, names: list[str], legend: bool
) -> viser.GuiUplotHandle:
    lines = [
        uplot.Series(label=name, stroke=_COLOURS[k % len(_COLOURS)], width=1)
        for k, name in enumerate(names)
    ]
    return server.gui.add_uplot(
        tuple(np.zeros(2) for _ in range(1 + len(names))),
        (uplot.Series(label="s"), *lines),
        title=title,
        scales={"x": uplot.Scale(time=False, auto=True)},
        legend=uplot.Legend(show=legend),
        height=170,
    )


def _velocity(lane: Lane, walks: bool) -> np.ndarray:
    """(2,) m/s, of the base: along its heading where there is a command, else in the world."""
    velocity = lane.batch.simulation.qvel[0, :2].copy()
    if not walks:
        return velocity
    trunk = lane.batch.simulation.terms().world_from_trunk[0]
    return np.array(along(axes_of_trunk(trunk), *velocity))


def _command(lane: Lane) -> np.ndarray:
    names = lane.batch.observation_names
    first = next(k for k, name in enumerate(names) if name.startswith("commanded velocity ahead"))
    own = lane.batch.config.observation == BODY
    size = own_units(lane.batch.task.body).speed if own else 1.0
    return size * lane.batch.observation()[0, first : first + 2].astype(float)

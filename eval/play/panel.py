"""The panel of the page: widgets that become requests, and that show what applies."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from eval.play.controls import GROUPS, OVERLAYS, PUSH, TIME, WORLD, Control
from eval.play.session import Change, OneStep, Push, Request, Reset, Session
from eval.play.texts import to_query
from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.envs.overlays import LABELS
from fbid_gym.errors import FbidError
from fbid_gym.motions.gait.heading import axes_of_trunk
from fbid_gym.options import Choice, Number, Whole
from fbid_gym.robots import Robot

_STEPS = {100.0: 1.0, 0.5: 0.01, 0.0: 0.002}  # of a slider whose range is at least that wide
_WAYS = {"ahead": (1, 0), "back": (-1, 0), "left": (0, 1), "right": (0, -1)}
"""Shares ahead and to the left."""


class Panel:
    """All widgets; what a viewer does to them is checked by the session, and refused in words."""

    def __init__(self, server: viser.ViserServer, session: Session) -> None:
        """Send the widgets."""
        self._session, self._gui = session, server.gui
        self._widgets: dict[str, Any] = {}
        # What the widgets were last told, by a viewer or from here.
        self._known: dict[str, Any] = dict(session.settings)
        self._offered = session.offered
        self._linked_version = -1
        self._status = server.gui.add_markdown("")
        for group in GROUPS:
            self._add_group(group, {n: c for n, c in session.offered.items() if c.group == group})
        self._link = server.gui.add_markdown("")

    def _add_group(self, group: str, offered: dict[str, Control]) -> None:
        if not offered:
            return
        with self._gui.add_folder(group, expand_by_default=group not in (WORLD, OVERLAYS)):
            for name, control in offered.items():
                self._widgets[name] = self._add(name, control)
            if group == PUSH:
                self._add_ways()
            elif group == TIME:
                self._button("one step", OneStep)
                self._button("restart", Reset)
            elif group == OVERLAYS:
                self._gui.add_markdown(f"*{'; '.join(LABELS.values())}*")

    def _add_ways(self) -> None:
        ways = self._gui.add_button_group("push", tuple(_WAYS))

        @ways.on_click
        def _(event: viser.GuiEvent) -> None:
            def push() -> Push:
                x, y = _WAYS.get(ways.value, (0, 0))
                session = self._session
                lane = session.lanes[0]
                ahead = heading(lane.batch.robot, lane.qpos)
                left = np.array([-ahead[1], ahead[0], 0.0])
                force = session.settings["push_force"] * (x * ahead + y * left)
                return Push(tuple(force.tolist()), session.settings["push_seconds"])

            self._submit(event, push)

    def _add(self, name: str, control: Control) -> Any:
        gui, value, kind = self._gui, self._session.settings[name], control.kind
        label = f"{control.label} (restarts)" if control.resets else control.label
        if isinstance(kind, Choice):
            widget: Any = gui.add_dropdown(label, tuple(kind.names), initial_value=value)
        elif isinstance(kind, Whole):
            ends = int(kind.least), int(kind.most)
            widget = gui.add_number(label, int(value), min=ends[0], max=ends[1], step=1)
        elif isinstance(kind, Number):
            least, most, step = _range(kind)
            widget = gui.add_slider(label, min=least, max=most, step=step, initial_value=value)
        else:
            widget = gui.add_checkbox(label, initial_value=value)

        @widget.on_update
        def _(event: viser.GuiEvent) -> None:
            # What the panel itself puts there comes back as an update of no client.
            if event.client_id is not None:
                self._known[name] = widget.value
                self._submit(event, lambda: Change(name, widget.value))

        return widget

    def _button(self, label: str, request: Callable[[], Request]) -> None:
        button = self._gui.add_button(label)

        @button.on_click
        def _(event: viser.GuiEvent) -> None:
            self._submit(event, request)

    def _submit(self, event: viser.GuiEvent, build: Callable[[], Request]) -> None:
        try:
            self._session.submit(build())
        except FbidError as error:  # said to the viewer who asked; what applies is shown again
            if event.client is not None:
                event.client.add_notification("Refused", str(error), color="red")

    def show(self, status: str) -> None:
        """Show what applies, where that has changed, and how it goes."""
        session = self._session
        if status != self._status.content:
            self._status.content = status
        if session.waiting:  # a slider that moves is not to be put back to where it came from
            return
        if self._offered is not session.offered:  # of another robot
            self._offered = session.offered
            for name, control in self._offered.items():
                kind, widget = control.kind, self._widgets[name]
                if isinstance(kind, Number) and not isinstance(kind, Whole):
                    widget.min, widget.max, widget.step = _range(kind)
        for name, value in session.settings.items():
            if self._known[name] != value:
                self._known[name] = self._widgets[name].value = value
        if self._linked_version != session.version:
            self._linked_version = session.version
            query = to_query(session.offered, session.settings)
            # Without a host: it is that of the viewer's own address, through whatever tunnel.
            self._link.content = f"[Link to these settings](?{query})"


def _range(ends: Number) -> tuple[float, float, float]:
    """Least, most and step of a slider."""
    step = next(each for wide, each in _STEPS.items() if ends.most - ends.least >= wide)
    return ends.least, ends.most, step


def heading(robot: Robot, qpos: np.ndarray) -> np.ndarray:
    """Unit vector (3,), horizontal, world, to where a robot in a pose (nq,) looks."""
    cosine, sine = axes_of_trunk(quaternion_to_matrix(qpos[3:7]) @ base_from_trunk(robot))
    return np.array([cosine, sine, 0.0])

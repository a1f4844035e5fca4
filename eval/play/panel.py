"""The panel of the page: widgets that become requests, and that show what applies."""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np
import viser

from eval.play.controls import Control, Menu, Slider, from_text, to_text
from eval.play.overlays import SHOWN_FIRST
from eval.play.session import MOST_PUSH, Change, OneStep, Push, Request, Reset, Session
from eval.play.stage import MOST_PUSH_SECONDS
from fbid_gym.envs.overlays import LABELS, RenderOptions
from fbid_gym.errors import FbidError

_USUAL_PUSH, _USUAL_SECONDS = 0.4, 0.15  # weights, s
_WAYS = {"ahead": (1, 0, 0), "back": (-1, 0, 0), "left": (0, 1, 0), "right": (0, -1, 0)}


class Panel:
    """All widgets; what a viewer does to them is checked by the session, and refused in words."""

    def __init__(self, server: viser.ViserServer, session: Session) -> None:
        """Send the widgets."""
        self._session, self._gui = session, server.gui
        self._widgets: dict[str, Any] = {}
        # What the widgets were last told, by a viewer or from here.
        self._known: dict[str, Any] = dict(session.settings)
        self._text_version = -1
        self._status = server.gui.add_markdown("")
        self._add_pushes()
        groups = dict.fromkeys(control.group for control in session.offered.values())
        for group in groups:
            with server.gui.add_folder(group, expand_by_default=group != "World"):
                for name, control in session.offered.items():
                    if control.group == group:
                        self._widgets[name] = self._add(name, control)
                if group == "Time":
                    self._button("one step", OneStep)
                    self._button("reset", Reset)
        self._add_overlays()
        self._add_text()

    def _add_pushes(self) -> None:
        session, gui = self._session, self._gui
        with ExitStack() as stack:
            stack.enter_context(gui.add_folder("Push (or drag the robot)"))
            most, usual = round(MOST_PUSH * session.weight), round(_USUAL_PUSH * session.weight)
            size = gui.add_slider("force (N)", min=0, max=most, step=1, initial_value=usual)
            time = gui.add_slider(
                "time (s)",
                min=0.02,
                max=MOST_PUSH_SECONDS,
                step=0.01,
                initial_value=_USUAL_SECONDS,
            )
            ways = gui.add_button_group("push", tuple(_WAYS))

        @ways.on_click
        def _(event: viser.GuiEvent) -> None:
            def push() -> Push:
                way = _WAYS.get(ways.value, (0, 0, 0))
                lane = session.lanes[0]
                w, x, y, z = lane.qpos[3:7]
                yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
                cosine, sine = np.cos(yaw), np.sin(yaw)
                force = size.value * np.array(
                    [cosine * way[0] - sine * way[1], sine * way[0] + cosine * way[1], 0.0]
                )
                return Push(tuple(force.tolist()), float(time.value))

            self._submit(event, push)

    def _add(self, name: str, control: Control) -> Any:
        gui, value = self._gui, self._session.settings[name]
        label = f"{control.label}, resets" if control.resets else control.label
        if isinstance(control, Menu):
            widget: Any = gui.add_dropdown(label, control.choices, initial_value=value)
        elif isinstance(control, Slider) and control.whole:
            ends = int(control.least), int(control.most)
            widget = gui.add_number(label, int(value), min=ends[0], max=ends[1], step=1)
        elif isinstance(control, Slider):
            step = 0.01 if control.most - control.least > 0.5 else 0.002
            least, most = control.least, control.most
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

    def _add_overlays(self) -> None:
        with self._gui.add_folder("Overlays", expand_by_default=False):
            self._overlays = {
                kind: self._gui.add_checkbox(label, initial_value=kind in SHOWN_FIRST)
                for kind, label in LABELS.items()
            }

    def _add_text(self) -> None:
        """Settings to send to somebody: they see them, change them here, or paste theirs."""
        with self._gui.add_folder("Settings as text", expand_by_default=False):
            self._text = self._gui.add_text("settings", "", multiline=True)
            apply = self._gui.add_button("apply text")

        @apply.on_click
        def _(event: viser.GuiEvent) -> None:
            try:
                wanted = from_text(self._session.offered, self._text.value)
            except FbidError as error:
                self._refuse(event, error)
                return
            # The policy first: it brings its layer, and that its limits.
            for name in ("policy", "layer", *wanted):
                self._session.submit(Change(name, wanted[name]))

    def _button(self, label: str, request: Callable[[], Request]) -> None:
        button = self._gui.add_button(label)

        @button.on_click
        def _(event: viser.GuiEvent) -> None:
            self._submit(event, request)

    def _submit(self, event: viser.GuiEvent, build: Callable[[], Request]) -> None:
        try:
            self._session.submit(build())
        except FbidError as error:
            self._refuse(event, error)

    def _refuse(self, event: viser.GuiEvent, error: FbidError) -> None:
        """Say why, to the viewer who asked; what applies is shown again."""
        if event.client is not None:
            event.client.add_notification("Refused", str(error), color="red")

    @property
    def shown(self) -> RenderOptions:
        """Which overlays are switched on."""
        return RenderOptions(**{kind: bool(box.value) for kind, box in self._overlays.items()})

    def show(self, status: str) -> None:
        """Show what applies, where that has changed, and how it goes."""
        session = self._session
        if status != self._status.content:
            self._status.content = status
        if session.waiting:  # a slider that moves is not to be put back to where it came from
            return
        for name, value in session.settings.items():
            if self._known[name] != value:
                self._known[name] = self._widgets[name].value = value
        if self._text_version != session.version:
            self._text_version = session.version
            self._text.value = to_text(session.offered, session.settings)

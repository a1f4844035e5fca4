"""The page: scene, panel, overlays and plots of a session, kept up with it in real time."""

import threading
import time

import numpy as np
import viser

from eval.play.controls import MOST_PUSH, shown
from eval.play.overlays import Overlays
from eval.play.panel import Panel
from eval.play.plots import Plots
from eval.play.scene import Scene
from eval.play.session import Push, Session
from fbid_gym.envs.insight import insight
from fbid_gym.errors import FbidError

DISPLAY_HZ = 60.0
_OVERLAYS_HZ, _PLOTS_HZ, _STATUS_HZ = 15.0, 4.0, 4.0
_PLOTTED_HZ = 25.0
_PULL = 2.0  # weights of push per size of the robot that it is dragged
_HELD = 0.25  # s that the push of a drag outlasts the last word of it
_LATE = 0.1  # s of the session's time that are made up for, beyond them it is slower


class Page:
    """One session on one server; any number of viewers."""

    def __init__(self, server: viser.ViserServer, session: Session) -> None:
        """Send the page."""
        self._server, self._session = server, session
        server.gui.configure_theme(control_width="large", show_share_button=False)
        server.gui.main_panel.dock_right()
        self._panel = Panel(server, session)
        self._scene = Scene(server, session.lanes, self._dragged)
        self._plots: Plots | None = None
        self._furnish()
        self._stop = threading.Event()
        self._drawn = (-1, -1)
        self._overlaid = (-1, -1)
        self._due: dict[str, float] = {}
        self.frames = 0  # drawn

    def _furnish(self) -> None:
        """Overlays and plots for the robots that there are."""
        session, scene = self._session, self._scene
        self._overlays = [
            Overlays(self._server, body.root, scene.size, session.weight) for body in scene.bodies
        ]
        if self._plots is not None:
            self._plots.remove()
        self._plots = Plots(self._server, session.lanes)

    def _dragged(self, moved: np.ndarray, over: bool) -> None:
        """Push the robots along with the pointer."""
        session = self._session
        force = _PULL * session.weight / self._scene.size * moved
        force *= min(
            1.0, 0.999 * MOST_PUSH * session.weight / max(float(np.linalg.norm(force)), 1e-9)
        )
        if over:
            force = np.zeros(3)
        try:
            session.submit(Push(tuple(force.tolist()), _HELD))
        except FbidError:
            return  # what is no number pushes nobody

    def run(self, seconds: float | None = None) -> None:
        """Go on in real time until `stop`, or for some seconds of the clock."""
        session = self._session
        begun = last = frame = time.perf_counter()
        behind = 0.0  # s of the clock that the robots have not gone through
        while not self._stop.is_set():
            now = time.perf_counter()
            if seconds is not None and now - begun >= seconds:
                return
            self._settle()
            step = 1.0 / (session.hz * session.settings["speed"])
            behind, last = min(behind + now - last, step + _LATE), now
            while behind >= step:
                behind -= step
                self._step()
            self._draw(1.0 if session.settings["paused"] else behind / step)
            self.frames += 1
            frame = max(frame + 1.0 / DISPLAY_HZ, now)  # who is late does not catch up on frames
            self._stop.wait(max(frame - time.perf_counter(), 0.0))

    def stop(self) -> None:
        """Let `run` return."""
        self._stop.set()

    def _settle(self) -> None:
        """Let requests take effect, and show other robots where they asked for them."""
        session, version = self._session, self._session.version
        session.settle()
        if self._scene.cast(session.lanes):
            self._furnish()
        if session.settings["paused"] and session.version != version:
            self._scene.look(session.lanes)  # who was reset is somewhere else

    def _step(self) -> None:
        """Go on by a policy step, unless paused."""
        session = self._session
        if not session.advance():
            return
        self._settle()
        self._scene.look(session.lanes)
        if self._is_due("noted", _PLOTTED_HZ):
            assert self._plots is not None
            self._plots.note(session.steps / session.hz, session.lanes)

    def _draw(self, share: float) -> None:
        """Send what has changed: who is paused stands still."""
        session = self._session
        now = session.steps, session.version
        if now != self._drawn or not session.settings["paused"]:
            with self._server.atomic():
                self._scene.draw(session.lanes, min(share, 1.0), session.weight)
        self._drawn = now
        if now != self._overlaid and self._is_due("overlays", _OVERLAYS_HZ):
            self._overlaid = now
            with self._server.atomic():
                self._draw_overlays()
        if self._plots is not None and self._is_due("plots", _PLOTS_HZ):
            self._plots.draw()
        if self._is_due("status", _STATUS_HZ):
            self._panel.show(self._status())

    def _draw_overlays(self) -> None:
        options, lanes = shown(self._session.settings), self._session.lanes
        for lane, overlays in zip(lanes, self._overlays, strict=True):
            if options.any:
                overlays.draw(options, insight(lane.batch))
            else:
                overlays.hide()

    def _is_due(self, what: str, hz: float) -> bool:
        now = time.perf_counter()
        if now < self._due.get(what, 0.0):
            return False
        self._due[what] = now + 1.0 / hz
        return True

    def _status(self) -> str:
        session = self._session
        two = len(session.lanes) > 1
        lines = [f"{lane.player.word}: {lane.word}" if two else lane.word for lane in session.lanes]
        paused = ", paused" if session.settings["paused"] else ""
        lines.append(f"{session.steps / session.hz:.1f} s{paused}")
        if session.refused:
            lines.append(f"refused: {session.refused}")
        return "\n\n".join(lines)

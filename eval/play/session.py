"""A session: one or two robots that go on by themselves, and what viewers ask of them.

Requests are data. They are checked where they come in, queued, and applied between two policy
steps, so that nothing a viewer sends meets the physics half-way. What happens depends on the
settings, the seed and the times of the requests alone: no clock is read here.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from eval.play.controls import ASIDE, MOST_PUSH, Control, Settings, checked, controls, rescaled
from eval.play.lane import Lane, layer_of, players
from eval.play.stage import MOST_PUSH_SECONDS, NO_POLICY, Stage
from fbid_gym.checks import number
from fbid_gym.errors import FbidError, InvalidValueError

GET_UP_AFTER = 1.5  # s after a fall until an episode starts anew
_MOST_QUEUED = 1000


class Change(NamedTuple):
    """Set a control."""

    name: str
    value: Any


class ChangeAll(NamedTuple):
    """Set all controls; those that are not named as they are at the start."""

    settings: Settings


class Push(NamedTuple):
    """Push all bases with a force, N in the world, for a time in s; no force ends a push."""

    force: tuple[float, float, float]
    seconds: float


class Reset(NamedTuple):
    """Start anew from the seed."""


class OneStep(NamedTuple):
    """Go on by one policy step although paused."""


Request = Change | ChangeAll | Push | Reset | OneStep


class Session:
    """Robots side by side under the same commands and pushes."""

    def __init__(self, stage: Stage, settings: Mapping[str, Any] | None = None) -> None:
        """Begin with these settings, the others as they are at the start.

        Raises:
            FbidError: a setting that may not be, or a policy that does not fit.
        """
        given = settings or {}
        # What stays, but for the robot where another is chosen; and what can be set, for that one.
        self.stage, self.offered = stage, controls(stage)
        name = checked(self.offered, "robot", given.get("robot", stage.robots[0]))
        self.stage, self.offered = self.stage.with_robot(name), self.offers(name)
        self.settings: Settings = resolved(self.stage, self.offered, given)  # as they apply now
        self.lanes = [
            Lane(self.stage, player, self.settings) for player in players(stage, self.settings)
        ]
        self.steps = 0  # policy steps since the session began
        self.version = 0  # grows with every change that a page shows
        self.refused = ""  # why the last change that came to nothing did; empty if none
        self._queue: deque[Request] = deque()
        self._single = 0
        self._restart()

    @property
    def hz(self) -> int:
        """Policy steps per second of the robots' time."""
        return self.lanes[0].batch.rates.policy

    @property
    def weight(self) -> float:
        """N, of a robot."""
        return self.lanes[0].batch.robot.weight

    @property
    def waiting(self) -> bool:
        """Whether requests wait for the next step."""
        return bool(self._queue)

    def offers(self, robot: str) -> dict[str, Control]:
        """Return what can be set with a robot; with one of no such name, what can be now.

        Raises:
            FbidError: it cannot be loaded.
        """
        if robot == self.stage.chosen or robot not in self.stage.robots:
            return self.offered
        return controls(self.stage.with_robot(robot))

    def submit(self, request: Request) -> None:
        """Check a request and queue it; may be called from any thread.

        Raises:
            FbidError: it is not valid; nothing changes.
        """
        if isinstance(request, Change):
            request = Change(request.name, checked(self.offered, request.name, request.value))
        elif isinstance(request, ChangeAll):
            robot = request.settings.get("robot", self.stage.robots[0])
            request = ChangeAll(resolved(self.stage, self.offers(robot), request.settings))
        elif isinstance(request, Push):
            request = self._checked_push(request)
        elif not isinstance(request, Reset | OneStep):
            raise InvalidValueError(
                "request", request, "a Change, ChangeAll, Push, Reset or OneStep"
            )
        if len(self._queue) >= _MOST_QUEUED:
            raise InvalidValueError("request", request, f"at most {_MOST_QUEUED} that wait")
        self._queue.append(request)

    def settle(self) -> None:
        """Apply what waits."""
        while self._queue:
            self._apply(self._queue.popleft())

    def advance(self) -> bool:
        """Apply what waits, then go on by a policy step unless paused; whether it did."""
        self.settle()
        if self.settings["paused"] and not self._single:
            return False
        self._single = max(self._single - 1, 0)
        for lane in self.lanes:
            lane.step()
            # What a fallen robot does nobody plans; without a limit it would lie there for ever.
            if lane.fallen is not None and lane.fallen >= GET_UP_AFTER and self.settings["get_up"]:
                lane.reset(self.settings)
        self.steps += 1
        return True

    def play(self, timed: Sequence[tuple[int, Request]], steps: int) -> None:
        """Go on by policy steps, with requests (step, request) submitted before their step."""
        for step in range(steps):
            for when, request in timed:
                if when == step:
                    self.submit(request)
            self.advance()

    def _checked_push(self, push: Push) -> Push:
        expected = "three numbers of N"
        if not isinstance(push.force, Sequence) or len(push.force) != 3:
            raise InvalidValueError("push", push.force, expected)
        x, y, z = (number("push", value, expected) for value in push.force)
        force = (x, y, z)
        most = MOST_PUSH * self.weight
        if not np.linalg.norm(force) <= most:
            raise InvalidValueError("push", force, f"a force of at most {most:.0f} N")
        expected = f"a time of 0 to {MOST_PUSH_SECONDS:g} s"
        seconds = number("push seconds", push.seconds, expected)
        if not 0.0 <= seconds <= MOST_PUSH_SECONDS:
            raise InvalidValueError("push seconds", seconds, expected)
        return Push(force, seconds)

    def _apply(self, request: Request) -> None:
        if isinstance(request, Push):
            steps = max(1, round(request.seconds * self.hz)) if any(request.force) else 0
            for lane in self.lanes:
                lane.push(np.array(request.force), steps)
        elif isinstance(request, Reset):
            self._restart()
        elif isinstance(request, OneStep):
            self._single += 1
        elif isinstance(request, ChangeAll):
            self._set(request.settings)
        else:
            (name, value), settings = request, self.settings
            more = brought(self.stage, settings, name, value)
            if name == "robot":
                settings = rescaled(self.offered, self.offers(value), settings)
            self._set(settings | {name: value} | more)
        self.version += 1

    def _set(self, wanted: Settings) -> None:
        """Set controls; those that cannot be brought about leave everything as it was."""
        changed = [self.offered[n] for n, value in wanted.items() if value != self.settings[n]]
        if not changed:
            return
        anew = any(control.resets for control in changed)
        try:
            stage, offered = self.stage.with_robot(wanted["robot"]), self.offers(wanted["robot"])
            for name, value in wanted.items():
                checked(offered, name, value)  # it may have been asked of another robot
            lanes = self._recast(stage, wanted, anew)
        except FbidError as error:
            self.refused = str(error)
            return
        self.stage, self.offered = stage, offered
        self.settings, self.lanes, self.refused = wanted, lanes, ""
        if anew:
            self._restart()
        elif any(control.group not in ASIDE for control in changed):
            for lane in self.lanes:
                lane.apply(wanted)

    def _recast(self, stage: Stage, wanted: Settings, anew: bool) -> list[Lane]:
        """Return the robots for new settings: those that stand, or others in their state."""
        rebuilt = anew or wanted["contact_limits"] != self.settings["contact_limits"]
        lanes = []
        for place, player in enumerate(players(stage, wanted)):
            now = self.lanes[min(place, len(self.lanes) - 1)]
            if not rebuilt and place < len(self.lanes) and player == now.player:
                lanes.append(now)
                continue
            lane = Lane(stage, player, wanted)
            if not anew:
                lane.take_over(now)
            lanes.append(lane)
        return lanes

    def _restart(self) -> None:
        for lane in self.lanes:
            lane.reset(self.settings)
            lane.falls = 0


def brought(stage: Stage, settings: Settings, name: str, value: Any) -> Settings:
    """Return what else changes with a setting: with a policy its layer, with a layer the policy."""
    if name == "policy" and value in stage.policies:
        policy = stage.policies[value]
        options = policy.env_args.get("layer_options") or {}
        return {
            "layer": layer_of(policy),
            "contact_limits": options.get("contact_limits", "friction"),
        }
    if name == "layer":
        acting = stage.policies.get(settings["policy"])
        if acting is not None and layer_of(acting) != value:
            return {"policy": NO_POLICY}
    return {}


def resolved(stage: Stage, offered: Mapping[str, Control], given: Mapping[str, Any]) -> Settings:
    """Return all settings for those that are given, the others as they are at the start.

    Raises:
        FbidError: a setting that may not be, or a layer that is not that of the policy.
    """
    asked = {name: checked(offered, name, value) for name, value in given.items()}
    settings = {name: control.default for name, control in offered.items()}
    for name in ("policy", "layer"):  # as a viewer would, the policy first
        if name in asked:
            settings |= {name: asked[name]} | brought(stage, settings, name, asked[name])
    settings |= asked
    if settings["policy"] in stage.policies:
        its = layer_of(stage.policies[settings["policy"]])
        if its != settings["layer"]:
            expected = f"{its!r}, through which {settings['policy']} acts"
            raise InvalidValueError("layer", settings["layer"], expected)
    return settings

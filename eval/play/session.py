"""A session: one or two robots that go on by themselves, and what viewers ask of them.

Requests are data. They are checked where they come in, queued, and applied between two policy
steps, so that nothing a viewer sends meets the physics half-way. What happens depends on the
settings, the seed and the times of the requests alone: no clock is read here.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from eval.play.controls import NO_POLICY, Settings, checked, controls, defaults
from eval.play.lane import Lane, layer_of, players
from eval.play.stage import MOST_PUSH_SECONDS, Stage
from fbid_gym.checks import number
from fbid_gym.errors import FbidError, InvalidValueError

MOST_PUSH = 2.0
"""Weights of the robot."""
GET_UP_AFTER = 1.5
"""s after a fall until an episode starts anew."""
_MOST_QUEUED = 1000


class Change(NamedTuple):
    """Set a control."""

    name: str
    value: Any


class Push(NamedTuple):
    """Push all bases with a force, N in the world, for a time in s; no force ends a push."""

    force: tuple[float, float, float]
    seconds: float


class Reset(NamedTuple):
    """Start anew from the seed."""


class OneStep(NamedTuple):
    """Go on by one policy step although paused."""


Request = Change | Push | Reset | OneStep


class Session:
    """Robots side by side under the same commands and pushes.

    Attributes:
        stage: what stays.
        offered: what can be set.
        settings: as they apply now.
        lanes: the robots.
        steps: policy steps since the session began.
        version: grows with every change that a page shows.
        refused: why the last change that came to nothing did; empty if none.
    """

    def __init__(self, stage: Stage, settings: Mapping[str, Any] | None = None) -> None:
        """Begin with these settings, the others as they are at the start.

        Raises:
            FbidError: a setting that may not be, or a policy that does not fit.
        """
        self.stage, self.offered = stage, controls(stage)
        given = {n: checked(self.offered, n, v) for n, v in (settings or {}).items()}
        self.settings: Settings = defaults(self.offered)
        for name in ("policy", "layer"):  # as a viewer would, the policy first
            if name in given:
                self.settings |= self._with_policy(Change(name, given[name]))
        self.settings |= given
        if self.settings["policy"] in stage.policies:
            its = layer_of(stage.policies[self.settings["policy"]])
            if its != self.settings["layer"]:
                expected = f"{its!r}, through which {self.settings['policy']} acts"
                raise InvalidValueError("layer", self.settings["layer"], expected)
        self.lanes = [
            Lane(stage, player, self.settings) for player in players(stage, self.settings)
        ]
        self.steps, self.version, self.refused = 0, 0, ""
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

    def submit(self, request: Request) -> None:
        """Check a request and queue it; may be called from any thread.

        Raises:
            FbidError: it is not valid; nothing changes.
        """
        if isinstance(request, Change):
            request = Change(request.name, checked(self.offered, request.name, request.value))
        elif isinstance(request, Push):
            request = self._checked_push(request)
        elif not isinstance(request, Reset | OneStep):
            raise InvalidValueError("request", request, "a Change, a Push, a Reset or a OneStep")
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
        else:
            self._change(request)
        self.version += 1

    def _change(self, change: Change) -> None:
        """Set a control; one that cannot be brought about leaves everything as it was."""
        wanted = self.settings | {change.name: change.value} | self._with_policy(change)
        if wanted == self.settings:
            return
        try:
            lanes = self._recast(wanted, self.offered[change.name].resets)
        except FbidError as error:
            self.refused = str(error)
            return
        self.settings, self.lanes, self.refused = wanted, lanes, ""
        if self.offered[change.name].resets:
            self._restart()
        elif change.name not in ("paused", "speed", "get_up"):
            for lane in self.lanes:
                lane.apply(wanted)

    def _with_policy(self, change: Change) -> Settings:
        """What else a change of layer or policy means: a policy acts through its own layer."""
        if change.name == "policy" and change.value in self.stage.policies:
            policy = self.stage.policies[change.value]
            options = policy.env_args.get("layer_options") or {}
            limits = options.get("contact_limits", "friction")
            return {"layer": layer_of(policy), "contact_limits": limits}
        if change.name == "layer":
            acting = self.stage.policies.get(self.settings["policy"])
            if acting is not None and layer_of(acting) != change.value:
                return {"policy": NO_POLICY}
        return {}

    def _recast(self, wanted: Settings, anew: bool) -> list[Lane]:
        """Return the robots for new settings: those that stand, or others in their state."""
        rebuilt = anew or wanted["contact_limits"] != self.settings["contact_limits"]
        lanes = []
        for place, player in enumerate(players(self.stage, wanted)):
            now = self.lanes[min(place, len(self.lanes) - 1)]
            if not rebuilt and place < len(self.lanes) and player == now.player:
                lanes.append(now)
                continue
            lane = Lane(self.stage, player, wanted)
            if not anew:
                lane.take_over(now)
            lanes.append(lane)
        return lanes

    def _restart(self) -> None:
        for lane in self.lanes:
            lane.reset(self.settings)

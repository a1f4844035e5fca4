"""N environments stepped together on one thread: the one code path of scalar and vector envs."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fbid_gym.actions import ActionLayer
from fbid_gym.envs import saved
from fbid_gym.envs.curriculum import Climb
from fbid_gym.envs.plant import Plant
from fbid_gym.envs.policy_step import Step
from fbid_gym.envs.simulation import Simulation
from fbid_gym.errors import InvalidValueError
from fbid_gym.quantities import RobotState, some_of
from fbid_gym.robots.undrawn import undrawn
from fbid_gym.runtime import answers
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.runtime.control_loop import ControlLoop
from fbid_gym.runtime.effort import Effort
from fbid_gym.runtime.given import checked_action, checked_command, clip
from fbid_gym.runtime.observer import Observer
from fbid_gym.runtime.perception import Perception
from fbid_gym.tasks.outcome import Outcome


class EnvBatch:
    """N environments without any notion of vector API: reset some, step all."""

    def __init__(
        self, config: EnvConfig, num_envs: int, of: int | None = None, most: int | None = None
    ) -> None:
        """Build the environments; reset them all before the first step.

        `of` is their number together with those of other batches, `most` the most steps of an
        episode. Raises FbidError for arguments that no environment has, and for episodes that take
        more memory, in all batches together, than is allowed.
        """
        self.config, num_envs = config, int(num_envs)
        self.rates = config.rates()
        self.robot = config.load_robot()
        self.terrain, world = config.ground(undrawn(self.robot))
        self.task = config.make_task(self.robot).on(self.terrain.grid.heights)
        self.reward_terms = config.reward_terms(self.task)  # as it was asked for
        self._reward_names = [f"reward_{name}" for name in self.reward_terms]
        self._reward_parts = answers.Parts.of_rows("reward term", self.reward_terms, num_envs)
        self._weights = np.repeat([term.weight for term in self.reward_terms.values()], num_envs)
        self.simulation = Simulation(self.robot, num_envs, self.rates, world)
        randomisation, sensors = config.randomisations(), config.perceived()
        self._tick = np.zeros(num_envs, np.int64)
        # Sensors and estimator; and what was changed of the robot's file, or is assumed beside it.
        self.perception, self.notes = None, self.robot.notes
        if sensors is not None:
            self.perception = Perception(self.robot, sensors, self.rates.control, self._tick)
            self.notes += self.perception.estimator.notes
        estimator = self.perception.estimator if self.perception else None
        guess = estimator.state if estimator and config.estimates else None
        self.plant = Plant(self.simulation, randomisation, guess)
        self.num_envs = num_envs
        self.num_steps = round(self.task.seconds * self.rates.policy)
        self.num_steps = min(self.num_steps, most or self.num_steps)
        # Steps after which the present episodes are truncated; those of `stagger` are fewer.
        self.limits = np.full(num_envs, self.num_steps)

        self._rngs = [np.random.default_rng() for _ in range(num_envs)]
        drawn = self.task.draw(np.random.default_rng(0))
        answers.check_plan(self.task, drawn)
        answers.check_size(drawn, num_envs if of is None else of, self.task.seconds)
        simulation, longest = self.simulation, randomisation.action_delay[1]
        kind = config.observation, config.history, num_envs
        chance = {"plant": self.plant.drawn}
        chance |= {"sensor": self.perception.drawn} if self.perception else {}
        self.observer = Observer(self.task, *kind, estimator, chance)
        own = config, self.task, drawn, simulation.terms(), self.observer
        self.loop = ControlLoop(*own, longest)
        # What each entry is, with its unit, and its largest size: observations are clipped to it.
        self.observation_groups = self.observer.groups
        self.observation_names, self.observation_bound = self.observer.names, self.observer.bound
        self.observation_columns = self.observer.columns  # of groups, by their names
        self.action_names = self.loop.action_names  # of the layer, then what is added
        self._plan = self.loop.plan
        where = simulation.qpos.copy(), simulation.qvel.copy()
        self._state = RobotState(*where, simulation.contact_force, self._tick)
        # As layer, gait and policy know it.
        self.known = self._state if guess is None else guess
        self._effort = Effort.none(num_envs, self.robot.num_joints)
        self._observation = np.zeros((num_envs, len(self.observation_bound)), np.float32)
        # What the episodes have come to so far.
        self._sums = {"distance": np.zeros(num_envs), "energy": np.zeros(num_envs)}
        self._progress = Climb(num_envs, self.terrain.tiles, config)
        # (N, 3) m/s, at the beginning of the last policy step, NaN before the first; for `insight`.
        self.com_velocity = np.full((num_envs, 3), np.nan)
        # Of the last policy step.
        outcome = self._outcome(Effort.none(num_envs, self.robot.num_joints))
        measured = self.loop.measure(outcome)
        self._metric_names = answers.metric_names(self.task.metrics(measured), self.task)
        self._metric_parts = answers.Parts.of_rows("metric", self._metric_names, num_envs)
        self._metrics = self._evaluate(measured)

    @property
    def layer(self) -> ActionLayer:
        """The action layer."""
        return self.loop.layer

    def seed(self, env: int, rng: np.random.Generator, *, anew: bool = True) -> None:
        """Give one environment a random generator of its own; its curriculum begins `anew`."""
        self._rngs[env] = rng
        if anew:
            self._progress.begin(env)

    def reset(
        self,
        ids: np.ndarray,
        command: np.ndarray | None = None,
        steps: np.ndarray | int | None = None,
    ) -> None:
        """Start new episodes in the environments `ids` (K,).

        They have checked commands (K, ...) or what is drawn, and steps (K,) or all of them.
        """
        for env in ids:
            drawn = self.task.draw(self._rngs[env])
            answers.check_drawn(self.task, drawn, self._plan)
            for name, value in drawn.items():
                self._plan[name][env] = value
            self._progress.tame(self._plan, env)
            self._plan["qpos"][env, :2] += self._progress.place(
                self.terrain.starts, env, self._rngs[env]
            )
            self.plant.draw(env, self._rngs[env])
            if self.perception is not None:
                self.perception.draw(env, self._rngs[env])
        if command is not None:
            self.set_command(ids, command)
        self.plant.apply(ids)
        self.loop.delay.begin(ids, self.plant.action_delay[ids])
        self._progress.set_out(ids)
        qpos = self._plan["qpos"][ids]
        ground = self.terrain.height(qpos[:, 0], qpos[:, 1])
        self.simulation.place(ids, qpos, self._plan["qvel"][ids], ground)
        self._tick[ids], self._effort.torque[ids] = 0, 0.0
        self.limits[ids] = self.num_steps if steps is None else steps
        self.com_velocity[ids] = np.nan
        for total in self._sums.values():
            total[ids] = 0.0
        self._begin(ids)
        rest = Effort.none(self.num_envs, self.robot.num_joints)
        outcome = self._outcome(rest._replace(torque=self._effort.torque))
        actual, known = self._measures(outcome)
        self._observation[ids] = self.observer.observe(known, actual, ids)[ids]

    @property
    def lengths(self) -> np.ndarray:
        """Steps that the present episodes have lasted, (N,)."""
        return self._tick // self.rates.ticks

    def observation(self) -> np.ndarray:
        """Return the current observations, (N, O) float32."""
        return self._observation.copy()

    def check_command(self, command: Any, num_envs: int) -> np.ndarray:
        """Return commands for `num_envs` robots, or raise one error before anything is lost."""
        group = self.observation_groups.get("command")
        if group is None or "command" not in self._plan:
            raise InvalidValueError("command", command, f"none in task {self.config.task!r}")
        return checked_command(command, self._plan["command"].shape[2:], group.bound, num_envs)

    def set_command(self, ids: np.ndarray, command: np.ndarray) -> None:
        """Have `ids` (K,) follow checked commands (K, ...) until their episodes end."""
        self._plan["command"][ids] = command[:, None]

    def check_action(self, action: np.ndarray, *num_envs: int) -> np.ndarray:
        """Return actions (*num_envs, A) as floats, or raise one error before anything is lost."""
        shape = *num_envs, self.loop.num_actions
        return checked_action(action, shape, refuse=self.config.actions == "refuse")

    def step(self, action: np.ndarray) -> Step:
        """Hold the checked actions (N, A) for one policy step, clipped to [-1, 1]."""
        action = np.array(action, float, order="C")
        clipped = clip(action)
        pushed = self._act(action)
        lost = self._effort.lost | self.simulation.diverged()
        some_lost = np.count_nonzero(lost)
        if some_lost:
            self._retire(np.flatnonzero(lost))
        velocity = self.simulation.qvel
        self._sums["distance"] += np.hypot(velocity[:, 0], velocity[:, 1]) / self.rates.policy
        self._sums["energy"] += self._effort.power / self.rates.control
        outcome = self._outcome(self._effort)
        measured, known = self._measures(outcome)
        shares, metrics = self._judge(measured), self._evaluate(measured)
        seen = self.observer.observe(known, measured)
        if some_lost:
            # A diverged robot has no state worth judging or observing: what was last seen stands.
            before = lost & (self._tick > self.rates.ticks)
            shares[:, lost], metrics[:, before] = 0.0, self._metrics[:, before]
            seen[lost] = self._observation[lost]
        reward = answers.summed(shares, self.reward_terms, self.task)
        self._metrics, self._observation = metrics, seen
        fallen = outcome.posture.fallen
        terminated = fallen | lost
        strayed = self.terrain.tiles.left(self._progress.level, self._state.qpos[:, :2])
        truncated = (strayed | (self._tick >= self.limits * self.rates.ticks)) & ~terminated
        info = dict(zip(self._reward_names, shares, strict=True))
        info |= zip(self._metric_names, metrics.copy(), strict=True)
        info |= pushed | self._report(fallen, lost) | self._climb(terminated, truncated)
        info["clipped_actions"] = clipped
        return Step(self.observation(), reward, terminated, truncated, info)

    def _climb(self, terminated: np.ndarray, truncated: np.ndarray) -> dict[str, np.ndarray]:
        """Let a curriculum, if there is one, take note of the step; the levels it was made on."""
        if not self._progress.names:
            return {}
        error = self._metrics[self._metric_names.index("velocity_error")]
        lasted = truncated & (self.limits == self.num_steps)
        return self._progress.advance(error, self.task.tolerance, terminated, lasted)

    def _measures(self, outcome: Outcome) -> tuple[Any, Any]:
        """Measure the parts of reward and metrics, and the observation as controllers know it."""
        actual = self.loop.measure(outcome)
        if self.known is self._state:
            return actual, actual
        believed = self.loop.believed(outcome, self.known, self.plant.terms())
        return actual, self.loop.measure(believed)

    def _judge(self, measured: Any) -> np.ndarray:
        """The terms of the reward: (T, N), a row for each."""
        shares = [term.share(measured) for term in self.reward_terms.values()]
        judged = self._reward_parts.joined(shares, self.task)
        judged *= self._weights
        return judged.reshape(-1, self.num_envs)

    def _evaluate(self, measured: Any) -> np.ndarray:
        """The metrics: (M, N), a row for each."""
        metrics = self.task.metrics(measured)
        rows = self._metric_parts.joined([metrics[name] for name in self._metric_names], self.task)
        return rows.reshape(-1, self.num_envs)

    def _act(self, action: np.ndarray) -> dict[str, np.ndarray]:
        """Run the control ticks of a policy step; what the pushes did."""
        self.look()
        state, terms = self.known, self.plant.terms
        actual = terms if state is self._state else self.simulation.terms
        self._effort.begin()
        self.com_velocity[:] = self.simulation.terms().com_velocity
        when = self._tick, self.rates.ticks, self.rates.control
        pushed = self.task.pushes.during(self._plan, *when)
        self.loop.send(action)
        for tick, push in enumerate(pushed.force):
            if pushed.jumping[tick]:
                self.simulation.jump(pushed.jump[tick])
                self.look()
            torque = self.loop.torque(tick, state, terms, actual)
            if self.simulation.loop.most_ticks:
                own = self.loop.drive_torque(state)
                torque = self.simulation.loop.arriving(torque, self._tick, own)
            if self.perception is not None:
                self.perception.estimator.prepare(terms)
            self.simulation.tick(torque, push, self._effort, self._state)
            if self.perception is not None:
                self.perception.update(self._state, self._effort.torque)
        return {"push": pushed.force[-1], "push_velocity": pushed.jump.sum(axis=0)}

    def _report(self, fallen: np.ndarray, lost: np.ndarray) -> dict[str, np.ndarray]:
        """Return a step's info of robots and layer, beside rewards and metrics."""
        tiles, ground = self.terrain.tiles, dict[str, np.ndarray]()
        if tiles.kinds.size:  # of several kinds
            ground["terrain_kind"] = tiles.kind(self._state.qpos[:, :2])
        return {
            "torque": self._effort.torque.copy(),
            "contact_force": self._state.contact_force.copy(),
            "layer_saturation": self._effort.saturation.copy(),
            **{f"layer_{name}": self.loop.memory[name].copy() for name in self.layer.diagnostics},
            "termination": np.where(lost, 2, 1 * fallen),
            **ground,
            **({} if self.perception is None else self.perception.errors(self._state)),
        }

    def look(self) -> None:
        """Note where the robots are, in arrays of our own; after a tick, the simulation does."""
        self._state.qpos[:], self._state.qvel[:] = self.simulation.qpos, self.simulation.qvel

    def _outcome(self, effort: Effort) -> Outcome:
        return self.loop.outcome(self._state, self.simulation.terms(), effort, self._sums)

    def _retire(self, ids: np.ndarray) -> None:
        """Stand diverged robots back in the home pose, where they harm nobody until reset."""
        self._effort.power[ids] = 0.0  # velocities that nobody trusts have a part in it
        home = np.tile(self.robot.home_qpos, (len(ids), 1))
        home[:, :2] += self.terrain.starts[0]
        ground = self.terrain.height(home[:, 0], home[:, 1])
        self.simulation.place(ids, home, np.zeros((len(ids), self.robot.nv)), ground)
        self.com_velocity[ids] = np.nan
        self._begin(ids)

    def _begin(self, ids: np.ndarray) -> None:
        """Have robots `ids` (K,) estimate, forget and plan anew where they are."""
        self.look()
        if self.perception is not None:
            self.perception.begin(ids, self._state)
            self.simulation.note_change(ids)
        self.loop.begin(ids, some_of(self.plant.terms(), ids))

    def state_dict(self) -> dict[str, np.ndarray]:
        """Return all that the future depends on: physics, task, layer, generators.

        One row per environment in each array.
        """
        state = saved.gathered(self._remembered())
        state |= {"tick": self._tick.copy(), "torque": self._effort.torque.copy()}
        state |= {"limits": self.limits.copy(), "observation": self.observation()}
        state["generator"] = np.array([saved.packed(rng) for rng in self._rngs], np.uint64)
        return state

    def _remembered(self) -> dict[str, Mapping[str, np.ndarray]]:
        """Return the live arrays that last from step to step, by their part of a state."""
        return {
            "simulation": self.simulation.arrays,
            "plant": self.plant.arrays,
            "plan": self._plan,
            "memory": self.loop.memory,
            "planned": self.loop.planned,
            "metric": dict(zip(self._metric_names, self._metrics, strict=True)),
            "episode": self._sums,
            "delay": self.loop.delay.arrays,
            "progress": self._progress.arrays,
            "observer": self.observer.arrays,
            "perception": {} if self.perception is None else self.perception.arrays,
        }

    def check_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Raise InvalidValueError for numbers of a state that look up what is not there."""
        waiting = self.loop.delay.arrays["action"].shape[1] - 1
        most = {
            "tick": self.num_steps * self.rates.ticks + 2**32,  # some step on after the end
            "limits": self.num_steps,
            "delay.ticks": waiting * self.rates.ticks,
            "simulation.loop_ticks": self.simulation.loop.most_ticks,
            "progress.level": self._progress.levels - 1,
            "planned.carrier": self.robot.num_feet - 1,
            "generator": saved.MOST_NUMBERS,
        }
        if self.perception is not None:
            history = self.perception.arrays["wear_history"].shape[1] - 1
            most["perception.wear_latency"] = history
        saved.check_bounds(state, most)

    def load_state_dict(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a `state_dict` that has been checked, bit for bit."""
        parts = self._remembered()
        saved.give_back({"plant": parts["plant"]}, state)
        self.plant.apply(np.arange(self.num_envs))  # what is simulated decides on what it computes
        saved.give_back(parts, state)
        self.simulation.go_on()
        self._tick[:], self._effort.torque[:] = state["tick"], state["torque"]
        self.limits[:] = state["limits"]
        self._observation = state["observation"].copy()
        self.com_velocity[:] = np.nan
        self._rngs = [saved.unpacked(row) for row in state["generator"]]

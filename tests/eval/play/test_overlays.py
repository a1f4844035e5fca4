"""What is drawn in the browser is what is drawn in pictures."""

import numpy as np
import pytest

pytest.importorskip("viser", reason="the live page is not installed: make play")

from eval.play.overlays import Overlays
from eval.play.scene import Scene
from eval.play.serving import close_server, open_server
from eval.play.session import Change, Session
from eval.play.stage import Stage
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.insight import insight
from fbid_gym.envs.overlays import EVERYTHING, RenderOptions, marks, size_of
from fbid_gym.runtime.config import EnvConfig


@pytest.fixture
def server():
    session = Session(Stage.of("fbid_gym/BipedBalance-v0", {}, {}))
    server = open_server(session, "127.0.0.1", 0)
    yield server
    close_server(server)


def test_the_page_draws_the_marks_and_hides_what_is_gone(server):
    batch = EnvBatch(EnvConfig(action_layer="base_acceleration"), 1)
    batch.seed(0, np.random.default_rng(0))
    batch.reset(np.zeros(1, int))
    size, weight = size_of(batch.task.body.stance), batch.robot.weight
    overlays = Overlays(server, "/robot", size, weight)
    for _ in range(3):
        for _ in range(5):
            batch.step(np.zeros((1, 6)))
        seen = insight(batch)
        overlays.draw(EVERYTHING, seen)
    drawn = {mark.name: mark for mark in marks(EVERYTHING, seen, size, weight)}
    for name, node in overlays._nodes.items():
        assert node.visible == (name in drawn and np.isfinite(drawn[name].place).all())
        if node.visible:
            np.testing.assert_allclose(node.position, drawn[name].place - seen.com, atol=1e-6)
            if drawn[name].shape != "ball":
                np.testing.assert_allclose(node.points, drawn[name].ends, atol=1e-6)
    assert {"measured", "commanded", "com", "support"} <= overlays._nodes.keys()
    overlays.draw(RenderOptions(com=True), seen)
    shown = {name for name, node in overlays._nodes.items() if node.visible}
    assert shown == {"com", "plumb line"}
    overlays.hide()
    assert not any(node.visible for node in overlays._nodes.values())


def test_a_ghost_of_the_base_is_where_the_robot_takes_it_to_be(server):
    session = Session(Stage.of("fbid_gym/QuadrupedWalk-v0", {}, {}), {"sensors": "raw"})
    scene = Scene(server, session.lanes, lambda moved, over: None)
    for _ in range(20):
        session.advance()
        scene.look(session.lanes)
    scene.draw(session.lanes, 1.0, session.weight)
    (body,), lane = scene.bodies, session.lanes[0]
    ghost, base = body._frames[-1], body._frames[body._trunk]
    np.testing.assert_allclose(ghost.position, lane.believed[:3], atol=1e-6)
    np.testing.assert_allclose(np.abs(ghost.wxyz @ lane.believed[3:]), 1.0, atol=1e-6)
    np.testing.assert_allclose(base.position, lane.qpos[:3], atol=1e-6)
    session.play([(0, Change("sensors", "perfect"))], 1)
    assert scene.cast(session.lanes) and -1 not in scene.bodies[0]._frames

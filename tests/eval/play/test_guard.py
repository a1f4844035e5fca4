"""What others than the page itself may do to it: other pages, and viewers that are no browsers."""

import time
from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("viser", reason="the live page is not installed: make play")

import msgspec
import viser
import websockets.sync.client as client
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.http11 import Request

from eval.play.guard import MOST_BYTES, foreign
from eval.play.panel import Panel
from eval.play.serving import close_server, open_server
from eval.play.session import Change, Session
from eval.play.stage import Stage

PATIENCE = 20.0  # s


class Served:
    """A session with its panel, served."""

    def __init__(self) -> None:
        stage = Stage.of("fbid_gym/QuadrupedWalk-v0", {"action_layer": "base_acceleration"}, {})
        self.session = Session(stage)
        self.server = open_server(self.session, "127.0.0.1", 0)
        self.panel = Panel(self.server, self.session)

    def uuid(self, control: str) -> str:
        """Return how viewers call a control."""
        return str(self.panel._widgets[control]._impl.uuid)

    def join(self, **options: Any) -> Any:
        """Come as a viewer."""
        address = f"ws://127.0.0.1:{self.server.get_port()}"
        protocol: Any = f"viser-v{viser.__version__}"
        return client.connect(address, subprotocols=[protocol], max_size=None, **options)

    def until(self, true: Callable[[], bool]) -> None:
        """Wait for the server."""
        end = time.monotonic() + PATIENCE
        while not true():
            assert time.monotonic() < end, "it did not happen"
            time.sleep(0.02)


@pytest.fixture(scope="module")
def served():
    served = Served()
    yield served
    close_server(served.server)


def send(viewer: Any, kind: str, **content: Any) -> None:
    viewer.send(msgspec.msgpack.encode({"type": kind, **content}))


def come(served: Served, viewer: Any) -> None:
    """Be counted among the viewers: who has not said where it looks from is not."""
    before = len(served.server.get_clients())
    send(
        viewer, "ViewerCameraMessage", wxyz=(1.0, 0.0, 0.0, 0.0), position=(1.0, 1.0, 1.0),
        fov=1.0, near=0.1, far=9.0, image_height=9, image_width=9, look_at=(0.0, 0.0, 0.0),
        up_direction=(0.0, 0.0, 1.0),
    )  # fmt: skip
    served.until(lambda: len(served.server.get_clients()) > before)


def asked(**headers: str) -> Request:
    return Request("/", Headers(**{name.replace("_", "-"): v for name, v in headers.items()}))


@pytest.mark.parametrize(
    ("origin", "host", "refused"),
    [
        ("http://127.0.0.1:8080", "127.0.0.1:8080", False),
        ("http://LocalHost:8080", "localhost:8080", False),
        ("https://some.tunnel.example", "some.tunnel.example", False),
        (None, "127.0.0.1:8080", False),
        ("https://evil.example", "127.0.0.1:8080", True),
        ("http://127.0.0.1:9999", "127.0.0.1:8080", True),
        ("http://127.0.0.1", "127.0.0.1:8080", True),
        ("http://127.0.0.1:8080.evil.example", "127.0.0.1:8080", True),
        ("null", "127.0.0.1:8080", True),
        ("null", None, True),
    ],
)
def test_a_viewer_is_on_the_page_of_this_address(origin, host, refused):
    named = {"Origin": origin, "Host": host}
    told = {name: value for name, value in named.items() if value is not None}
    assert foreign(asked(Upgrade="websocket", **told)) is refused
    assert not foreign(asked(**told))  # what is looked at is not driven


def test_another_page_is_answered_403(served):
    with pytest.raises(InvalidStatus, match="403"), served.join(origin="https://evil.example"):
        pass
    port = served.server.get_port()
    with served.join(origin=f"http://127.0.0.1:{port}") as viewer:
        come(served, viewer)


def test_a_viewer_sets_values_and_nothing_else(served):
    uuid, widget = served.uuid("paused"), served.panel._widgets["paused"]
    before = dict(vars(widget._impl))
    with served.join() as viewer:
        come(served, viewer)
        for updates in ({"update_cb": 0}, {"value": True, "removed": True}, {"__class__": 1}, {}):
            send(viewer, "GuiUpdateMessage", uuid=uuid, updates=updates)
        send(
            viewer, "FileTransferStartUpload", source_component_uuid=uuid, transfer_uuid="x",
            filename="x", mime_type="x", part_count=0, size_bytes=0,
        )  # fmt: skip
        send(viewer, "GuiUpdateMessage", uuid=uuid, updates={"value": True})
        served.until(lambda: served.session.waiting)
        assert list(served.session._queue) == [Change("paused", True)]
        changed = {name for name, now in vars(widget._impl).items() if now is not before[name]}
        assert changed <= {"value", "update_timestamp"}
        served.session.settle()
        send(viewer, "GuiUpdateMessage", uuid=uuid, updates={"value": False})
        served.until(lambda: served.session.waiting)
        served.session.settle()
    assert served.session.settings["paused"] is False


def test_a_long_message_ends_its_connection(served):
    with served.join() as viewer:
        come(served, viewer)
        send(viewer, "GuiUpdateMessage", uuid="x" * MOST_BYTES, updates={"value": 1})
        with pytest.raises(ConnectionClosed):
            while True:
                viewer.recv(timeout=PATIENCE)
    with served.join() as viewer:  # others come and go
        come(served, viewer)

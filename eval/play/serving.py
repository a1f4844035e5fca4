"""The server of the page: which address, which port, and what it costs."""

import io
import os
import socket
import subprocess
import sys
import threading
import time
import webbrowser
from contextlib import redirect_stdout
from typing import Any

from eval.play.session import Session
from fbid_gym.errors import FbidError, InvalidValueError
from fbid_gym.options import Whole

_VIEWER = """
import sys, websockets.sync.client as client
with client.connect(sys.argv[1], subprotocols=[sys.argv[2]], max_size=None) as page:
    while True:
        page.recv()
"""


def open_server(session: Session, host: str, port: int) -> Any:
    """Return a server of pages, whose addresses can carry settings; the caller stops it.

    Port 0 stands for any that is free.

    Raises:
        FbidError: viser is not installed, the address is not this machine's, the port is taken.
    """
    try:
        import viser
    except ImportError as error:
        raise FbidError(
            f"The page needs viser ({error}). It comes with the extra 'play': "
            "pip install 'fbid_gym[play]'."
        ) from error
    Whole(0, 65535).check("port", port)
    with socket.socket() as probe:
        # As the server does: a port that has just been let go is free.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except (OSError, OverflowError, UnicodeError) as error:  # a name that is too long
            expected = f"an address of this machine whose port is free ({error})"
            raise InvalidValueError("host and port", f"{host}:{port}", expected) from error
        free = probe.getsockname()[1]
    from eval.play.guard import only_values
    from eval.play.links import answering, answers

    # It announces itself in a box.
    with redirect_stdout(io.StringIO()), answering(answers(session)):
        server = viser.ViserServer(host=host, port=free, label="fbid_gym", verbose=False)
    only_values(server.gui)
    # Any viewer could ask for a tunnel through which the world sees the page. None gets one.
    server.request_share_url = lambda verbose=False: None
    return server


def close_server(server: Any) -> None:
    """Stop a server, and do not talk about it."""
    with redirect_stdout(io.StringIO()):
        server.stop()


def show(server: Any) -> str:
    """Return the address of the page; opened in a browser where there is a display."""
    address = f"http://{server.get_host()}:{server.get_port()}"
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
    return address


def measured(server: Any, session: Session, seconds: float) -> str:
    """Run a session for some seconds with a viewer in another process, and tell what it takes.

    That is how much of a core, of all threads, the frames drawn per s, and how many s of the robots
    went by per s of the clock.
    """
    import viser

    from eval.play.page import Page

    page, protocol = Page(server, session), f"viser-v{viser.__version__}"
    address = f"ws://{server.get_host()}:{server.get_port()}"
    viewer = subprocess.Popen([sys.executable, "-c", _VIEWER, address, protocol])
    try:
        while not (session.steps or session.settings["paused"]):
            page.run(0.1)  # the first step compiles
        page.run(min(2.0, seconds))  # until the viewer has what it needs
        steps, frames = session.steps, page.frames
        begun, busy = time.perf_counter(), time.process_time()
        page.run(seconds)
        wall, busy = time.perf_counter() - begun, time.process_time() - busy
    finally:
        viewer.kill()
        viewer.wait()
    kept, drawn = (session.steps - steps) / session.hz / wall, (page.frames - frames) / wall
    return (
        f"{busy / wall:.2f} of a core, {drawn:.0f} frames/s, "
        f"{kept:.2f} s of the robots per second, with one viewer"
    )

"""An address carries settings: asked for without a browser."""

import gzip
import http.client
from contextlib import closing
from typing import Any
from urllib.parse import quote

import pytest

pytest.importorskip("viser", reason="the live page is not installed: make play")

from eval.play.serving import close_server, open_server
from eval.play.session import Session
from eval.play.stage import Stage
from eval.play.texts import to_query


class Served:
    """A session that is served, and never goes on by itself."""

    def __init__(self, session: Session, server: Any) -> None:
        self.session, self.server = session, server

    def get(self, address: str, **headers: str) -> tuple[int, str]:
        """Ask for an address; headers are named with underscores."""
        asked = http.client.HTTPConnection("127.0.0.1", self.server.get_port(), timeout=30)
        with closing(asked):
            named = {name.replace("_", "-"): value for name, value in headers.items()}
            asked.request("GET", address, headers=named)
            answer = asked.getresponse()
            assert len(answer.headers.get_all("Content-Length", [])) <= 1
            said = answer.read()
            packed = answer.headers["Content-Encoding"] == "gzip"
            return answer.status, (gzip.decompress(said) if packed else said).decode()


@pytest.fixture(scope="module")
def served():
    stage = Stage.of("fbid_gym/QuadrupedWalk-v0", {"action_layer": "base_acceleration"}, {})
    session = Session(stage)
    server = open_server(session, "127.0.0.1", 0)
    yield Served(session, server)
    close_server(server)


def test_a_link_sets_what_it_names_and_shows_the_page(served):
    status, page = served.get("/?ahead=0.5&layer=com_wrench&beside=torque&paused=true&seed=7")
    assert status == 200 and page.lstrip().lower().startswith("<!doctype html>")
    session = served.session
    session.settle()
    named = ("ahead", "layer", "beside", "paused", "seed", "friction")
    wanted = [0.5, "com_wrench", "torque", True, 7, 1.0]
    assert [session.settings[name] for name in named] == wanted
    assert [lane.player.layer for lane in session.lanes] == ["com_wrench", "torque"]
    before, link = dict(session.settings), to_query(session.offered, session.settings)
    assert served.get("/")[0] == 200 and not session.waiting  # no link, no change
    assert served.get("/?ahead=0.1")[0] == 200
    session.settle()
    assert session.settings["layer"] == "base_acceleration"  # not named: as at the start
    served.get(f"/?{link}")
    session.settle()
    assert session.settings == before


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("ahead=9", "Invalid ahead: 9. Expected a number from -0.57 to 0.945."),
        ("ahead=0.1&friction=1e400", "Invalid friction: inf. Expected a number from 0.1 to 1.5."),
        ("ahead", "Expected a link as the page shows it"),
        ("ahead=0.1&ahead=0.2", "with each setting once"),
        ("ahead=%ff", "Expected a link as the page shows it"),
        ("nothing=1", "Unknown setting 'nothing'. Nearest of"),
        ("layer=" + quote("<script>alert(1)</script>"), "Unknown layer '<script>"),
    ],
)
def test_what_may_not_be_set_is_refused_in_a_sentence(served, query, words):
    status, said = served.get(f"/?{query}")
    assert status == 400 and words in said
    assert said.count("\n") == 1 and said.endswith("\n")
    assert not served.session.waiting


@pytest.mark.parametrize(
    "headers",
    [{"Sec_Fetch_Dest": "image"}, {"Sec_Fetch_Dest": "iframe"}, {"Sec_Purpose": "prefetch"}],
)
def test_what_nobody_opens_sets_nothing(served, headers):
    assert served.get("/?ahead=0.3", **headers)[0] == 200
    assert not served.session.waiting


def test_only_the_page_itself_is_a_link_and_no_file_is_read(served):
    up = "/../../../../etc/passwd"
    for address in ("/etc/passwd?ahead=0.3", up, "/%2e%2e/%2e%2e/etc/passwd"):
        assert served.get(address)[0] == 404
    assert not served.session.waiting

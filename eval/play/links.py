"""Addresses that carry settings: who opens one sets them for everybody, as by the panel."""

import gzip
import http
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import websockets.asyncio.server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from eval.play.guard import MOST_BYTES, foreign
from eval.play.session import ChangeAll, Session
from eval.play.texts import from_words, words_of
from fbid_gym.errors import FbidError

_HEAD = (
    b"<title>fbid_gym: push the robot</title>"
    b"<style>label { color: var(--mantine-color-text) !important;"
    b" letter-spacing: normal !important }</style>"
)

Answer = Callable[[ServerConnection, Request], Response | None]
"""What is answered to a request; None leaves that to the page's server."""


def answers(session: Session) -> Answer:
    """Let an address with settings set them; one that may not be is refused in a sentence.

    So is a page of another address that would act as a viewer.
    """

    def answer(connection: ServerConnection, request: Request) -> Response | None:
        if foreign(request):
            expected = "Expected a viewer on the page of this address, not on another page.\n"
            return connection.respond(http.HTTPStatus.FORBIDDEN, expected)
        path, _, query = request.path.partition("?")
        if path != "/" or not query or not _opened(request):
            return None
        try:
            words = words_of(query)
            offered = session.offers(words.get("robot", session.stage.robots[0]))
            session.submit(ChangeAll(from_words(offered, words)))
        except FbidError as error:
            return connection.respond(http.HTTPStatus.BAD_REQUEST, f"{error}\n")
        return None

    return answer


def _opened(request: Request) -> bool:
    """Whether somebody opens the address, and not some other page a picture that is called so."""
    told = request.headers
    return (
        told.get("Upgrade") is None
        and told.get("Sec-Fetch-Dest", "document") == "document"
        and told.get("Sec-Purpose") is None  # a browser that guesses what will be opened
    )


def titled(page: Response | None) -> Response | None:
    """Give viser's page our title, and labels in the colour and spacing of other text."""
    if page is not None and page.headers.get("Content-Type") == "text/html":
        packed = page.headers.get("Content-Encoding") == "gzip"
        html = gzip.decompress(page.body) if packed else page.body
        html = html.replace(b"<title>Viser</title>", _HEAD, 1)
        page.body = gzip.compress(html) if packed else html
        del page.headers["Content-Length"]  # of several fields of one name all are sent
        page.headers["Content-Length"] = str(len(page.body))
    return page


@contextmanager
def answering(answer: Answer) -> Iterator[None]:
    """Ask this first where a server is opened meanwhile: viser itself has no place for it.

    Nor for a size of messages: its own is for pictures that viewers send, which nobody asks for.
    """
    serve = websockets_server.serve

    def asking(*arguments: Any, process_request: Any, **options: Any) -> Any:
        def process(connection: ServerConnection, request: Request) -> Any:
            return answer(connection, request) or titled(process_request(connection, request))

        options |= {"process_request": process, "max_size": MOST_BYTES}
        return serve(*arguments, **options)

    with patch.object(websockets_server, "serve", asking):
        yield

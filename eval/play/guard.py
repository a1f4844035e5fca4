"""Let through to viser only the small messages that the page itself sends."""

from typing import Any

from websockets.http11 import Request

MOST_BYTES = 2**16  # largest message from a viewer; a control's value needs far less


def foreign(request: Request) -> bool:
    """Tell whether a page of another address asks for a connection: browsers say whose page it is.

    Who says nothing is no browser, and could say what it likes.
    """
    origin = request.headers.get("Origin")
    if request.headers.get("Upgrade") is None or origin is None:
        return False
    return origin.partition("://")[2].lower() != str(request.headers.get("Host")).lower()


def only_values(gui: Any) -> None:
    """Let viewers set the values of controls, and nothing else of them.

    viser itself sets whatever attribute of a control a viewer names, and lets a file be sent to
    any: either takes the control away from everybody.
    """
    from viser import _messages as messages

    arriving, handle = gui._websock_interface, gui._handle_gui_updates

    async def update(client_id: Any, message: Any) -> None:
        if list(message.updates) == ["value"]:
            await handle(client_id, message)

    for kind in (
        messages.GuiUpdateMessage,
        messages.FileTransferStartUpload,
        messages.FileTransferPart,
    ):
        arriving.unregister_handler(kind)
    arriving.register_handler(messages.GuiUpdateMessage, update)

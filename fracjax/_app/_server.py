"""The server of the page: on 127.0.0.1 alone, with a token in the address."""

from __future__ import annotations

import hmac
import logging
import secrets
import socket
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bokeh.server.auth_provider import AuthProvider
from bokeh.server.server import Server
from panel.io.server import get_server
from tornado.web import HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError

from ._page import page_of
from ._workspace import LARGEST, Workspace

HOST = "127.0.0.1"
_COOKIE = "fracjax_token"


class _Token(AuthProvider):
    """Lets in who has the token: in the address at first, in a cookie from then on.

    A request by another name than 127.0.0.1 is refused too, so that no foreign page reaches the
    server through a name of its own that leads here.
    """

    def __init__(self, token: str, port: int):
        self._token, self._host = token, f"{HOST}:{port}"
        super().__init__()

    @property
    def get_user(self) -> Callable[[Any], Any]:
        """The check of a request, which raises 403 (forbidden)."""
        return self._check

    @property
    def login_url(self) -> str:
        """Never used: who has no token is refused."""
        return "/refused"

    def _check(self, handler: RequestHandler) -> str:
        given = handler.get_query_argument("token", "") or handler.get_cookie(_COOKIE) or ""
        if handler.request.host != self._host or not hmac.compare_digest(
            given.encode(), self._token.encode()
        ):
            raise HTTPError(403, reason="open the address that fracjax app has printed")
        if not handler.get_cookie(_COOKIE) and handler.request.path == "/":
            handler.set_cookie(_COOKIE, self._token, httponly=True, samesite="Strict")
        return "user"

    @property
    def get_user_async(self) -> None:
        """None: the check is at once."""

    @property
    def get_login_url(self) -> None:
        """None: `login_url` is given."""

    @property
    def login_handler(self) -> None:
        """None: there is no login."""

    @property
    def logout_url(self) -> None:
        """None: there is no logout."""

    @property
    def logout_handler(self) -> None:
        """None: there is no logout."""


def server_for(folder: Path, port: int = 0) -> tuple[Server, str]:
    """A server of the page for a folder, not yet running, and the address of the page.

    `port`: 0 for a free one.
    """
    port = port or _free_port()
    token = secrets.token_urlsafe(24)
    server = get_server(
        {"/": lambda: page_of(Workspace(folder))},
        address=HOST,
        port=port,
        websocket_origin=[f"{HOST}:{port}"],
        auth_provider=_Token(token, port),
        websocket_max_message_size=LARGEST // 4,
        title="fracjax",
        show=False,
        start=False,
        verbose=False,
    )
    return server, f"http://{HOST}:{port}/?token={token}"


def serve(
    folder: Path, announce: Callable[[str], None], *, port: int = 0, show: bool = True
) -> None:
    """Serve the page for a folder until interrupted.

    `announce` is called with its address; `port`: 0 for a free one; `show`: in the browser too.
    """
    logging.getLogger("asyncio").addFilter(_is_worth_showing)
    server, address = server_for(folder, port)
    announce(address)
    if show:
        server.io_loop.add_callback(webbrowser.open, address)
    server.run_until_shutdown()


def _is_worth_showing(record: logging.LogRecord) -> bool:
    """False for what was sent to a page that has just been closed."""
    return not (record.exc_info and isinstance(record.exc_info[1], WebSocketClosedError))


def _free_port() -> int:
    """A port that nobody uses."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]

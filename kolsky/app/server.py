"""The server of `kolsky open`.

It serves this computer only, is protected by a secret and uses no network resources.
"""

from __future__ import annotations

import os
import secrets
import socket
import webbrowser
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from nicegui import app, ui
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.websockets import WebSocketClose

from kolsky.app import compare, frame, look, pictures, runs, setup, shots
from kolsky.base.errors import InputError

HOST = "127.0.0.1"
FIRST_PORT, PORTS = 8420, 20
"""First port that is tried, and number of ports."""

RECONNECT = 60.0
"""Time within which a page may reconnect before it is rebuilt [s]. A busy computer responds late."""

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]


def policy(port: int) -> str:
    """Content security policy: the sources that a page may load. NiceGUI compiles templates in the
    browser.
    """
    return (
        "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; "
        "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
        f"connect-src 'self' ws://{HOST}:{port} ws://localhost:{port}; worker-src 'self' blob:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


@dataclass(frozen=True)
class Door:
    """Access control of requests, by host, origin and secret."""

    port: int
    """Port of the server."""
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    """The secret. At first it is in the address, later in a cookie."""

    @property
    def hosts(self) -> tuple[str, str]:
        """Host and port in the form that a browser of this computer sends."""
        return f"{HOST}:{self.port}", f"localhost:{self.port}"

    @property
    def cookie(self) -> str:
        """Name of the cookie. It contains the port, because cookies are not separated by port."""
        return f"kolsky-{self.port}"

    def url(self, first: str = "/") -> str:
        """Address of a page with the secret."""
        joint = "&" if "?" in first else "?"
        return f"http://{self.hosts[0]}{first}{joint}{urlencode({'token': self.token})}"

    def objection(self, request: HTTPConnection) -> str:
        """Reason why a request is rejected.

        Empty if it is accepted, or if its address contains the secret.
        """
        if request.headers.get("host") not in self.hosts:  # of a page whose host name was redirected
            return "this host is not known here"
        origin, is_websocket = request.headers.get("origin"), request.scope["type"] == "websocket"
        if origin is not None and origin not in {f"http://{one}" for one in self.hosts}:
            return "a page of another place asked"
        if is_websocket and origin is None:
            return "a websocket says no origin"
        given = "" if is_websocket else request.query_params.get("token", "")
        if self._is_token(request.cookies.get(self.cookie, "")) or self._is_token(given):
            return ""
        return "open the address that `kolsky open` printed"

    def _is_token(self, text: str) -> bool:
        return secrets.compare_digest(text.encode(), self.token.encode())


class Gate:
    """Accepts requests by HTTP and websocket according to `Door`. It sets the policy of every page."""

    def __init__(self, app: Callable[[Scope, Receive, Send], Awaitable[None]], door: Door) -> None:
        """Wrap an ASGI application."""
        self.app, self.door = app, door

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Reject a request, exchange the secret for a cookie, or pass the request on."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        request, answer = HTTPConnection(scope), self.app
        if reason := self.door.objection(request):
            answer = WebSocketClose(1008, reason)
            if scope["type"] == "http":
                answer = PlainTextResponse(reason, 403, {"cross-origin-resource-policy": "same-origin"})
        elif scope["type"] == "http" and "token" in request.query_params:
            answer = _to_cookie(request, self.door)
        else:
            send = self._with_policy(send)
        await answer(scope, receive, send)

    def _with_policy(self, send: Send) -> Send:
        """Send headers with the policy, unless the page has a stricter one."""

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                names = {key.lower() for key, _ in message["headers"]}
                more = [
                    (b"content-security-policy", policy(self.door.port).encode()),
                    (b"x-content-type-options", b"nosniff"),
                    (b"referrer-policy", b"no-referrer"),
                    (b"cross-origin-resource-policy", b"same-origin"),
                ]
                message["headers"] = [*message["headers"], *(pair for pair in more if pair[0] not in names)]
            await send(message)

        return sending


def _to_cookie(request: HTTPConnection, door: Door) -> RedirectResponse:
    """Set the cookie and redirect to an address without the secret, which browser history would store."""
    words = [(key, word) for key, word in request.query_params.multi_items() if key != "token"]
    place = request.url.path + (f"?{urlencode(words)}" if words else "")
    cookie = f"{door.cookie}={door.token}; Path=/; HttpOnly; SameSite=Strict"
    return RedirectResponse(place, 303, {"set-cookie": cookie})


def pages(folder: Path) -> None:
    """Register the pages over the shots below a folder."""
    root = folder.resolve()
    frame.serve_files(root)
    for view in (shots, setup, pictures, runs, look, compare):
        view.page(root)


def free_port(number: int | None) -> int:
    """The requested port, or the first free one.

    Raises InputError if the requested port, or every tried port, is in use.
    """
    tried = [number] if number is not None else [*range(FIRST_PORT, FIRST_PORT + PORTS)]
    for port in tried:
        with socket.socket() as probe:
            try:
                if os.name != "nt":  # the port of a killed server is blocked for a minute
                    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind((HOST, port))
            except OSError:
                continue
            return int(probe.getsockname()[1])
    raise InputError("--port", f"port {tried[0]} is in use", cure="give another port, e.g. --port 8500")


def serve(folder: Path, *, port: int | None = None, browser: bool = True, first: str = "/") -> None:
    """Serve the shots below a folder until the program is interrupted.

    ``port``: default: the first free one from 8420 on. Raises InputError if it is in use. ``first``: address
    of the page to open.
    """
    door = Door(free_port(port))
    app.add_middleware(Gate, door=door)
    pages(folder)
    url = door.url(first)
    print(
        f"kolsky open: {folder.resolve()}\n{url}\nCtrl+C ends it. Runs that were started continue.",
        flush=True,
    )
    if browser:
        app.on_startup(lambda: webbrowser.open(url) and None)
    ui.run(
        host=HOST,
        port=door.port,
        title="kolsky",
        language="en-US",
        favicon=frame.ICON,
        dark=None,
        reconnect_timeout=RECONNECT,
        reload=False,
        show=False,
        show_welcome_message=False,
        uvicorn_logging_level="error",
    )

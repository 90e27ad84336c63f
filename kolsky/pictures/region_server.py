"""A page on this computer alone, in which regions are drawn: random port, secret address."""

import json
import secrets
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import PurePosixPath
from typing import Any

from kolsky.pictures.regions import Session

HOST = "127.0.0.1"
MOST = 1_000_000
"""Largest request [bytes]."""
DISCARDED = 16 * MOST
"""So much of a request that is too long is read and thrown away [bytes]."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What the page may load: its own files, and nothing from a network."""
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".png": "image/png",
    ".json": "application/json",
}
PAGE = {"": "regions.html", "regions.js": "regions.js", "regions.css": "regions.css"}
"""Files of the page by their address."""


class RegionServer(ThreadingHTTPServer):
    """Server of one drawing session; bound to this computer, on a port that was free."""

    daemon_threads = True
    allow_reuse_address = False

    def __init__(self, session: Session) -> None:
        self.session, self.token = session, secrets.token_urlsafe(24)
        self.closing = threading.Event()
        super().__init__((HOST, 0), _Handler)

    @property
    def host(self) -> str:
        """Host and port, as a browser sends them."""
        return f"{HOST}:{self.server_port}"

    @property
    def url(self) -> str:
        """Address of the page, its secret included."""
        return f"http://{self.host}/{self.token}/"

    def run(self) -> None:
        """Serve until the page asks for the end, or the program is interrupted."""
        worker = threading.Thread(target=self.serve_forever, daemon=True)
        worker.start()
        try:
            while not self.closing.wait(0.2):
                pass
        except KeyboardInterrupt:
            pass  # what was saved is saved
        finally:
            self.shutdown()
            self.server_close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that goes away in the middle of an answer is no error."""


class _Handler(BaseHTTPRequestHandler):
    """Requests: the page and its files, frames as PNG, the state, and check, save and close."""

    server: RegionServer
    server_version, sys_version = "regions", ""
    timeout = 30

    def do_GET(self) -> None:  # the standard library's name
        """Answer with a file of the page, the state or a frame."""
        place = self._place()
        if place is None:
            return
        if place in PAGE:
            name = PAGE[place]
            content = files("kolsky.pictures").joinpath("page", name).read_bytes()
            self._send(200, content, PurePosixPath(name).suffix)
        elif place == "state.json":
            self._json(200, self.server.session.state())
        elif place.startswith("frames/") and place.endswith(".png") and place[7:-4].isdecimal():
            number = int(place[7:-4])
            n = self.server.session.pictures.n_frames
            found = self.server.session.png(number) if number < n else f"there are {n} frames"
            if isinstance(found, str):
                self._json(404, {"problems": [found]})
            else:
                self._send(200, found, ".png")
        else:
            self._json(404, {"problems": ["there is nothing here"]})

    def do_POST(self) -> None:
        """Check or save what is drawn, or end the session."""
        place = self._place()
        if place is None:
            return
        content = self._content()
        if content is None:
            return
        session = self.server.session
        if place == "check":
            self._json(200, {"problems": session.problems(content)})
        elif place == "save":
            problems = session.save(content)
            self._json(409 if problems else 200, {"problems": problems, "saved": list(session.saved)})
        elif place == "close":
            self._json(200, {"problems": []})
            self.server.closing.set()
        else:
            self._json(404, {"problems": ["there is nothing here"]})

    def _place(self) -> str | None:
        """The address behind the secret; None if the request is refused.

        The host must be this one: a page of elsewhere that has its name pointed at this computer (DNS
        rebinding) sends another. A request that says where it is from must be from the page itself.
        """
        origin = self.headers.get("Origin")
        own = self.headers.get("Host") == self.server.host
        own = own and origin in (None, f"http://{self.server.host}")
        _, _, rest = self.path.partition("?")
        token, slash, place = self.path.lstrip("/").partition("/")
        if (
            not own
            or rest
            or not slash
            or not secrets.compare_digest(token.encode(), self.server.token.encode())
        ):
            self._json(403, {"problems": ["this address is not known here"]})
            return None
        return place

    def _content(self) -> Any:
        """The JSON of a request; None if it is refused."""
        length = self.headers.get("Content-Length", "")
        if self.headers.get("Content-Type") != "application/json" or not length.isdecimal():
            self._json(415, {"problems": ["a request is JSON with its length"]})
            return None
        if int(length) > MOST:
            self._discard(min(int(length), DISCARDED))
            self._json(413, {"problems": [f"a request has at most {MOST} bytes"]})
            return None
        try:
            content = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            content = None
        if content is None:
            self._json(400, {"problems": ["the request is no JSON"]})
        return content

    def _discard(self, left: int) -> None:
        """Read so many bytes: unread ones would reset the connection, and the refusal would be lost."""
        while left > 0 and (read := self.rfile.read(min(65_536, left))):
            left -= len(read)

    def _json(self, status: int, content: dict[str, Any]) -> None:
        self._send(status, json.dumps(content).encode(), ".json")

    def _send(self, status: int, content: bytes, kind: str) -> None:
        self.send_response(status)
        for name, value in (
            ("Content-Type", TYPES[kind]),
            ("Content-Length", str(len(content))),
            ("Content-Security-Policy", POLICY),
            ("X-Content-Type-Options", "nosniff"),
            ("Referrer-Policy", "no-referrer"),
            ("Cache-Control", "no-store"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
        ):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not printed: the address holds the secret."""

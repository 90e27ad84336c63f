"""Access control: hosts, origins and the secret, over HTTP and over the websocket."""

from __future__ import annotations

import ast
import asyncio
import socket
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from kolsky_command import run_kolsky

import kolsky.app
from kolsky.app.frame import NoShot, folder_at
from kolsky.app.server import Door, Gate, free_port
from kolsky.base.errors import InputError

DOOR = Door(8420, "the-secret")
COOKIE = "kolsky-8420=the-secret"


def answer(path: str = "/", query: str = "", kind: str = "http", **headers: str) -> list[dict[str, Any]]:
    """What the gate sends for a request."""
    sent: list[dict[str, Any]] = []

    async def inside(scope: Any, receive: Any, send: Any) -> None:
        accept = {"type": "websocket.accept"}
        await send(
            {"type": "http.response.start", "status": 200, "headers": []} if kind == "http" else accept
        )

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {}

    named = {"host": "127.0.0.1:8420", **{key.replace("_", "-"): value for key, value in headers.items()}}
    scope = {
        "type": kind,
        "path": path,
        "query_string": query.encode(),
        "headers": [(key.encode(), value.encode()) for key, value in named.items()],
    }
    asyncio.run(Gate(inside, DOOR)(scope, receive, send))
    return sent


def test_the_secret_becomes_a_cookie_and_leaves_the_address() -> None:
    (start, _) = answer("/look", "token=the-secret&shot=a%2Fb")
    headers = dict(start["headers"])
    assert start["status"] == 303
    assert headers[b"location"] == b"/look?shot=a%2Fb"
    assert headers[b"set-cookie"] == b"kolsky-8420=the-secret; Path=/; HttpOnly; SameSite=Strict"


def test_the_cookie_lets_in_and_the_page_gets_its_policy() -> None:
    (start,) = answer(cookie=COOKIE)
    assert start["status"] == 200
    policy = dict(start["headers"])[b"content-security-policy"].decode()
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "https:" not in policy


@pytest.mark.parametrize(
    "request_",
    [
        {},
        {"query": "token=another"},
        {"cookie": "kolsky-8420=another"},
        {"cookie": "kolsky-8421=the-secret"},
        {"cookie": COOKIE, "host": "evil.example:8420"},
        {"cookie": COOKIE, "host": "127.0.0.1:9999"},
        {"cookie": COOKIE, "origin": "http://evil.example"},
        {"cookie": COOKIE, "origin": "http://127.0.0.1:9999"},
        {"cookie": COOKIE, "origin": "null"},
        {"query": "token=the-secret", "host": "evil.example"},
    ],
    ids=str,
)
def test_all_others_are_refused(request_: dict[str, str]) -> None:
    (start, body) = answer(**request_)
    assert start["status"] == 403
    assert (b"cross-origin-resource-policy", b"same-origin") in start["headers"]
    assert body["body"]


@pytest.mark.parametrize(
    ("headers", "let_in"),
    [
        ({"cookie": COOKIE, "origin": "http://127.0.0.1:8420"}, True),
        ({"cookie": COOKIE, "origin": "http://localhost:8420", "host": "localhost:8420"}, True),
        ({"cookie": COOKIE, "origin": "http://evil.example"}, False),
        ({"cookie": COOKIE}, False),
        ({"origin": "http://127.0.0.1:8420"}, False),
        ({"cookie": COOKIE, "origin": "http://127.0.0.1:8420", "host": "evil.example"}, False),
    ],
)
def test_websockets(headers: dict[str, str], let_in: bool) -> None:
    sent = answer(kind="websocket", **headers)
    assert [m["type"] for m in sent] == ["websocket.accept" if let_in else "websocket.close"]


def test_a_websocket_takes_no_secret_from_its_address() -> None:
    sent = answer(kind="websocket", query="token=the-secret", origin="http://127.0.0.1:8420")
    assert sent[0]["type"] == "websocket.close"


def test_a_shot_lies_below_the_root(tmp_path: Path) -> None:
    root = tmp_path.resolve() / "root"
    (root / "a").mkdir(parents=True)
    (tmp_path / "outside").mkdir()
    (root / "link").symlink_to(tmp_path / "outside")
    assert folder_at(root, "a") == root / "a"
    for name in ("../outside", "link", "none", "/etc"):
        with pytest.raises(NoShot):
            folder_at(root, name)


def test_a_port_in_use_is_refused_and_the_next_is_found() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        number = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"{number} is in use"):
            free_port(number)
    assert free_port(None) >= 8420


def test_no_folder_is_refused(tmp_path: Path) -> None:
    done = run_kolsky("open", tmp_path / "none", code=2)
    assert "is not a folder" in done.stderr


def test_without_the_extra_the_cure_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    for name in [one for one in sys.modules if one.startswith("kolsky.app")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "nicegui", None)
    done = run_kolsky("open", tmp_path, code=2)
    assert "pip install 'kolsky[app]'" in done.stderr


def test_the_pages_do_what_scripts_can_do() -> None:
    """They import public names of the rooms below alone, and reach into no private name of another object."""
    private = []
    for path in sorted(Path(kolsky.app.__file__).parent.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            names = []
            if isinstance(node, ast.ImportFrom):
                names = [*(node.module or "").split("."), *(alias.name for alias in node.names)]
            elif isinstance(node, ast.Attribute) and not (
                isinstance(node.value, ast.Name) and node.value.id in ("self", "cls", "os")
            ):
                names = [node.attr]
            private += [
                f"{path.name}:{node.lineno}: {one}"
                for one in names
                if one.startswith("_") and one != "__future__"
            ]
    assert private == []

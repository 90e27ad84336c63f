"""The real server over a socket: it rejects requests of a hostile page in the same browser."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from http.client import HTTPConnection
from urllib.parse import urlsplit

import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from served import served


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[int, str]]:
    """Port and secret of a server over a folder with one shot."""
    root = tmp_path_factory.mktemp("root")
    (root / "one").mkdir()
    (root / "one" / "shot.toml").write_text("format = 1\n", encoding="utf-8")
    with served(root) as (_, url):
        port, token = urlsplit(url).port, urlsplit(url).query.partition("=")[2]
        assert port is not None
        yield port, token


def status(port: int, path: str = "/", **headers: str) -> tuple[int, str]:
    """Status and body of a GET; "host" names what the browser believes that it talks to."""
    connection = HTTPConnection("127.0.0.1", port, timeout=60.0)
    connection.putrequest("GET", path, skip_host=True)
    connection.putheader("Host", headers.pop("host", f"127.0.0.1:{port}"))
    for key, value in headers.items():
        connection.putheader(key.replace("_", "-"), value)
    connection.endheaders()
    answer = connection.getresponse()
    text = answer.read().decode("utf-8")
    connection.close()
    return answer.status, text


def upgraded(port: int, **headers: str) -> int:
    """Status of the handshake of the page's websocket: 101 if it is open."""
    path = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    lines = [
        f"GET {path} HTTP/1.1",
        f"Host: {headers.pop('host', f'127.0.0.1:{port}')}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version: 13",
        *(f"{key}: {value}" for key, value in headers.items()),
    ]
    with socket.create_connection(("127.0.0.1", port), timeout=30.0) as line:
        line.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return int(line.recv(1000).split()[1])


def test_only_the_own_page_with_the_secret_comes_in(server: tuple[int, str]) -> None:
    port, token = server
    cookie, own = f"kolsky-{port}={token}", f"http://127.0.0.1:{port}"
    evil = "http://evil.example"
    code, text = status(port, cookie=cookie)
    assert code == 200
    assert "1 shots below" in text
    refused = (
        {},
        {"cookie": f"kolsky-{port}=guessed"},
        {"cookie": cookie, "host": f"evil.example:{port}"},  # its name was pointed at this computer
        {"cookie": cookie, "origin": evil},
        {"cookie": cookie, "origin": "null"},  # a sandboxed frame
        {"cookie": cookie, "origin": f"http://127.0.0.1:{port + 1}"},  # another server of this computer
    )
    for path in ("/", "/setup?shot=one", "/result?shot=one&name=report.html"):
        for headers in refused:
            code, text = status(port, path, **headers)
            assert code == 403, (path, headers)
            assert "one" not in text.split()
    assert upgraded(port, cookie=cookie, origin=own) == 101
    for headers in (*refused, {"origin": own}, {"cookie": cookie}):
        assert upgraded(port, **headers) == 403, headers

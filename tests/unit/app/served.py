"""`kolsky open` as a process on a folder, as a user starts it."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

LONGEST = 60.0
"""Longest time until it answers [s]."""


@contextmanager
def served(root: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The server, and the address that it prints; it has ended at the end."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    words = [sys.executable, "-m", "kolsky.cli", "open", str(root), "--no-browser", "--port", str(port)]
    own = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST")}
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=own) as server:
        try:
            assert server.stdout is not None
            server.stdout.readline()
            url = server.stdout.readline().strip()
            _wait(port)
            yield server, url
        finally:
            server.terminate()
            server.wait(20.0)


def _wait(port: int) -> None:
    until = time.monotonic() + LONGEST
    while time.monotonic() < until:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError("the server does not answer")

"""`--dask` without a scheduler: a closed or silent port, another program, a wrong file."""

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from kolsky.base.errors import InputError
from kolsky.cli import sweep
from kolsky.cli.sweep import Workers

distributed = pytest.importorskip("distributed")
FILE = "scheduler.json"


@contextmanager
def listener(says: bytes | None) -> Iterator[str]:
    """A port that takes connections and does not answer, or always the same."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def talk() -> None:
            while True:
                try:
                    there, _ = server.accept()
                    with there:
                        there.sendall(says or b"")
                except OSError:
                    return

        if says is not None:
            threading.Thread(target=talk, daemon=True).start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep, "SCHEDULER_PATIENCE", 0.5)


def refused(named: str) -> str:
    started = time.monotonic()
    with pytest.raises(InputError) as raised, Workers(dask=named).executor():
        pass
    assert time.monotonic() - started < 10.0
    said = str(raised.value)
    assert len(said.splitlines()) == 1
    assert "Cure: " in said
    return said


SAYS = {"nothing": None, "http": b"HTTP/1.1 400 Bad Request\r\n\r\n", "zeros": b"\0" * 100}


@pytest.mark.parametrize("says", SAYS.values(), ids=SAYS)
def test_a_port_where_no_scheduler_answers(says: bytes | None) -> None:
    with listener(says) as address:
        said = refused(address)
    assert f"--dask {address}: no scheduler answers" in said


def test_a_port_where_nobody_listens() -> None:
    with listener(None) as address:
        pass
    assert "no scheduler answers" in refused(address)


@pytest.mark.parametrize("named", ["no-such-thing", "http://127.0.0.1:9", "tcp://", "inproc://x", "x" * 5000])
def test_what_is_no_address(named: str) -> None:
    assert "no scheduler answers" in refused(named)


@pytest.mark.parametrize("text", ["", "[]", "{}", "[" * 100_000, "\x00", '"tcp://127.0.0.1:9"'], ids=range(6))
def test_a_file_that_is_no_scheduler_file(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text)
    said = refused(str(tmp_path / FILE))
    assert "is not a scheduler file" in said
    assert FILE in said


def test_a_scheduler_file_that_is_too_long(tmp_path: Path) -> None:
    with (tmp_path / FILE).open("wb") as file:
        file.truncate(sweep.SCHEDULER_FILE + 1)
    assert f"at most {sweep.SCHEDULER_FILE} bytes" in refused(str(tmp_path / FILE))


def test_a_scheduler_file_whose_scheduler_is_gone(tmp_path: Path) -> None:
    with listener(None) as address:
        (tmp_path / FILE).write_text(json.dumps({"address": address}))
        assert "no scheduler answers (nothing within 0.5 s)" in refused(str(tmp_path / FILE))


def test_a_scheduler_that_answers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sweep, "SCHEDULER_PATIENCE", 30.0)
    with distributed.LocalCluster(
        n_workers=1, processes=False, dashboard_address=None, protocol="tcp"
    ) as some:
        (tmp_path / FILE).write_text(json.dumps({"address": some.scheduler_address}))
        for named in (some.scheduler_address, str(tmp_path / FILE)):
            with Workers(dask=named).executor() as executor, executor() as pool:
                assert pool.submit(sum, (1, 2)).result() == 3
        worker = next(iter(some.workers.values())).address
        assert "no scheduler answers (a Worker is there)" in refused(worker)

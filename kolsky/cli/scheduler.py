"""`--dask`: the client of a scheduler that answers, or a refusal within seconds."""

import asyncio
import json
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.cli import texts

SCHEDULER_FILE = 1_000_000
"""Largest scheduler file that is read [bytes]."""
PATIENCE = 5.0
"""Time that a Dask scheduler has to answer [s]."""
START = "start one with `dask scheduler` and give its address or its scheduler file"


def client(named: str) -> Any:
    """A client of the scheduler at an address or in a scheduler file, which the caller closes.

    Raises
    ------
    InputError
        If Dask is not installed, or no scheduler answers within `PATIENCE`.
    """
    try:
        from distributed import Client
    except ImportError:
        cure = "pip install 'kolsky[cluster]'"
        raise InputError(texts.COMMAND_LINE, "--dask needs the package distributed", cure=cure) from None
    address = _in_file(Path(named)) if _is_file(named) else named
    try:
        # A client of something that takes connections and says nothing would wait for ever.
        kind = asyncio.run(asyncio.wait_for(_kind(address), PATIENCE))
        if kind != "Scheduler":
            raise ValueError(f"a {kind} is there")
        return Client(address, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # of the network, or whatever the answer of another program leads to
        said = " ".join(str(error).split()) or f"nothing within {PATIENCE:g} s"
        problem = f"--dask {named}: no scheduler answers ({said})"
        raise InputError(texts.COMMAND_LINE, problem, cure=START) from error


async def _kind(address: str) -> str:
    """What answers at an address: "Scheduler", "Worker"."""
    from distributed import Security
    from distributed.comm import connect

    comm = await connect(address, timeout=PATIENCE, **Security().get_connection_args("client"))
    try:
        await comm.write({"op": "identity", "reply": True})
        answer = await comm.read()
    finally:
        comm.abort()
    return str(answer["type"])


def _in_file(path: Path) -> str:
    """The address that a scheduler file holds."""
    cure = "give the file that `dask scheduler --scheduler-file` writes"
    if path.stat().st_size > SCHEDULER_FILE:
        raise InputError(
            path,
            f"has {path.stat().st_size} bytes",
            allowed=f"a scheduler file, of at most {SCHEDULER_FILE} bytes",
            cure=cure,
        )
    try:
        return str(json.loads(path.read_text("utf-8"))["address"])
    except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        problem = f"is no scheduler file ({type(error).__name__}: {error})"
        raise InputError(path, problem, allowed="JSON with an address", cure=cure) from error


def _is_file(text: str) -> bool:
    """Whether a text names a file; an address may be longer than any name."""
    try:
        return Path(text).is_file()
    except (OSError, ValueError):
        return False

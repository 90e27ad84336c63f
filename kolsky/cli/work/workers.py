"""Who runs a sweep's chunks: this process, processes beside it, or the workers of a Dask scheduler."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.cli.work.options import COMMAND_LINE


@dataclass(frozen=True)
class Workers:
    """As given on the command line."""

    processes: int | None = None
    """Processes on this machine; None for this one alone."""
    dask: str = ""
    """Address of a Dask scheduler, or its scheduler file; empty for none."""

    @contextmanager
    def executor(self) -> Iterator[Any]:
        """What makes the executor (`doe.executors.ExecutorFactory`); None where this process does the work.

        Raises
        ------
        InputError
            If both kinds are asked for, Dask is not installed, or its scheduler does not answer.
        """
        if self.dask and self.processes is not None:
            raise InputError(COMMAND_LINE, "--dask and --processes exclude each other", cure="choose one")
        if self.dask:
            with self._client() as client:
                yield client.get_executor
        elif self.processes is not None:
            from concurrent.futures import ProcessPoolExecutor
            from multiprocessing import get_context

            # Not forked: a copy of a process that has started threads may hang.
            yield partial(ProcessPoolExecutor, self.processes, mp_context=get_context("spawn"))
        else:
            yield None

    def threads(self, given: int | None) -> int | None:
        """Threads of each worker: what was given, or the cores shared out among the processes."""
        if given is not None or self.processes is None:
            return given
        return max(1, (os.cpu_count() or 1) // self.processes)

    def _client(self) -> Any:
        try:
            from distributed import Client
        except ImportError:
            cure = "pip install 'kolsky[cluster]'"
            raise InputError(COMMAND_LINE, "--dask needs the package distributed", cure=cure) from None
        place = {"scheduler_file": self.dask} if Path(self.dask).is_file() else {"address": self.dask}
        try:
            return Client(**place, timeout=10, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            cure = "start one with `dask scheduler` and give its address or its scheduler file"
            raise InputError(
                COMMAND_LINE, f"--dask {self.dask}: no scheduler answers ({error})", cure=cure
            ) from error

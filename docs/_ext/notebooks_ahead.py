"""Run notebooks in parallel before any page is read. The pages then find their output in the cache.

Sphinx reads consecutive pages in one process. It would run the tutorials one after the other, which would
take most of the build's time.
"""

import os
import time
from concurrent.futures import ProcessPoolExecutor
from logging import LoggerAdapter, NullHandler, getLogger
from multiprocessing import get_context
from multiprocessing.synchronize import Lock
from pathlib import Path

from jupyter_cache import get_cache
from jupyter_cache.cache.main import JupyterCacheBase
from myst_nb.core.execute import create_client
from myst_nb.core.read import create_nb_reader
from sphinx.errors import ExtensionError
from sphinx.util import logging

_SILENT = getLogger(f"{__name__}.runs")
"""A run prints only messages of this level; `run_all` reports a failure once."""
_SILENT.addHandler(NullHandler())
_SILENT.propagate = False
LONGEST = ("tutorials/rate_study", "tutorials/pictures", "tutorials/first_shot", "gallery/rate")
"""The longest notebooks are started first: no process then waits for one of them at the end."""


class _Quiet(LoggerAdapter):
    """A logger that accepts the keyword of the notebook's logger."""

    def process(self, msg, kwargs):
        kwargs.pop("subtype", None)
        return msg, kwargs


def write_in_turn(lock: Lock) -> None:
    """Let a process write to the cache only while it holds `lock`. Every process calls this first.

    After each write the cache removes old records with two queries to its database. If another process adds a
    record between the two, the cache would remove it.
    """
    write = JupyterCacheBase.cache_notebook_bundle

    def in_turn(cache, *bundle, **options):
        with lock:
            return write(cache, *bundle, **options)

    JupyterCacheBase.cache_notebook_bundle = in_turn


def run(path, md_config, nb_config) -> str:
    """Run a notebook unless the cache has its output. Report its time, or the reason of its failure."""
    began = time.monotonic()
    text = Path(path).read_text("utf-8")
    reader = create_nb_reader(path, md_config, nb_config, text)
    if reader is None:
        return ""
    try:
        with create_client(reader.read(text), path, nb_config, _Quiet(_SILENT, {}), reader.read_fmt):
            pass
    except Exception as error:
        return f"FAILED {path}: {error.__cause__ or error}"
    return f"{Path(path).stem}: {time.monotonic() - began:.0f} s"


def run_all(app, env, docnames) -> None:
    """Run the notebooks among the pages that will be read."""
    if env.mystnb_config.execution_mode != "cache":
        return
    paths = {name: env.doc2path(name) for name in docnames}
    notebooks = [
        name for name, path in paths.items() if "\nkernelspec:" in Path(path).read_text("utf-8")[:500]
    ]
    notebooks.sort(key=lambda name: LONGEST.index(name) if name in LONGEST else len(LONGEST))
    get_cache(env.mystnb_config.execution_cache_path).db.dispose()  # creates its tables once
    fork = get_context("fork")
    with ProcessPoolExecutor(min(2, os.cpu_count() or 1), fork, write_in_turn, (fork.Lock(),)) as pool:
        waiting = [pool.submit(run, paths[name], env.myst_config, env.mystnb_config) for name in notebooks]
        said = [done.result() for done in waiting]
    if failed := [line for line in said if line.startswith("FAILED")]:
        raise ExtensionError("\n".join(failed))
    logging.getLogger(__name__).info("notebooks: %s", "; ".join(said))


def setup(app):
    """Register with Sphinx: notebooks run before the first page is read."""
    app.connect("env-before-read-docs", run_all)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""The pages in NiceGUI's simulated browser: no server, no sockets, no scripts."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import ModuleType

from nicegui.testing import User, user_simulation

MAIN = """
from pathlib import Path
from nicegui import ui
from kolsky.app.server import pages
pages(Path({folder!r}))
ui.run(storage_secret="simulated")
"""


def walk(folder: Path, main: Path, steps: Callable[[User], Awaitable[None]]) -> None:
    """Do the steps of a person in the pages over a folder. ``main``: where the program is written."""
    main.write_text(MAIN.format(folder=str(folder)), encoding="utf-8")

    async def all_steps() -> None:
        async with user_simulation(main_file=main) as user:
            await steps(user)

    before = {name: module for name, module in sys.modules.items() if _is_ours(name)}
    try:
        asyncio.run(all_steps())
    finally:
        _put_back(before)


def _is_ours(name: str) -> bool:
    return name.partition(".")[0] in ("dic", "doe", "explicit", "kolsky")


def _put_back(before: dict[str, ModuleType]) -> None:
    """Undo that the simulation forgets our packages, whose next import would have none of its parts."""
    sys.modules.update(before)
    for name in sorted(filter(_is_ours, sys.modules)):
        parent, _, child = name.rpartition(".")
        if parent in sys.modules:
            setattr(sys.modules[parent], child, sys.modules[name])

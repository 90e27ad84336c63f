"""The pages in NiceGUI's simulated browser: no server, no sockets, no scripts."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

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

    asyncio.run(all_steps())

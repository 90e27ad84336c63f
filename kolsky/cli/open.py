"""`kolsky open`: pages in the browser to set up, run, look at and compare shots."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.base.options import Option


def open_pages(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with shots or raw files.")],
    port: Annotated[
        int | None, Option("Port on this computer.", min=1024, max=65535, show_default="the first free one")
    ] = None,
    browser: Annotated[bool, Option("Open the browser; --no-browser only prints the address.")] = True,
) -> None:
    """Open a page in the browser to set up, run, look at and compare the shots below a folder.

    The page is served to this computer only. It writes the files that the other commands write.
    """
    if not folder.is_dir():
        raise InputError(folder, "is no folder", cure="give the folder that your shots lie below")
    from kolsky.app.server import serve

    serve(folder, port=port, browser=browser)

"""`kolsky new`: an annotated shot.toml to begin with."""

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from kolsky.base.errors import InputError


def new(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Where the shot's raw files are or will be.")
    ],
    bars: Annotated[
        bool, typer.Option("--bars", help="For a test between bars with strain gauges, without cameras.")
    ] = False,
) -> None:
    """Write an annotated shot.toml to fill in; an existing one is left as it is."""
    path = folder / "shot.toml"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(template(bars=bars))
    except FileExistsError as error:
        at_fault = path if folder.is_dir() else Path(error.filename)
        raise InputError(
            at_fault, "exists already and is left as it is", cure="edit it, or choose another folder"
        ) from None
    except OSError as error:
        raise InputError(folder, f"cannot be written ({error.strerror})") from None
    then = "waves" if bars else "check"
    typer.echo(f"wrote {path}; put the raw files beside it, fill it in, then: kolsky {then} {folder}")


def template(*, bars: bool = False) -> str:
    """The annotated shot.toml that every new shot begins with; `bars`: that of a test between bars."""
    name = "bars.toml" if bars else "shot.toml"
    return files("kolsky").joinpath("cli", "templates", name).read_text(encoding="utf-8")

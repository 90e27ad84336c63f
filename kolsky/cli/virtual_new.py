"""`kolsky virtual new`: an annotated specification of a virtual shot to begin with."""

import json
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from kolsky.cli.new_file import beginning
from kolsky.cli.options import AsJson


def virtual_new(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Where the specification is to be.")],
    as_json: AsJson = False,
) -> None:
    """Write an annotated SPEC.toml of a virtual shot; an existing one is left as it is."""
    path = folder / "SPEC.toml"
    with beginning(path), path.open("x", encoding="utf-8") as file:
        file.write(template())
    if as_json:
        typer.echo(json.dumps({"file": str(path)}, indent=2))
        return
    typer.echo(f"wrote {path}; change it, then: kolsky virtual make {path} --out {folder / 'shot'}")


def template() -> str:
    """The annotated specification, with every key at its default."""
    return files("kolsky").joinpath("cli", "templates", "virtual.toml").read_text(encoding="utf-8")

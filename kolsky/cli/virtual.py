"""`kolsky virtual new` and `make`: synthetic shots with a known answer, and their specification."""

import json
from importlib.resources import files
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from kolsky.base.errors import InputError
from kolsky.cli import texts
from kolsky.cli.new import beginning
from kolsky.cli.options import AsJson, Device, OutFolder, Threads


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


def virtual_make(
    specification: Annotated[
        Path, typer.Argument(metavar="SPEC.toml", help="The specification, or the folder it is in.")
    ],
    out: OutFolder,
    only: Annotated[
        str,
        typer.Option(
            metavar="NUMBERS", help="Of a population, which shots: e.g. 3 or 1-8,12.", show_default="all"
        ),
    ] = "",
    device: Device = "cpu",
    threads: Threads = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes that share the shots.")] = 1,
    as_json: AsJson = False,
) -> None:
    """Make the shot folders of a specification; shots that are there already are kept."""
    started = perf_counter()
    from kolsky.cli.terminal import print_result, since
    from kolsky.virtual.make import Made, make
    from kolsky.virtual.specification import read_specification

    series = read_specification(specification)
    numbers = texts.whole_numbers("--only", only) if only else None

    def said(made: Made) -> None:
        if not as_json:
            typer.echo(f"{made.folder}{'' if made.fresh else ' was there already'}")

    try:
        made = make(
            series, out, numbers=numbers, device=device, threads=threads, workers=workers, progress=said
        )
    except ValueError as error:
        raise InputError(
            specification, str(error), cure="correct the specification; `kolsky virtual new` writes one"
        ) from None
    fresh = sum(shot.fresh for shot in made)
    summary = {"shots": len(made), "made": fresh, "folder": str(out)}
    listed = {**summary, "folders": [str(shot.folder) for shot in made]}
    print_result(summary, listed if as_json else None, rest={"wall time": since(started)})

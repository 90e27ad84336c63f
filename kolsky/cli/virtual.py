"""`kolsky virtual new` and `make`: synthetic shots with a known answer, and their specification."""

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from kolsky.base.options import Option
from kolsky.cli import texts
from kolsky.cli.new import write_specification
from kolsky.cli.options import OutFolder
from kolsky.cli.terminal import as_json
from kolsky.inverse.settings import Device, Threads


def virtual_new(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the new specification.")],
) -> None:
    """Write an annotated SPEC.toml of a virtual shot; an existing one is left unchanged."""
    path = write_specification(folder, template())
    if not as_json():
        typer.echo(f"wrote {path}; change it, then: kolsky virtual make {path} --out {folder / 'shot'}")


def template() -> str:
    """The annotated specification, with every key at its default."""
    return files("kolsky").joinpath("cli", "templates", "virtual.toml").read_text(encoding="utf-8")


def virtual_make(
    specification: Annotated[
        Path, typer.Argument(metavar="SPEC.toml", help="The specification, or its folder.")
    ],
    out: OutFolder,
    only: Annotated[
        list[int] | None,
        Option(
            "Shots of a population, e.g. 3 or 1-8,12.",
            metavar="NUMBERS",
            show_default="all",
            read=texts.whole_numbers,
        ),
    ] = None,
    device: Device = "cpu",
    threads: Threads = None,
    workers: Annotated[int, Option("Number of parallel processes.", min=1)] = 1,
) -> None:
    """Make the shot folders of a specification; existing shots are left unchanged."""
    from kolsky.cli.terminal import print_result
    from kolsky.virtual.make import Made, make
    from kolsky.virtual.specification import read_specification

    series = read_specification(specification)

    def print_folder(made: Made) -> None:
        if not as_json():
            typer.echo(f"{made.folder}{'' if made.fresh else ' existed already'}")

    with texts.refused(
        cure="correct the specification; `kolsky virtual new` writes one", place=specification
    ):
        made = make(
            series, out, numbers=only, device=device, threads=threads, workers=workers, progress=print_folder
        )
    fresh = sum(shot.fresh for shot in made)
    summary = {"shots": len(made), "made": fresh, "folder": str(out)}
    print_result(summary, {**summary, "folders": [str(shot.folder) for shot in made]})

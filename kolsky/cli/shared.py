"""Options that several commands share, and how every command refuses bad input."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from kolsky.base.errors import InputError

ShotPath = Annotated[Path, typer.Argument(metavar="SHOT", help="A shot's folder, or its shot.toml.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object (SI units) instead of a table.")]

Numbers = Annotated[
    list[str] | None,
    typer.Option(
        "-p", "--parameter", metavar="NAME=VALUE", help="Hold a parameter at this value (SI or with unit)."
    ),
]
Precision = Annotated[str, typer.Option(help="Arithmetic of the solver: fp64 or fp32.")]
Device = Annotated[str, typer.Option(help='"cpu" or a CUDA device such as "cuda:0".')]
Threads = Annotated[int | None, typer.Option(min=1, help="CPU threads.", show_default="all cores")]
PastData = Annotated[
    str,
    typer.Option(
        metavar="CHOICE",
        help="Past the last point of the quasi-static curve the law continues on its tangent (continue), or "
        "the run ends (stop).",
    ),
]
Element = Annotated[
    str, typer.Option(help="one_point, or fbar: fully integrated, nothing to tune, three times as dear.")
]
Hourglass = Annotated[str, typer.Option(help="Hourglass control of one_point: stiffness or viscous.")]
Corrected = Annotated[
    bool,
    typer.Option(
        "--nearly-incompressible",
        help="Run the mesh at poisson = 0.495 and correct to the wanted one on coarser meshes: cheaper from "
        "0.499 on.",
    ),
]
Mesh = Annotated[str, typer.Option(metavar="NRxNY", help="Elements across the radius x along the length.")]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="FOLDER", help="Where results go.", show_default="SHOT/results"),
]


@contextmanager
def refusing_bad_input() -> Iterator[None]:
    """Turn an `InputError` into its lines on stderr and exit code 2."""
    try:
        yield
    except InputError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(2) from None


def listed(names: str) -> tuple[str, ...]:
    """The names of a comma-separated option."""
    return tuple(part.strip() for part in names.split(",") if part.strip())

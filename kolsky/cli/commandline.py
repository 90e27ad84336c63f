"""The commands of `kolsky` in the order of `--help`, and what the program does before any of them."""

import sys
from io import TextIOWrapper
from typing import Annotated

import typer

from kolsky.cli.bars import repeats, waves, wavespeed
from kolsky.cli.identified import film, rate, report
from kolsky.cli.identify import identify, simulate
from kolsky.cli.material import material
from kolsky.cli.pictures import calibrate, dic
from kolsky.cli.plan import plan
from kolsky.cli.shots import channels, check, new
from kolsky.cli.sweep import sweep

app = typer.Typer(
    name="kolsky",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="One impact test on a soft material, in; its dynamic stiffness with its uncertainty, out.",
)


def main() -> None:
    """Entry point of the `kolsky` command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # A terminal without a character (± in an old code page) gets its escape, not a traceback.
            stream.reconfigure(errors="backslashreplace")
    app()


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import PackageNotFoundError, version

        try:
            typer.echo(f"kolsky {version('kolsky')}")
        except PackageNotFoundError:
            typer.echo("kolsky, not installed (running from its source folder)")
        raise typer.Exit


@app.callback()
def _kolsky(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    pass


COMMANDS = (
    new,
    check,
    channels,
    dic,
    waves,
    wavespeed,
    repeats,
    rate,
    calibrate,
    identify,
    report,
    simulate,
    plan,
    sweep,
    film,
)
for command in COMMANDS:
    app.command()(command)
app.add_typer(material)

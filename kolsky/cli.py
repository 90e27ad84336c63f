"""The command line: parse, call, print. Imports beyond typer stay inside the commands: `--help` is fast."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from kolsky.errors import InputError

app = typer.Typer(
    name="kolsky",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="One impact test on a soft material, in; its dynamic stiffness with its uncertainty, out.",
)

ShotPath = Annotated[Path, typer.Argument(metavar="SHOT", help="A shot's folder, or its shot.toml.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object (SI units) instead of a table.")]


def main() -> None:
    """Entry point of the `kolsky` command."""
    app()


@contextmanager
def refusing_bad_input() -> Iterator[None]:
    """Turn an `InputError` into its lines on stderr and exit code 2."""
    try:
        yield
    except InputError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(2) from None


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


@app.command()
def new(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Where the shot's raw files are or will be.")
    ],
) -> None:
    """Write an annotated shot.toml to fill in; an existing one is left as it is."""
    from kolsky.newshot import write_template

    with refusing_bad_input():
        path = write_template(folder)
    typer.echo(f"wrote {path}; put the raw files beside it, fill it in, then: kolsky check {folder}")


@app.command()
def check(shot: ShotPath, as_json: AsJson = False) -> None:
    """Read a shot, refuse what cannot be right, and show what was understood."""
    import json

    from kolsky.shots import load_shot
    from kolsky.shotsummary import as_json as summary_json

    with refusing_bad_input():
        loaded = load_shot(shot)
    if as_json:
        typer.echo(json.dumps(summary_json(loaded), indent=2, allow_nan=False))
    else:
        from kolsky.shotsummary import print_table

        print_table(loaded)


if __name__ == "__main__":
    main()

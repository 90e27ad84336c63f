"""The options of `kolsky new`, `check` and `channels`: what a shot is made of."""

from pathlib import Path
from typing import Annotated

import typer

from kolsky.cli.shared import AsJson, ShotPath, refusing_bad_input


def new(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Where the shot's raw files are or will be.")
    ],
    bars: Annotated[
        bool, typer.Option("--bars", help="For a test between bars with strain gauges, without cameras.")
    ] = False,
) -> None:
    """Write an annotated shot.toml to fill in; an existing one is left as it is."""
    from kolsky.cli.work.new import write_template

    with refusing_bad_input():
        path = write_template(folder, bars=bars)
    then = "waves" if bars else "check"
    typer.echo(f"wrote {path}; put the raw files beside it, fill it in, then: kolsky {then} {folder}")


def check(shot: ShotPath, as_json: AsJson = False) -> None:
    """Read a shot, refuse what cannot be right, and show what was understood."""
    import json

    from kolsky.shot.load import check_shot
    from kolsky.shot.summary import as_json as summary_json

    with refusing_bad_input():
        loaded = check_shot(shot)
    if as_json:
        typer.echo(json.dumps(summary_json(loaded), indent=2, allow_nan=False))
    else:
        from kolsky.shot.summary import print_table

        print_table(loaded)


def channels(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of an oscilloscope or recorder.")],
    form: Annotated[str | None, typer.Option("--format", help="Its format.", show_default="found")] = None,
    encoding: Annotated[str | None, typer.Option(help="Of text.", show_default="found")] = None,
    delimiter: Annotated[
        str | None, typer.Option(help="comma, semicolon, tab or blanks.", show_default="found")
    ] = None,
    decimal: Annotated[str | None, typer.Option(help='"." or ",".', show_default="found")] = None,
    header_line: Annotated[
        int | None, typer.Option(min=0, help="Line of the column names; 0: none.", show_default="found")
    ] = None,
    sheet: Annotated[str | None, typer.Option(help="Sheet of a workbook.")] = None,
    time: Annotated[str | None, typer.Option(help="The time column, by name or number.")] = None,
    time_unit: Annotated[str | None, typer.Option(help="Its unit, e.g. ms.")] = None,
    interval: Annotated[
        str | None, typer.Option(help='Time from sample to sample, e.g. "100 ns".', show_default="found")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show what is in a recorder's file: channels, units, clock, and how the file was understood.

    The options are the keys of a `layout` in shot.toml, to try them out.
    """
    with refusing_bad_input():
        from kolsky.cli.work.channels import show

        show(
            file,
            as_json=as_json,
            format=form,
            encoding=encoding,
            delimiter=delimiter,
            decimal=decimal,
            header_line=header_line,
            sheet=sheet,
            time=time,
            time_unit=time_unit,
            interval=interval,
        )

"""`kolsky check` and `channels`: what was read from a shot, or from one recorder's file."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dic.files import one_line
from kolsky.cli import texts
from kolsky.cli.options import AsJson, HeaderLine, Out, ShotPath

if TYPE_CHECKING:
    from kolsky.readers.contents import ChannelInfo


def check(shot: ShotPath, out: Out = None, as_json: AsJson = False) -> None:
    """Read a shot, refuse what cannot be right, and show what was understood.

    Of a test between bars these are the files, the strains at the gauges, arrivals and windows; nothing is
    reduced yet. Beside the table stands a page with the signals on one clock, the window and the outline at
    three times; --json writes none.
    """
    from kolsky.shot import summary
    from kolsky.shot.load import check_shot

    loaded = check_shot(shot)
    if as_json:
        print(json.dumps(summary.as_json(loaded), indent=2, allow_nan=False))
        return
    summary.print_table(loaded)
    from kolsky.base.files import filling, usable_folder
    from kolsky.report.pages.check import PAGE, write_page
    from kolsky.schema.shot_file import folder_of

    folder = usable_folder(out or folder_of(shot) / "results")
    with filling(folder) as partial:
        write_page(partial / PAGE, loaded)
    print(f"page: {folder / PAGE}")


def channels(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of an oscilloscope or recorder.")],
    form: Annotated[str | None, typer.Option("--format", help="Its format.", show_default="found")] = None,
    encoding: Annotated[str | None, typer.Option(help="Of text.", show_default="found")] = None,
    delimiter: Annotated[
        str | None, typer.Option(help="comma, semicolon, tab or blanks.", show_default="found")
    ] = None,
    decimal: Annotated[str | None, typer.Option(help='"." or ",".', show_default="found")] = None,
    header_line: HeaderLine = None,
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
    from kolsky.readers.contents import Layout
    from kolsky.readers.recordings import list_channels

    layout = Layout(
        format=form,
        encoding=encoding,
        delimiter=delimiter,
        decimal=decimal,
        header_line=header_line,
        sheet=sheet,
        time=time,
        time_unit=time_unit,
        interval=None if interval is None else texts.physical("--interval", interval, "s"),
    )
    found = list_channels(file, layout=layout)
    if as_json:
        typer.echo(json.dumps(_channels_json(file, found), indent=2, allow_nan=False))
    else:
        typer.echo(_channel_table(file, found))


def _channel_unit(channel: "ChannelInfo") -> str | None:
    """The unit that the file states, or that its heading has in brackets."""
    from kolsky.readers.header import heading_unit

    return channel.unit or heading_unit(channel.name)


def _channels_json(file: Path, found: "list[ChannelInfo]") -> dict[str, Any]:
    first = asdict(found[0])
    return {
        "file": str(file),
        "found": first["facts"],
        "metadata": first["metadata"],
        "channels": [
            {key: value for key, value in asdict(channel).items() if key not in ("facts", "metadata")}
            | {"unit": _channel_unit(channel)}
            for channel in found
        ],
    }


def _channel_table(file: Path, found: "list[ChannelInfo]") -> str:
    facts, metadata = found[0].facts, found[0].metadata
    lines = [str(file), *(f"  {key}: {value}" for key, value in facts.items()), ""]
    width = max(len(channel.name) for channel in found)
    for channel in found:
        unit = _channel_unit(channel) or "unit not stated"
        lines.append(f"  {channel.number:>3}  {channel.name:<{width}}  {unit}  {channel.samples} samples")
    for words, clock in dict.fromkeys((c.time, (c.start, c.interval)) for c in found):
        start, interval = clock
        known = "" if interval is None else f"from {start:.9g} s every {interval:.9g} s: "
        lines += ["", f"  time: {known}{words}"]
    if metadata:
        lines += ["", *(f"  {key} = {value}" for key, value in metadata.items() if value)]
    return "\n".join(one_line(line) for line in lines)

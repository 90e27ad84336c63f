"""`kolsky check` and `channels`: what was read from a shot, or from one recorder's file."""

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dic.files import one_line
from kolsky.base.options import HeaderLine, Option, SheetName
from kolsky.cli.options import Out, ShotPath
from kolsky.cli.terminal import as_json, print_json

if TYPE_CHECKING:
    from kolsky.readers.contents import ChannelInfo


def check(shot: ShotPath, out: Out = None) -> None:
    """Read a shot, compare its inputs, reject contradictions, and show how its files were read.

    For a test between bars it shows the files, the strains at the gauges, arrivals and windows, without a
    reduction. It also writes a page with the signals on one clock, the window, the outline at three times
    and the quasi-static curve; with --json it does not.
    """
    from kolsky.shot import summary
    from kolsky.shot.load import check_shot

    loaded = check_shot(shot)
    if as_json():
        print_json(summary.as_json(loaded))
        return
    summary.print_table(loaded)
    for remark in summary.remarks(loaded):
        print(one_line(f"warning: {remark}"), file=sys.stderr)
    from kolsky.base.files import filling, usable_folder
    from kolsky.report.pages.waves import PAGE, write_check
    from kolsky.schema.shot_file import folder_of

    folder = usable_folder(out or folder_of(shot) / "results")
    with filling(folder) as partial:
        write_check(partial / PAGE, loaded)
    print(f"page: {folder / PAGE}")


def channels(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of an oscilloscope or recorder.")],
    form: Annotated[
        str | None, Option("Format of the file.", name="format", show_default="found in the file")
    ] = None,
    encoding: Annotated[
        str | None, Option("Encoding of a text file.", show_default="found in the file")
    ] = None,
    delimiter: Annotated[
        str | None, Option("comma, semicolon, tab or blanks.", show_default="found in the file")
    ] = None,
    decimal: Annotated[
        str | None, Option('Decimal sign: "." or ",".', show_default="found in the file")
    ] = None,
    header_line: HeaderLine = None,
    sheet: SheetName = None,
    time: Annotated[str | None, Option("The time column, by name or number.")] = None,
    time_unit: Annotated[str | None, Option("Unit of the time column, e.g. ms.")] = None,
    interval: Annotated[
        float | None,
        Option('Time between samples, e.g. "100 ns".', unit="s", show_default="found in the file"),
    ] = None,
) -> None:
    """Show the contents of a recorder's file: channels, units, clock, and how the file was read.

    The options are the keys of a `layout` in shot.toml.
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
        interval=interval,
    )
    infos = list_channels(file, layout=layout)
    if as_json():
        print_json(_channels_json(file, infos))
    else:
        typer.echo(_channel_table(file, infos))


def _channel_unit(channel: "ChannelInfo") -> str | None:
    """The unit that the file states, or that its heading has in brackets."""
    from kolsky.readers.header import heading_unit

    return channel.unit or heading_unit(channel.name)


def _channels_json(file: Path, infos: "list[ChannelInfo]") -> dict[str, Any]:
    first = asdict(infos[0])
    return {
        "file": str(file),
        "found": first["facts"],
        "metadata": first["metadata"],
        "channels": [
            {key: value for key, value in asdict(channel).items() if key not in ("facts", "metadata")}
            | {"unit": _channel_unit(channel)}
            for channel in infos
        ],
    }


def _channel_table(file: Path, infos: "list[ChannelInfo]") -> str:
    from kolsky.readers.contents import clock_words

    facts, metadata = infos[0].facts, infos[0].metadata
    lines = [str(file), *(f"  {key}: {value}" for key, value in facts.items()), ""]
    width = max(len(channel.name) for channel in infos)
    for channel in infos:
        unit = _channel_unit(channel) or "unit not stated"
        lines.append(f"  {channel.number:>3}  {channel.name:<{width}}  {unit}  {channel.samples} samples")
    clocks: dict[tuple[str, float | None, float | None, int], list[str]] = {}
    for channel in infos:
        key = (channel.time, channel.start, channel.interval, channel.samples)
        clocks.setdefault(key, []).append(channel.name)
    for (words, start, interval, samples), names in clocks.items():
        whose = f" of {', '.join(names)}" if len(clocks) > 1 else ""
        if interval is not None:
            spoken = clock_words(interval, samples)
            words = f"from {start:.9g} s every {interval:.9g} s ({spoken}): {words}"
        lines += ["", f"  time{whose}: {words}"]
    if metadata:
        lines += ["", *(f"  {key} = {value}" for key, value in metadata.items() if value)]
    return "\n".join(one_line(line) for line in lines)

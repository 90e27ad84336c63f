"""`kolsky new`, `open`, `check` and `channels`: from a folder of measurements to a valid shot."""

import sys
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dic.files import one_line
from kolsky.base.errors import InputError
from kolsky.base.files import beginning, template_file, usable_folder, write_folder
from kolsky.base.options import Option
from kolsky.cli.options import Out, ShotPath
from kolsky.cli.terminal import as_json, print_json
from kolsky.readers.layout import Layout

if TYPE_CHECKING:
    from kolsky.readers.contents import ChannelInfo
    from kolsky.survey.pictures import PictureSurvey
    from kolsky.survey.tables import Survey


def write_template(folder: Path, name: str, then: str) -> None:
    """Write a template as SPEC.toml, unless the folder has one, and print its place and what to do then."""
    path = folder / "SPEC.toml"
    with beginning(path), path.open("x", encoding="utf-8") as file:
        file.write(template_file(name))
    if as_json():
        print_json({"file": str(path)})
    else:
        typer.echo(f"wrote {path}; {then.format(path)}")


def new(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the shot's raw files.")],
    bars: Annotated[bool, Option("For a test between bars with strain gauges, without cameras.")] = False,
    pictures: Annotated[bool, Option("For pictures of two cameras instead of exports.")] = False,
    previous: Annotated[
        Path | None,
        Option("The last shot of a series, with the same apparatus.", name="from", metavar="SHOT"),
    ] = None,
) -> None:
    """Write a shot.toml with the files, columns, units and clocks of a folder, and blanks for other facts.

    An existing file is left unchanged.
    """
    from kolsky.survey.blank_file import write_new

    if sum((bars, pictures, previous is not None)) > 1:
        raise InputError(folder, "--bars, --pictures and --from exclude each other", cure="give one of them")
    path, contents, series = write_new(folder, bars=bars, pictures=pictures, previous=previous)
    found = _found_lines(path, contents, bars=bars, pictures=series)
    if as_json():
        print_json(found)
        return
    lines = [f"{name}: a recording" for name in found["recordings"]]
    for part, name in found["found"].items():
        table, dot, camera = part.partition(".camera")
        lines.append(f"{name}: [{table}]{dot.replace('.', ' ')}{camera}")
    for one in () if series is None else series.others:
        lines.append(f"{one.said}: not clearly part of the shot")
    for line in (*lines, *(f"{name}: {why}" for name, why in found["doubtful"].items())):
        typer.echo(f"  {line}")
    typer.echo(f"wrote {path}; fill in what is empty, then: kolsky check {folder}")


def _found_lines(
    path: Path, contents: "Survey", *, bars: bool, pictures: "PictureSurvey | None"
) -> dict[str, Any]:
    """Detected values, and values to be filled in, as one object."""
    from kolsky.base.toml import blanks

    recordings = [table.path.name for table in contents.recordings] if bars else []
    found = {} if bars else {part: table.path.name for part, table in contents.parts.items()}
    if pictures is not None:
        for table, series in (("pictures", pictures.test), ("calibration", pictures.target)):
            found |= {f"{table}.camera_{i}": one.name for i, one in enumerate(series)}
    elif not bars:
        exports = {"surface": contents.surface.specimen, "surface.flyer": contents.surface.flyer}
        found |= {part: one.pattern for part, one in exports.items() if one is not None}
    return {
        "file": str(path),
        "found": found,
        "recordings": recordings,
        "doubtful": {name: why for name, why in contents.doubtful.items() if name not in recordings},
        "to_fill_in": list(blanks(tomllib.loads(path.read_text("utf-8")))),
    }


def open_pages(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with shots or raw files.")],
    port: Annotated[
        int | None, Option("Port on this computer.", min=1024, max=65535, show_default="the first free one")
    ] = None,
    browser: Annotated[bool, Option("Open the browser; --no-browser only prints the address.")] = True,
) -> None:
    """Open a page in the browser to set up, run, look at and compare the shots below a folder.

    The page is served to this computer only. It writes the files that the other commands write.
    """
    if not folder.is_dir():
        raise InputError(folder, "is not a folder", cure="give the folder that your shots lie below")
    from kolsky.app.server import serve

    serve(folder, port=port, browser=browser)


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
    from kolsky.report.pages.waves import PAGE, render_check
    from kolsky.schema.shot_file import folder_of

    folder = usable_folder(out or folder_of(shot) / "results")
    write_folder(folder, {PAGE: render_check(loaded)})
    print(f"page: {folder / PAGE}")


def channels(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of an oscilloscope or recorder.")],
    *,
    layout: Layout,
) -> None:
    """Show the contents of a recorder's file: channels, units, clock, and how the file was read.

    The options are the keys of a `layout` in shot.toml.
    """
    from kolsky.readers.recordings import list_channels

    infos = list_channels(file, layout=layout)
    if as_json():
        print_json(_channels_json(file, infos))
    else:
        typer.echo(_channel_table(file, infos))


def _channel_unit(channel: "ChannelInfo") -> str | None:
    """The unit that the file declares, or that its heading has in brackets."""
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

"""`kolsky new` and `open`: begin with a folder of measurements, on the command line or in the browser."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from kolsky.base.errors import InputError
from kolsky.base.options import Option
from kolsky.cli.terminal import as_json, print_json

if TYPE_CHECKING:
    from kolsky.survey.pictures import PictureSurvey
    from kolsky.survey.tables import Survey


@contextmanager
def beginning(path: Path) -> Iterator[None]:
    """Make the folder of a new file, and refuse what keeps either from being written.

    Within it the file is to be opened with the mode "x".

    Raises InputError if the file exists, something else stands where its folder is to be, or either cannot be
    written.
    """
    folder = path.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except FileExistsError as error:
        at_fault = path if folder.is_dir() else Path(error.filename)
        raise InputError(
            at_fault, "exists already and was not changed", cure="edit it, or choose another folder"
        ) from None
    except OSError as error:
        raise InputError(
            folder, f"cannot be written ({error.strerror})", cure="give another folder, or make it writable"
        ) from None


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
    from kolsky.survey.blank_file import new_text
    from kolsky.survey.tables import survey

    if sum((bars, pictures, previous is not None)) > 1:
        raise InputError(folder, "--bars, --pictures and --from exclude each other", cure="give one of them")
    path = folder / "shot.toml"
    last = None if previous is None else _text_of(previous)
    with beginning(path):
        contents = survey(folder)
        series = _pictures(folder, contents) if pictures else None
        text = new_text(contents, folder, bars=bars, pictures=series, last=last)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    if as_json():
        print_json(_found_lines(path, text, contents, bars=bars, pictures=series))
        return
    if bars:
        for table in contents.recordings:
            typer.echo(f"  {table.path.name}: a recording")
    else:
        for part, table in contents.parts.items():
            typer.echo(f"  {table.path.name}: [{part}]")
    for part, pattern in ({} if bars or pictures else _series(contents)).items():
        typer.echo(f"  {pattern}: [{part}]")
    for key, name in _parts(series).items():
        typer.echo(f"  {name}: [{key.partition('.')[0]}] {key.partition('.')[2]}")
    for one in () if series is None else series.others:
        typer.echo(f"  {one.said}: of no part of the shot beyond doubt")
    recordings = {table.path.name for table in contents.recordings} if bars else set()
    for name, why in contents.doubtful.items():
        if name not in recordings:
            typer.echo(f"  {name}: {why}")
    typer.echo(f"wrote {path}; fill in what is empty, then: kolsky check {folder}")


def _pictures(folder: Path, contents: "Survey") -> "PictureSurvey":
    from kolsky.survey.pictures import survey_pictures

    return survey_pictures(folder, contents)


def _series(contents: "Survey") -> dict[str, str]:
    """Part of a shot -> pattern and program of the exports that show it."""
    both = {"surface": contents.surface.specimen, "surface.flyer": contents.surface.flyer}
    return {part: one.pattern for part, one in both.items() if one is not None}


def _parts(pictures: "PictureSurvey | None") -> dict[str, str]:
    """Dotted key -> file or pattern of the pictures that were found."""
    if pictures is None:
        return {}
    both = (("pictures", pictures.test), ("calibration", pictures.target))
    return {f"{table}.camera_{i}": one.name for table, series in both for i, one in enumerate(series)}


def _found_lines(
    path: Path, text: str, contents: "Survey", *, bars: bool, pictures: "PictureSurvey | None"
) -> dict[str, Any]:
    """What was found and what is left to fill in, as one object."""
    from kolsky.base.toml import blanks

    recordings = [table.path.name for table in contents.recordings] if bars else []
    return {
        "file": str(path),
        "found": {
            **({} if bars else {part: table.path.name for part, table in contents.parts.items()}),
            **({} if bars or pictures else _series(contents)),
            **_parts(pictures),
        },
        "recordings": recordings,
        "doubtful": {name: why for name, why in contents.doubtful.items() if name not in recordings},
        "to_fill_in": list(blanks(tomllib.loads(text))),
    }


def _text_of(series: Path) -> str:
    from kolsky.base.files import decode, read_bytes
    from kolsky.base.toml import TOML_LIMIT
    from kolsky.schema.shot_file import find_shot_file

    path = find_shot_file(series)
    return decode(path, read_bytes(path, limit=TOML_LIMIT))


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
        raise InputError(folder, "is no folder", cure="give the folder that your shots lie below")
    from kolsky.app.server import serve

    serve(folder, port=port, browser=browser)

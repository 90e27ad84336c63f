"""`kolsky new`: a shot.toml to fill in, with what the folder's files show.

An existing file is left unchanged.
"""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
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
            at_fault, "exists already and is left as it is", cure="edit it, or choose another folder"
        ) from None
    except OSError as error:
        raise InputError(
            folder, f"cannot be written ({error.strerror})", cure="give another folder, or make it writable"
        ) from None


def new(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Where the shot's raw files are or will be.")
    ],
    bars: Annotated[bool, Option("For a test between bars with strain gauges, without cameras.")] = False,
    pictures: Annotated[bool, Option("For pictures of two cameras in place of exports.")] = False,
    previous: Annotated[
        Path | None, Option("The last shot of a series; its apparatus stays.", name="from", metavar="SHOT")
    ] = None,
) -> None:
    """Write a shot.toml: files, columns, units and clocks as found, facts blank; one that exists is kept."""
    from kolsky.survey.tables import survey

    if sum((bars, pictures, previous is not None)) > 1:
        raise InputError(folder, "--bars, --pictures and --from exclude each other", cure="give one of them")
    path = folder / "shot.toml"
    last = None if previous is None else _text_of(previous)
    with beginning(path):
        found = survey(folder)
        series = _pictures(folder, found) if pictures else None
        text = written(found, folder, bars=bars, pictures=series, last=last)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    if as_json():
        print_json(_found_lines(path, text, found, bars=bars, pictures=series))
        return
    if bars:
        for table in found.recordings:
            typer.echo(f"  {table.path.name}: a recording")
    else:
        for part, table in found.parts.items():
            typer.echo(f"  {table.path.name}: [{part}]")
    for key, name in _parts(series).items():
        typer.echo(f"  {name}: [{key.partition('.')[0]}] {key.partition('.')[2]}")
    for one in () if series is None else series.others:
        typer.echo(f"  {one.said}: of no part of the shot beyond doubt")
    recorded = {table.path.name for table in found.recordings} if bars else set()
    for name, why in found.doubtful.items():
        if name not in recorded:
            typer.echo(f"  {name}: {why}")
    typer.echo(f"wrote {path}; fill in what is empty, then: kolsky check {folder}")


def _pictures(folder: Path, found: "Survey") -> "PictureSurvey":
    from kolsky.survey.pictures import survey_pictures

    return survey_pictures(folder, found)


def _parts(pictures: "PictureSurvey | None") -> dict[str, str]:
    """Dotted key -> file or pattern of the pictures that were found."""
    if pictures is None:
        return {}
    both = (("pictures", pictures.test), ("calibration", pictures.target))
    return {f"{table}.camera_{i}": one.name for table, series in both for i, one in enumerate(series)}


def _found_lines(
    path: Path, text: str, found: "Survey", *, bars: bool, pictures: "PictureSurvey | None"
) -> dict[str, Any]:
    """What was found and what is left to fill in, as one object."""
    from kolsky.base.toml import blanks

    recorded = [table.path.name for table in found.recordings] if bars else []
    return {
        "file": str(path),
        "found": {
            **({} if bars else {part: table.path.name for part, table in found.parts.items()}),
            **_parts(pictures),
        },
        "recordings": recorded,
        "doubtful": {name: why for name, why in found.doubtful.items() if name not in recorded},
        "to_fill_in": list(blanks(tomllib.loads(text))),
    }


def written(
    found: "Survey",
    folder: Path,
    *,
    bars: bool = False,
    pictures: "PictureSurvey | None" = None,
    last: str | None = None,
) -> str:
    """The text of the new shot file: the blank one, or the last shot's, with what the files say."""
    from kolsky.survey.new_file import fill_in, next_of_series, notes_of, values_of, with_notes

    if last is not None:
        return with_notes(next_of_series(last, folder, found), notes_of(found))
    text = template(bars=bars, pictures=pictures is not None)
    if bars:
        from kolsky.survey.new_file import with_recordings

        return with_recordings(text, found)
    values, notes = values_of(found), notes_of(found)
    if pictures is not None:
        from kolsky.survey.pictures import picture_notes, picture_values

        values = {k: v for k, v in values.items() if not k.startswith(("flyer.", "centre_line."))}
        values |= picture_values(pictures)
        notes |= picture_notes(pictures)
        if pictures.target:
            text = text.replace("# [calibration.target]", "[calibration.target]", 1)
    return with_notes(fill_in(text, values), notes)


def template(*, bars: bool = False, pictures: bool = False) -> str:
    """The blank shot.toml that every new shot begins with: with exports, with pictures, or between bars."""
    text = _resource("bars.toml" if bars else "shot.toml")
    if not pictures:
        return text
    before, after = text.index("[flyer]"), text.index("# [reporting]")
    return text[:before] + _resource("pictures.toml") + text[after:]


def _resource(name: str) -> str:
    return files("kolsky").joinpath("cli", "templates", name).read_text(encoding="utf-8")


def _text_of(series: Path) -> str:
    from kolsky.base.files import decode, read_bytes
    from kolsky.base.toml import TOML_LIMIT
    from kolsky.schema.shot_file import find_shot_file

    path = find_shot_file(series)
    return decode(path, read_bytes(path, limit=TOML_LIMIT))

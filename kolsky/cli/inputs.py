"""Loading of the shot that a command is about."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from kolsky.base.errors import InputError

if TYPE_CHECKING:
    from kolsky.shot.picture_set import PictureSet
    from kolsky.shot.records import OpticalData, Shot


def load(shot: Path, out: Path | None, *inside: str, forks: bool = True) -> "tuple[Shot, Path]":
    """The shot, and the folder its results go to: refused now if unusable, not after the work.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    out
        Where results go; by default the folder "results" of the shot.
    inside
        Folders inside it.
    forks
        Whether pictures may be correlated by several processes.

    Raises
    ------
    InputError
        If the shot cannot be used, or the folder cannot be written to.
    """
    from kolsky.base.files import usable_folder
    from kolsky.cli.terminal import progress_bars
    from kolsky.shot.load import load_shot
    from kolsky.shot.schema.reading import folder_of

    place = out or folder_of(shot) / "results"

    def measure(pictures: "PictureSet") -> "OpticalData":
        from dic.forks import forking
        from kolsky.base.process import keep_freed_memory
        from kolsky.shot.optical_data import measured

        keep_freed_memory()
        with progress_bars() as progress, forking() if forks else nullcontext():
            return measured(pictures, usable_folder(place), progress=progress)

    loaded = load_shot(shot, measure=measure)
    return loaded, usable_folder(place.joinpath(*inside))


@contextmanager
def usable(shot: "Shot") -> Iterator[None]:
    """Make bad input of a shot that cannot be worked with: one line, exit code 2."""
    try:
        yield
    except ValueError as error:
        raise InputError(
            shot.folder,
            str(error),
            cure="correct shot.toml or the option that it names; `kolsky check` shows what was read",
        ) from error

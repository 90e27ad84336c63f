"""Registry of picture formats; a file is known by its first bytes, not by its name."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dic.files import regular
from dic.images import cine, hdf5, numbered, photron, tiff
from dic.images.facts import declared
from dic.images.series import PictureError, Pictures


@dataclass(frozen=True)
class Format:
    """A picture file format."""

    name: str
    """Name for users."""
    sniff: Callable[[Path, bytes], bool]
    """True if a file, given with its first `SNIFFED` bytes, is of this format."""
    read: Callable[[Path], Pictures]
    """Opens it."""


SNIFFED = 512
"""Bytes at the start of a file that `sniff` gets."""

FORMATS = (
    Format("TIFF", tiff.sniff, tiff.read),
    Format("HDF5", hdf5.sniff, hdf5.read),
    Format("Phantom cine", cine.sniff, cine.read),
    Format("Photron mraw", photron.sniff, photron.read),
)
"""Formats that hold a series in one file, in the order in which they are asked."""


def open_pictures(
    path: Path | str | Sequence[Path | str],
    *,
    pattern: str | None = None,
    bits: int | None = None,
    crop_offset: tuple[float, float] | None = None,
    times: Sequence[float] | None = None,
    n_frames: int | None = None,
) -> Pictures:
    """Open the pictures of one camera, whatever the format.

    Parameters
    ----------
    path
        A file of any of the formats; a folder with a numbered series of TIFF, PNG, JPEG or BMP files; or
        a list of such files in the order of the frames.
    pattern
        In a folder: the names of the series with one `*` for the number, ``"cam0_*.png"``. In an HDF5
        file: the name of the dataset.
    bits, crop_offset, times, n_frames
        What the files do not say, or say wrongly: `dic.images.facts.declared`.

    Returns
    -------
    Pictures
        The series. Only headers were read.

    Raises
    ------
    PictureError
        If there is nothing at `path`, no format fits, or the headers cannot be right.
    """
    try:
        pictures = _opened(path, pattern)
    except OSError as error:
        raise PictureError(
            error.filename or str(path),
            f"cannot be read ({error.strerror})",
            cure="copy it again, and see that it may be read",
        ) from None
    if bits is None and crop_offset is None and times is None and n_frames is None:
        return pictures
    return declared(pictures, bits=bits, crop_offset=crop_offset, times=times, n_frames=n_frames)


def _opened(path: Path | str | Sequence[Path | str], pattern: str | None) -> Pictures:
    if not isinstance(path, Path | str):
        if pattern is not None:
            raise PictureError(
                "list of files", f'takes no pattern, got "{pattern}"', cure="leave pattern out"
            )
        return numbered.read_files([Path(one) for one in path])
    path = Path(path)
    if path.is_dir():
        return numbered.read_folder(path, pattern)
    with open(regular(path), "rb") as file:
        start = file.read(SNIFFED)
    if pattern is not None:
        if hdf5.sniff(path, start):
            return hdf5.read(path, pattern)
        raise PictureError(
            path,
            f'is no folder: pattern "{pattern}" has nothing to choose from',
            cure="leave pattern out, or name the folder",
        )
    for known in FORMATS:
        if known.sniff(path, start):
            return known.read(path)
    if path.suffix.lower() in numbered.SUFFIXES:
        return numbered.read_files([path])
    names = ", ".join(known.name for known in FORMATS)
    raise PictureError(path, f"is none of {names}, PNG, JPEG, BMP", cure="export it as TIFF")

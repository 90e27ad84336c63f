"""Picture series: the registry of file formats, and facts declared by the caller.

A file is recognised by its first bytes; its name is not used. To add a format, write its module and add one
line to `FORMATS`. Series are read lazily. `health` inspects frames; `quality` rates their noise and speckles.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, is_dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dic.files import regular
from dic.images import cine, hdf5, numbered, photron, tiff
from dic.images.health import FrameHealth, check_series, frame_health
from dic.images.numbered import WEIGHTS
from dic.images.quality import GreyNoise, SpeckleQuality, grey_noise, speckle_quality
from dic.images.series import MOST_FRAMES, Grey, PictureError, Pictures, checked_frame, checked_index
from dic.outcome import Remark


@dataclass(frozen=True)
class DeclaredPictures:
    """A series with some of its facts declared; see `dic.images.Pictures`."""

    pictures: Pictures
    """The series as stored in its file."""
    n_frames: int
    bits: int
    crop_offset: tuple[float, float]
    times: NDArray[np.float64] | None

    @property
    def path(self) -> Path:
        """The file, or the folder of a numbered series."""
        return self.pictures.path

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns [px]."""
        return self.pictures.shape

    def frame(self, index: int) -> Grey:
        """Grey values of one frame as recorded, shape [rows, columns].

        Raises PictureError if the file has no such frame, if the frame cannot be read, or if a grey value
        needs more than `bits`.
        """
        if checked_index(self.n_frames, index) >= self.pictures.n_frames:
            raise PictureError(
                self.path,
                f"the file holds {self.pictures.n_frames} of {self.n_frames} declared frames",
                frame=index,
                cure="export the pictures again",
            )
        return checked_frame(self.path, index, self.pictures.frame(index), self.shape, self.bits)


def declared(
    pictures: Pictures,
    *,
    bits: int | None = None,
    crop_offset: tuple[float, float] | None = None,
    times: Sequence[float] | NDArray[np.float64] | None = None,
    n_frames: int | None = None,
) -> DeclaredPictures:
    """A series with declared facts that its file does not contain.

    ``bits``: bits that carry the grey value: 12 for a 12-bit camera whose values lie in 16 bits.
    ``crop_offset``: position of the top left pixel on the sensor (x, y) [px]. ``times``: times of the frames
    [s], increasing; one per frame. ``n_frames``: correct number of frames, if the file was cut off; reading a
    missing frame raises PictureError. Raises ValueError if a value is outside its range; the message names
    it.
    """
    count = pictures.n_frames if n_frames is None else int(n_frames)
    if not pictures.n_frames <= count <= MOST_FRAMES:
        raise ValueError(
            f"{pictures.path}: n_frames = {count}, must be from the {pictures.n_frames} that the file has "
            f"to {MOST_FRAMES}"
        )
    used = pictures.bits if bits is None else int(bits)
    if not 1 <= used <= 16:
        raise ValueError(f"{pictures.path}: bits = {used}, must be from 1 to 16")
    offset = pictures.crop_offset if crop_offset is None else (float(crop_offset[0]), float(crop_offset[1]))
    if not np.all(np.isfinite(offset)):
        raise ValueError(f"{pictures.path}: crop_offset = {offset} px must be finite")
    clock = pictures.times if count == pictures.n_frames else None
    if times is not None:
        clock = np.array(times, dtype=np.float64)
        if clock.shape != (count,) or not np.all(np.isfinite(clock)) or np.any(np.diff(clock) <= 0.0):
            raise ValueError(
                f"{pictures.path}: times must be {count} finite and rising seconds, one a frame, "
                f"got {clock.size} from {clock.min(initial=np.inf)} to {clock.max(initial=-np.inf)}"
            )
    if is_dataclass(pictures) and not isinstance(pictures, type):
        pictures = replace(pictures, bits=used)  # the reader checks frames against this, not its header
    return DeclaredPictures(pictures, count, used, offset, clock)


def of_colours(series: Sequence[Pictures]) -> tuple[Remark, ...]:
    """Remarks on series with colour pictures, which were converted to grey values."""
    remarks = []
    for camera, pictures in enumerate(series):
        own = getattr(pictures, "pictures", pictures)
        if getattr(own, "coloured", False):
            text = f"the pictures of camera {camera} have colours; a grey value is {WEIGHTS} of them"
            cure = "export grey values as they were recorded: a colour sensor's neighbours are interpolated"
            remarks.append(Remark(name="colour pictures", text=text, cure=cure))
        elif getattr(own, "tripled", False):
            text = (
                f"the pictures of camera {camera} store each grey value as three equal colours; one was taken"
            )
            cure = "none is needed; export grey values to save space"
            remarks.append(Remark(name="grey in three colours", text=text, cure=cure))
    return tuple(remarks)


@dataclass(frozen=True)
class Format:
    """A picture file format."""

    name: str
    sniff: Callable[[Path, bytes], bool]
    """True if a file, given with its first `SNIFFED` bytes, is of this format."""
    read: Callable[[Path], Pictures]
    """Opens a file of this format."""


SNIFFED = 512
"""Number of bytes from the start of a file that `sniff` gets."""

FORMATS = (
    Format("TIFF", tiff.sniff, tiff.read),
    Format("HDF5", hdf5.sniff, hdf5.read),
    Format("Phantom cine", cine.sniff, cine.read),
    Format("Photron mraw", photron.sniff, photron.read),
)
"""Formats that hold a series in one file, in the order in which they are tried."""


def open_pictures(
    path: Path | str | Sequence[Path | str],
    *,
    pattern: str | None = None,
    bits: int | None = None,
    crop_offset: tuple[float, float] | None = None,
    times: Sequence[float] | None = None,
    n_frames: int | None = None,
) -> Pictures:
    """Open the pictures of one camera, in any of the formats.

    Parameters
    ----------
    path
        A file of any of the formats, a folder with a numbered series of TIFF, PNG, JPEG or BMP files, or a
        list of such files in the order of the frames.
    pattern
        In a folder: the names of the series with one `*` for the number, e.g. ``"cam0_*.png"``. In an HDF5
        file: the name of the dataset.
    bits, crop_offset, times, n_frames
        Values that are missing or wrong in the files; see `dic.images.declared`.

    Returns
    -------
    Pictures
        The series; only headers have been read.

    Raises
    ------
    PictureError
        If `path` does not exist, no format fits, or the headers are inconsistent.
    """
    try:
        pictures = _open_format(path, pattern)
    except OSError as error:
        raise PictureError(
            error.filename or str(path),
            f"cannot be read ({error.strerror})",
            cure="copy it again, and see that it may be read",
        ) from None
    if bits is None and crop_offset is None and times is None and n_frames is None:
        return pictures
    return declared(pictures, bits=bits, crop_offset=crop_offset, times=times, n_frames=n_frames)


def _open_format(path: Path | str | Sequence[Path | str], pattern: str | None) -> Pictures:
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
            f'is not a folder: pattern "{pattern}" has nothing to choose from',
            cure="leave pattern out, or name the folder",
        )
    for picture_format in FORMATS:
        if picture_format.sniff(path, start):
            return picture_format.read(path)
    if path.suffix.lower() in numbered.SUFFIXES:
        return numbered.read_files([path])
    names = ", ".join(picture_format.name for picture_format in FORMATS)
    raise PictureError(path, f"is not one of {names}, PNG, JPEG, BMP", cure="export it as TIFF")


__all__ = [
    "FrameHealth",
    "GreyNoise",
    "PictureError",
    "Pictures",
    "SpeckleQuality",
    "check_series",
    "declared",
    "frame_health",
    "grey_noise",
    "open_pictures",
    "speckle_quality",
]

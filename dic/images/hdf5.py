"""HDF5: one dataset [frames, rows, columns] of 8 or 16-bit whole numbers.

The dataset may have the attributes `bits` (a whole number) and `crop_offset` (two numbers, px). The same
group may contain a dataset `times` (seconds, one per frame). Data in other files (links, virtual datasets)
are not read.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dic.files import regular
from dic.images.series import (
    Grey,
    PictureError,
    checked_bits,
    checked_count,
    checked_frame,
    checked_index,
    checked_shape,
)

if TYPE_CHECKING:
    import h5py

LARGEST_BLOCK = 2**29
"""Largest block of a stored dataset of pictures [bytes]. A block is unpacked as a whole."""
_SIGNATURE = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Hdf5Pictures:
    """Frames of a dataset; see `dic.images.Pictures`."""

    path: Path
    n_frames: int
    shape: tuple[int, int]
    bits: int
    crop_offset: tuple[float, float]
    times: NDArray[np.float64] | None
    dataset: str

    def frame(self, index: int) -> Grey:
        """Grey values of one frame, shape [rows, columns].

        Raises PictureError if it cannot be read.
        """
        import h5py

        index = checked_index(self.n_frames, index)
        try:
            with h5py.File(regular(self.path), "r") as file:
                picture = np.asarray(file[self.dataset][index])
        except Exception as error:  # every exception of the library means a damaged file
            raise PictureError(self.path, f"cannot be read ({error})", frame=index) from error
        return checked_frame(self.path, index, picture, self.shape, self.bits)


def sniff(path: Path, start: bytes) -> bool:
    """True if a file with these first bytes is HDF5 (without a user block)."""
    return start.startswith(_SIGNATURE)


def read(path: Path, dataset: str | None = None) -> Hdf5Pictures:
    """Open an HDF5 file.

    ``dataset``: name of the dataset; without it the file must contain exactly one dataset of whole numbers
    with three dimensions. Raises PictureError if the file cannot be read, or has no such dataset or more than
    one.
    """
    import h5py

    try:
        with h5py.File(regular(path), "r") as file:
            datasets = _pictures_in(file)
            names = [dataset] if dataset is not None else sorted(datasets)
            if len(names) != 1 or names[0].strip("/") not in datasets:
                raise PictureError(
                    path,
                    f"{len(datasets)} datasets [frames, rows, columns] of 8 or 16-bit whole numbers: "
                    f"{', '.join(sorted(datasets)) or 'none'}",
                    cure='name one, pattern="group/name"',
                )
            return _opened(path, datasets[names[0].strip("/")])
    except PictureError:
        raise
    except Exception as error:  # see Hdf5Pictures.frame
        raise PictureError(path, f"cannot be read ({error})") from error


def _pictures_in(file: "h5py.File") -> dict[str, "h5py.Dataset"]:
    """Datasets that can be pictures, by name; links to other files are not visited."""
    import h5py

    datasets: dict[str, h5py.Dataset] = {}

    def visit(name: str, item: object) -> None:
        if not isinstance(item, h5py.Dataset) or item.ndim != 3 or item.dtype not in (np.uint8, np.uint16):
            return
        if not item.is_virtual and not item.external:
            datasets[name] = item

    file.visititems(visit)
    return datasets


def _opened(path: Path, dataset: "h5py.Dataset") -> Hdf5Pictures:
    import h5py

    n_frames, rows, columns = dataset.shape
    checked_count(path, n_frames)  # a check before its times are read
    block = int(np.prod(dataset.chunks or (1,), dtype=object)) * dataset.dtype.itemsize
    if block > LARGEST_BLOCK:
        raise PictureError(
            path,
            f"is stored in blocks of {block} bytes, allowed are at most {LARGEST_BLOCK}",
            cure="store it with a frame a block",
        )
    container = dataset.dtype.itemsize * 8
    offset = np.asarray(dataset.attrs.get("crop_offset", (0.0, 0.0)), dtype=np.float64)
    if offset.shape != (2,) or not np.all(np.isfinite(offset)):
        raise PictureError(
            path,
            f"attribute crop_offset must be two finite numbers, is {offset}",
            cure="write two numbers, in px",
        )
    clock = None
    if isinstance(dataset.parent.get("times", getlink=True), h5py.HardLink):
        times = dataset.parent["times"]
        if not isinstance(times, h5py.Dataset) or times.shape != (n_frames,) or times.external:
            raise PictureError(
                path,
                f"times must be a dataset of {n_frames} numbers, is {times}",
                cure="write a time a frame, or none",
            )
        clock = np.asarray(times, dtype=np.float64)
    return Hdf5Pictures(
        path=path,
        n_frames=n_frames,
        shape=checked_shape(path, rows, columns),
        bits=checked_bits(path, int(dataset.attrs.get("bits", container)), container),
        crop_offset=(float(offset[0]), float(offset[1])),
        times=clock,
        dataset=str(dataset.name),
    )

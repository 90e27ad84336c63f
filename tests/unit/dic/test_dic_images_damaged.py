"""Whatever a damaged or hostile file holds, it is a PictureError of one line and nothing else."""

import cv2
import h5py
import numpy as np
import pytest
import tifffile
from picture_files import cih, cihx, cine, packed, twelve_bit_tiff

from dic.images import PictureError, open_pictures

TRIALS = 60


def grey():
    return np.random.default_rng(1).integers(0, 1024, (3, 6, 16)).astype(np.uint16)


def tiff(folder):
    tifffile.imwrite(folder / "a.tif", grey(), photometric="minisblack", compression="zlib")


def hdf5(folder):
    with h5py.File(folder / "a.h5", "w") as file:
        data = file.create_dataset("a", data=grey(), chunks=(1, 6, 16), compression="gzip")
        data.attrs["bits"], file["times"] = 12, np.arange(3.0)


def recording(header, suffix):
    def write(folder):
        (folder / "a.mraw").write_bytes(packed(grey(), 12))
        (folder / f"a{suffix}").write_bytes(header)

    return write


WRITERS = {
    "a.tif": tiff,
    "b.tif": lambda folder: (folder / "b.tif").write_bytes(twelve_bit_tiff(grey())),
    "c.tif": lambda folder: cv2.imwritemulti(str(folder / "c.tif"), list(grey())),
    "a.h5": hdf5,
    "a.cine": lambda folder: (folder / "a.cine").write_bytes(cine(grey(), stamps=[(7, 0)] * 3)),
    "b.cine": lambda folder: (folder / "b.cine").write_bytes(cine(grey(), bits=10, packing=256)),
    "a.cih": recording(cih(**{"Color Bit": "12"}).encode(), ".cih"),
    "a.cihx": recording(cihx(), ".cihx"),
    "a1.png": lambda folder: cv2.imwrite(str(folder / "a1.png"), grey()[0]),
    "a1.jpg": lambda folder: cv2.imwrite(str(folder / "a1.jpg"), (grey()[0] >> 2).astype(np.uint8)),
    "a1.bmp": lambda folder: cv2.imwrite(str(folder / "a1.bmp"), (grey()[0] >> 2).astype(np.uint8)),
}


def read(path):
    """Frames read, and texts of the errors; any other exception is the failure of the test."""
    frames, errors = 0, []
    try:
        pictures = open_pictures(path)
    except PictureError as error:
        return frames, [str(error)]
    for index in range(min(pictures.n_frames, 5)):
        try:
            pictures.frame(index)
            frames += 1
        except PictureError as error:
            errors.append(str(error))
    return frames, errors


@pytest.mark.parametrize("name", sorted(WRITERS))
def test_damage_anywhere(tmp_path, name):
    WRITERS[name](tmp_path)
    path = tmp_path / name
    whole = path.read_bytes()
    frames, errors = read(path)
    assert frames >= 1
    assert not errors
    rng = np.random.default_rng(2)
    said = []
    for cut in np.linspace(0, len(whole) - 1, TRIALS).astype(int):
        path.write_bytes(whole[:cut])
        said += read(path)[1]
    assert said
    for _ in range(TRIALS):
        bytes_ = bytearray(whole)
        for place in rng.integers(0, min(len(whole), 700), 3):  # headers lie within the first bytes
            bytes_[place] = rng.choice([0, 1, 127, 255, int(rng.integers(256))])
        path.write_bytes(bytes(bytes_))
        said += read(path)[1]
    assert all("\n" not in text and str(tmp_path) in text for text in said)

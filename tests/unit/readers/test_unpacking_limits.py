"""Limits of unpacked data and of searches in readers: each is tested just inside and just outside."""

import struct
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from dic.camera_files import CameraFileError, read_rig
from dic.images import PictureError, open_pictures, tiff
from kolsky.base import hdf5
from kolsky.base.errors import InputError
from kolsky.base.hdf5 import Format, reading, take
from kolsky.base.toml import DEEPEST, LONGEST_LINE, parse_toml
from kolsky.readers import contents, excel, sheet
from kolsky.readers.child import mat
from kolsky.readers.contents import LARGEST_SAMPLE
from kolsky.readers.layout import Layout
from kolsky.readers.meshes import read_mesh
from kolsky.readers.recordings import list_channels, read_recordings


def test_variables_share_one_limit(tmp_path: Path) -> None:
    """Two variables of 800 bytes fit into 1600 bytes, not into 1500, packed or not."""
    for packed in (False, True):
        path = str(tmp_path / "a.mat")
        savemat(path, {"a": np.ones(100), "b": np.ones(100)}, do_compression=packed)
        assert mat(path, str(tmp_path / "a.npz"), 1600) == [("a", "number"), ("b", "number")]
        with pytest.raises(ValueError, match="more than"):
            mat(path, str(tmp_path / "a.npz"), 1500)


def test_a_file_that_ends_its_reader_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A library that dies in the child ends no process but that."""
    savemat(tmp_path / "a.mat", {"a": np.ones(100)})
    (tmp_path / "child.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr(contents, "__file__", str(tmp_path / "contents.py"))
    with pytest.raises(InputError, match=r"its reader ended with code -11"):
        list_channels(tmp_path / "a.mat")


def _tiff(path: Path, strip: bytes) -> Path:
    tags = [
        (256, 16), (257, 6), (258, 8), (259, 8), (262, 1), (273, 8), (277, 1), (278, 6), (279, len(strip)),
    ]  # fmt: skip
    padded = strip + bytes(len(strip) % 2)
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
    head = b"II*\0" + struct.pack("<I", 8 + len(padded))
    path.write_bytes(head + padded + struct.pack("<H", len(tags)) + entries + bytes(4))
    return path


def test_a_strip_may_not_unpack_to_more_than_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page of 96 pixels needs at most 192 bytes; twice that and the slack may be there."""
    monkeypatch.setattr(tiff, "_SLACK", 0)
    monkeypatch.setattr(tiff, "_HARMLESS", 0)
    for size, fits in ((96, True), (384, True), (385, False)):
        pictures = open_pictures(_tiff(tmp_path / "a.tif", zlib.compress(bytes(size))))
        if fits:
            assert pictures.frame(0).shape == (6, 16)
        else:
            with pytest.raises(PictureError, match="unpack to more than the 192 bytes"):
                pictures.frame(0)


def test_colours_become_grey_by_a_rule_that_is_said(tmp_path: Path) -> None:
    """Red 12, green 17, blue 10 are 0.299 * 12 + 0.587 * 17 + 0.114 * 10 = 14.7."""
    import cv2

    from dic.images import declared, of_colours

    grey = np.random.default_rng(1).integers(0, 255, (8, 9)).astype(np.uint8)
    colours = np.repeat(grey[..., None], 3, axis=2)
    cv2.imwrite(str(tmp_path / "a1.png"), colours)
    same = open_pictures(tmp_path / "a1.png")
    assert (same.frame(0) == grey).all()
    assert [remark.name for remark in of_colours([same])] == ["grey in three colours"]
    colours[3, 4] = (10, 17, 12)  # OpenCV's order: blue first
    cv2.imwrite(str(tmp_path / "a1.png"), colours)
    mixed = open_pictures(tmp_path / "a1.png")
    assert float(mixed.frame(0)[3, 4]) == pytest.approx(14.707, abs=1.0)  # the decoder cuts or rounds
    _, remark = of_colours([same, declared(mixed, bits=8)])
    assert "camera 1 have colours; a grey value is 0.299 R + 0.587 G + 0.114 B" in remark.text


def test_a_result_may_not_unpack_to_more_than_so_many_times_its_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hdf5, "FREELY_UNPACKED", 0)
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "made up", 1
        group = file.create_group("entry")
        for name in "ab":
            group.create_dataset(name, data=np.zeros(100_000), compression="gzip", chunks=(1000,))

    def both() -> None:
        with reading(path, Format("made up"), cure="make it again") as place:
            for name in "ab":
                take(place.at(name), None, "n", "f")

    size = path.stat().st_size
    monkeypatch.setattr(hdf5, "MOST_PACKING", 1_600_000 // size + 1)
    both()
    monkeypatch.setattr(hdf5, "MOST_PACKING", 1_600_000 // size)
    with pytest.raises(InputError, match="/entry/b: the file unpacks to more than"):
        both()


def _table(path: Path, value: str, above: str = "") -> Path:
    rows = "\n".join(f"{k}e-6,{0.001 * (k % 7)}" for k in range(1, 40))
    path.write_text(f"{above}Time (s),CH1 (V)\n{rows}\n40e-6,{value}\n")
    return path


def test_no_sample_is_larger_than_anything_measured(tmp_path: Path) -> None:
    assert read_recordings(_table(tmp_path / "a.csv", "1e30"), ["CH1 (V)"])["CH1 (V)"].value[-1] == 1e30
    with pytest.raises(InputError, match=r"line 41: column 'CH1 .V.' is larger than 1e.30: '1.01e30'"):
        read_recordings(_table(tmp_path / "a.csv", "1.01e30"), ["CH1 (V)"])


def test_a_clock_is_finite(tmp_path: Path) -> None:
    for start in (np.inf, np.nan, 10.0 * LARGEST_SAMPLE):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file["CH1"] = np.sin(np.arange(50.0))
            file["CH1"].attrs.update({"units": "V", "dt": 1e-6, "t0": start})
        with pytest.raises(InputError, match=r"an interval > 0 s. Cure: state start and interval"):
            read_recordings(tmp_path / "a.h5", ["/CH1"])
        assert list_channels(tmp_path / "a.h5")[0].start is None


def test_a_header_has_so_many_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sheet, "LONGEST_HEADER", 6)
    keys = "".join(f"key {k}: x\n" for k in range(5))
    list_channels(_table(tmp_path / "a.csv", "0.5", keys))
    with pytest.raises(InputError, match=r"line 8: has 7 lines above its samples, more than the 6"):
        list_channels(_table(tmp_path / "a.csv", "0.5", keys + "one more: x\n"))


def test_a_sheet_has_so_many_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    for row in [["Time/s", "CH1/V"], *([1e-6 * k, 0.01 * (k % 5)] for k in range(30))]:
        book.active.append(row)  # type: ignore[union-attr]
    book.save(tmp_path / "a.xlsx")
    monkeypatch.setattr(excel, "ROWS_LIMIT", 31)
    assert list_channels(tmp_path / "a.xlsx", layout=Layout())[0].samples == 30
    monkeypatch.setattr(excel, "ROWS_LIMIT", 30)
    with pytest.raises(InputError, match="more than 30 rows"):
        list_channels(tmp_path / "a.xlsx")


def test_settings_are_neither_deep_nor_long(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("x = " + "[" * (DEEPEST - 1) + "]" * (DEEPEST - 1) + "\n")
    assert parse_toml(path).content["x"] is not None
    path.write_text("x = " + "[" * DEEPEST + "1" + "]" * DEEPEST + "\n")
    with pytest.raises(InputError, match="inside each other"):
        parse_toml(path)
    path.write_text("a = 1\n[" + "a." * LONGEST_LINE + "b]\n")
    with pytest.raises(InputError, match="line 2: has a line of more than"):
        parse_toml(path)


MESH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
3
1 0 0 0
2 1 0 0
3 0 1 0
$EndNodes
$Elements
1
1 2 2 0 1 1 2 3
$EndElements
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("3\n1 0", "4\n1 0"), ("1 2 2 0 1 1 2 3", "1 2 2 0 1 1 2 4"), ("1 2 2 0 1 1 2 3", "1 2 2 0 1 1 2"),
        ("1 2 2 0 1 1 2 3", "1 2"), ("3 0 1 0", "2 0 1 0"), ("3 0 1 0", "3 0 1"), ("3 0 1 0", "3 0 inf 0"),
        ("2.2 0 8\n", ""),
    ],
)  # fmt: skip
def test_a_mesh_is_whole(old: str, new: str, tmp_path: Path) -> None:
    path = tmp_path / "a.msh"
    path.write_text(MESH)
    assert read_mesh(path, dimension=2).cells.tolist() == [[0, 1, 2]]
    path.write_text(MESH.replace(old, new))
    with pytest.raises(InputError, match="Cure: "):
        read_mesh(path, dimension=2)


def test_a_camera_file_of_long_lines_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "a.caldat"
    path.write_text("Cam0_Fx [pixels];1\nCam1_Fx [pixels];1\n" + " " * 300_000 + "\n" + "Tx " * 100_000)
    with pytest.raises(CameraFileError, match="has no Cam0_Fy"):
        read_rig(path)

"""TIFF, numbered series, HDF5 and declared facts: written files are read, damaged ones are named."""

import struct
import zlib

import cv2
import h5py
import numpy as np
import pytest
import tifffile
from memory_pictures import Memory
from picture_files import cih, cihx, cine, packed, twelve_bit_tiff
from scipy.ndimage import gaussian_filter, shift

from dic import FrameOutcome
from dic.images import PictureError, Pictures, declared, frame_health, open_pictures

SHAPE = (6, 7)  # an odd number of columns: a row of 12-bit values does not end with a byte


@pytest.fixture
def pages():
    return np.random.default_rng(5).integers(0, 4096, (4, *SHAPE)).astype(np.uint16)


def read_all(pictures):
    """All frames; None where one raises a PictureError."""
    assert isinstance(pictures, Pictures)
    found, errors = [], {}
    for index in range(pictures.n_frames):
        try:
            found.append(pictures.frame(index))
        except PictureError as error:
            found.append(None)
            errors[index] = error
    assert all(error.frame == index and "\n" not in str(error) for index, error in errors.items())
    return found


def written(folder, data, name="file.tif"):
    path = folder / name
    path.write_bytes(data)
    return path


# --- TIFF ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{}, {"bigtiff": True}, {"byteorder": ">"}, {"compression": "zlib"}])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_tiff_written_by_tifffile(tmp_path, pages, options, dtype):
    tifffile.imwrite(tmp_path / "a.tif", pages.astype(dtype), photometric="minisblack", **options)
    pictures = open_pictures(tmp_path / "a.tif")
    assert (pictures.n_frames, pictures.shape, pictures.bits) == (4, SHAPE, 8 * np.dtype(dtype).itemsize)
    assert pictures.crop_offset == (0.0, 0.0)
    assert pictures.times is None
    np.testing.assert_array_equal(read_all(pictures), pages.astype(dtype))


def test_tiff_written_by_opencv_with_its_lzw_compression(tmp_path, pages):
    assert cv2.imwritemulti(str(tmp_path / "a.tif"), list(pages))
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        assert file.pages[0].compression == 5  # LZW, which tifffile does not decode by itself
    np.testing.assert_array_equal(read_all(open_pictures(tmp_path / "a.tif")), pages)


@pytest.mark.parametrize("order", ["<", ">"])
def test_tiff_of_12_bits_without_gaps(tmp_path, pages, order):
    pictures = open_pictures(written(tmp_path, twelve_bit_tiff(pages, order=order)))
    assert pictures.bits == 12
    np.testing.assert_array_equal(read_all(pictures), pages)


def test_white_is_zero_is_turned_round(tmp_path, pages):
    pictures = open_pictures(written(tmp_path, twelve_bit_tiff(pages, white=True)))
    np.testing.assert_array_equal(read_all(pictures), 4095 - pages)


def test_bits_are_what_the_header_says_and_never_guessed(tmp_path, pages):
    tag = [(281, "H", 1, 4095, True)]
    tifffile.imwrite(tmp_path / "said.tif", pages, photometric="minisblack", extratags=tag)
    assert open_pictures(tmp_path / "said.tif").bits == 12
    tifffile.imwrite(tmp_path / "silent.tif", pages, photometric="minisblack")
    assert open_pictures(tmp_path / "silent.tif").bits == 16  # though no value is above 4095
    assert open_pictures(tmp_path / "silent.tif", bits=12).bits == 12


@pytest.mark.parametrize("shaped", [True, False])
def test_a_tiff_cut_off_keeps_the_frames_before_the_cut(tmp_path, pages, shaped):
    with tifffile.TiffWriter(tmp_path / "a.tif") as writer:
        for page in pages:
            note = '{"shape": [4, 6, 7]}' if shaped else None
            writer.write(page, photometric="minisblack", contiguous=False, metadata=None, description=note)
    whole = (tmp_path / "a.tif").read_bytes()
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        cut = file.pages[2].dataoffsets[0] + 5
    pictures = open_pictures(written(tmp_path, whole[:cut], "cut.tif"))
    # the header of page 3 is promised by page 2; that there are 4 in all only the description says
    assert pictures.n_frames == 4
    found = read_all(pictures)
    np.testing.assert_array_equal(found[:2], pages[:2])
    assert found[2:] == [None, None]
    more = open_pictures(tmp_path / "cut.tif", n_frames=9, times=np.arange(9) / 1e5)
    assert sum(frame is None for frame in read_all(more)) == 7


@pytest.mark.parametrize("cut", [0, 3])
def test_an_imagej_stack_with_one_header_for_all_pages(tmp_path, pages, cut):
    # as ImageJ writes more than 4 GB: one header, big-endian, then page after page
    tifffile.imwrite(
        tmp_path / "a.tif", pages[0], byteorder=">", description="ImageJ=1.53\nimages=4\n", metadata=None
    )
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        start = file.pages[0].dataoffsets[0]
    data = (tmp_path / "a.tif").read_bytes()[:start] + pages.astype(">u2").tobytes()
    pictures = open_pictures(written(tmp_path, data[: len(data) - cut]))
    assert pictures.n_frames == 4
    found = read_all(pictures)
    np.testing.assert_array_equal(found[:3], pages[:3])
    assert (found[3] is None) == bool(cut)


@pytest.mark.parametrize("imagej", [True, False])
def test_a_stack_cut_off_before_its_other_headers_keeps_the_frames_before_the_cut(tmp_path, pages, imagej):
    tifffile.imwrite(tmp_path / "a.tif", pages, photometric="minisblack", imagej=imagej)
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        cut = file.pages[3].dataoffsets[0] + 5
        assert file.pages[1].offset > cut  # the header of the second page comes after all grey values
    pictures = open_pictures(written(tmp_path, (tmp_path / "a.tif").read_bytes()[:cut], "cut.tif"))
    assert pictures.n_frames == 4
    found = read_all(pictures)
    np.testing.assert_array_equal(found[:3], pages[:3])
    assert found[3] is None


def test_pages_that_lie_apart_are_not_taken_for_a_stack(tmp_path, pages):
    with tifffile.TiffWriter(tmp_path / "a.tif") as writer:
        for page in pages:
            note = '{"shape": [4, 6, 7]}'
            writer.write(page, photometric="minisblack", contiguous=False, metadata=None, description=note)
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        cut = file.pages[1].offset + 1  # as many bytes as the second page's would follow
    data = (tmp_path / "a.tif").read_bytes()[:cut]
    found = read_all(open_pictures(written(tmp_path, data, "cut.tif")))
    np.testing.assert_array_equal(found[0], pages[0])
    assert found[1:] == [None, None, None]


def tiff_with(**tags):
    """A small 12-bit TIFF in which some tags lie."""
    names = {"columns": 256, "rows": 257, "strip": 273, "count": 279, "samples": 277}
    raw = bytearray(twelve_bit_tiff([np.zeros(SHAPE, dtype=np.uint16)]))
    (header,) = struct.unpack_from("<I", raw, 4)
    (entries,) = struct.unpack_from("<H", raw, header)
    for k in range(entries):
        at = header + 2 + 12 * k
        (tag,) = struct.unpack_from("<H", raw, at)
        for name, value in tags.items():
            if names[name] == tag:
                struct.pack_into("<I", raw, at + 8, value)
    return bytes(raw)


@pytest.mark.parametrize(
    "tags", [{"columns": 0}, {"rows": 0}, {"rows": 4_000_000_000, "columns": 4_000_000_000}]
)
def test_a_tiff_whose_size_lies_is_refused(tmp_path, tags):
    with pytest.raises(PictureError, match="rows and"):
        open_pictures(written(tmp_path, tiff_with(**tags)))


@pytest.mark.parametrize(
    "tags", [{"strip": 4_000_000_000}, {"count": 4_000_000_000}, {"count": 0}, {"count": 5}, {"samples": 3}]
)
def test_a_page_whose_data_lie_is_an_error_of_its_own(tmp_path, tags):
    pictures = open_pictures(written(tmp_path, tiff_with(**tags)))
    with pytest.raises(PictureError, match="frame 0"):
        pictures.frame(0)


def test_pages_in_a_circle_are_refused(tmp_path, pages):
    raw = bytearray(twelve_bit_tiff(pages[:2]))
    first = raw[4:8]
    raw[-4:] = first
    with pytest.raises(PictureError, match="page 2 starts at"):
        open_pictures(written(tmp_path, bytes(raw)))


def test_a_tiff_of_floats_or_colours_is_refused(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", np.zeros(SHAPE, dtype=np.float32))
    with pytest.raises(PictureError, match=r"floating-point numbers.*scales them together"):
        open_pictures(tmp_path / "a.tif")
    tifffile.imwrite(tmp_path / "b.tif", np.zeros((*SHAPE, 3), dtype=np.uint8), photometric="rgb")
    with pytest.raises(PictureError, match="colour"):
        open_pictures(tmp_path / "b.tif").frame(0)


def test_a_page_of_another_shape_spoils_no_other(tmp_path, pages):
    with tifffile.TiffWriter(tmp_path / "a.tif") as writer:
        for page in (pages[0], pages[1][:, :5], pages[2]):
            writer.write(page, photometric="minisblack", metadata=None)
    found = read_all(open_pictures(tmp_path / "a.tif"))
    assert found[1] is None
    np.testing.assert_array_equal([found[0], found[2]], pages[[0, 2]])


# --- numbered series ----------------------------------------------------------------------------------


def series(folder, numbers, pattern="cam_{}.png", shape=SHAPE, dtype=np.uint16):
    rng = np.random.default_rng(7)
    pictures = {n: rng.integers(0, 200, shape).astype(dtype) for n in numbers}
    for number, picture in pictures.items():
        cv2.imwrite(str(folder / pattern.format(number)), picture)
    return pictures


def test_a_series_is_in_the_order_of_its_numbers(tmp_path):
    wrote = series(tmp_path, [8, 9, 10, 11])
    pictures = open_pictures(tmp_path)
    assert pictures.bits == 16
    np.testing.assert_array_equal(read_all(pictures), list(wrote.values()))


def test_missing_numbers_are_missing_frames(tmp_path):
    wrote = series(tmp_path, [1, 2, 5])
    pictures = open_pictures(tmp_path)
    found = read_all(pictures)
    assert [frame is None for frame in found] == [False, False, True, True, False]
    np.testing.assert_array_equal(found[4], wrote[5])
    with pytest.raises(PictureError, match="number 3"):
        pictures.frame(2)


def test_numbers_may_count_in_steps(tmp_path):
    series(tmp_path, [100, 110, 130])
    pictures = open_pictures(tmp_path)
    assert pictures.numbers == (100, 110, 120, 130)
    assert [frame is None for frame in read_all(pictures)] == [False, False, True, False]


def test_two_series_in_a_folder_need_a_pattern(tmp_path):
    left, _ = series(tmp_path, [1, 2], "p{}_0.bmp", dtype=np.uint8), series(tmp_path, [1, 2], "p{}_1.bmp")
    series(tmp_path, [1], "other{}.bmp")
    with pytest.raises(PictureError, match=r"2 series.*p1_\*\.bmp|series: "):
        open_pictures(tmp_path)
    pictures = open_pictures(tmp_path, pattern="p*_0.bmp")
    np.testing.assert_array_equal(read_all(pictures), list(left.values()))
    with pytest.raises(PictureError, match="no file fits"):
        open_pictures(tmp_path, pattern="q*.bmp")
    with pytest.raises(PictureError, match="one \\*"):
        open_pictures(tmp_path, pattern="p*_*.bmp")


def test_a_series_of_tiffs(tmp_path, pages):
    for k, page in enumerate(pages):
        (tmp_path / f"cam_{k:04d}_0.tif").write_bytes(twelve_bit_tiff([page]))
    pictures = open_pictures(tmp_path, pattern="cam_*_0.tif")
    assert pictures.bits == 12
    np.testing.assert_array_equal(read_all(pictures), pages)
    (tmp_path / "cam_0002_0.tif").write_bytes(twelve_bit_tiff(pages))
    with pytest.raises(PictureError, match="has 4 pages; open the file itself"):
        open_pictures(tmp_path, pattern="cam_*_0.tif").frame(2)


def test_time_stamps_for_numbers_are_refused(tmp_path):
    series(tmp_path, [1700000000, 1700000001, 1700009999])
    with pytest.raises(PictureError, match="not frame numbers"):
        open_pictures(tmp_path)


def test_one_number_twice_is_refused(tmp_path):
    series(tmp_path, ["1", "01"])
    with pytest.raises(PictureError, match="one number, 1"):
        open_pictures(tmp_path)


def test_a_list_of_files_is_taken_as_it_is(tmp_path):
    wrote = series(tmp_path, ["b", "a"], "{}.png")
    pictures = open_pictures([tmp_path / "b.png", tmp_path / "gone.png", tmp_path / "a.png"])
    found = read_all(pictures)
    assert found[1] is None
    np.testing.assert_array_equal([found[0], found[2]], list(wrote.values()))
    assert read_all(open_pictures(tmp_path / "a.png"))[0].shape == SHAPE


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp"])
def test_a_file_cut_off_is_not_filled_up_with_grey(tmp_path, suffix):
    series(tmp_path, [1, 2], "a{}" + suffix, shape=(64, 64), dtype=np.uint8)
    path = tmp_path / f"a2{suffix}"
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(PictureError, match="cut off"):
        open_pictures(tmp_path).frame(1)
    assert open_pictures(tmp_path).frame(0).shape == (64, 64)


def test_a_damaged_png_is_named(tmp_path):
    series(tmp_path, [1, 2], shape=(64, 64))
    raw = bytearray((tmp_path / "cam_2.png").read_bytes())
    raw[len(raw) // 2] ^= 0xFF
    written(tmp_path, bytes(raw), "cam_2.png")
    with pytest.raises(PictureError, match="check sum"):
        open_pictures(tmp_path).frame(1)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp"])
def test_a_header_that_promises_a_giant_is_refused_before_it_is_decoded(tmp_path, suffix):
    series(tmp_path, [1], "a{}" + suffix, shape=(64, 64), dtype=np.uint8)
    raw = bytearray((tmp_path / f"a1{suffix}").read_bytes())
    if suffix == ".png":
        struct.pack_into(">II", raw, 16, 60_000, 15_000)
        struct.pack_into(">I", raw, 29, zlib.crc32(raw[12:29]))
    elif suffix == ".jpg":
        struct.pack_into(">HH", raw, raw.index(b"\xff\xc0") + 5, 15_000, 60_000)
    else:
        struct.pack_into("<ii", raw, 18, 60_000, 15_000)
        raw[30] = 1  # run lengths: how many bytes they need cannot be seen
    with pytest.raises(PictureError, match="15000 rows and 60000 columns"):
        open_pictures(written(tmp_path, bytes(raw), f"a1{suffix}"))


def test_exif_turns_a_jpeg(tmp_path):
    picture = np.tile(np.arange(0, 240, 10, dtype=np.uint8), (16, 1))
    _, jpeg = cv2.imencode(".jpg", picture)
    tiff = b"II*\0\x08\0\0\0" + struct.pack("<HHHIHHI", 1, 0x0112, 3, 1, 6, 0, 0)  # orientation 6
    exif = b"Exif\0\0" + tiff
    data = jpeg.tobytes()
    data = data[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + data[2:]
    turned = open_pictures(written(tmp_path, data, "a1.jpg")).frame(0)
    assert turned.shape == (24, 16)
    np.testing.assert_allclose(turned, np.rot90(picture, -1), atol=4)  # JPEG of quality 95


# --- HDF5 ---------------------------------------------------------------------------------------------


def test_hdf5_with_its_attributes(tmp_path, pages):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("cam0/pictures", data=pages, chunks=(1, *SHAPE), compression="gzip")
        data.attrs["bits"], data.attrs["crop_offset"] = 12, (192, 64)
        file["cam0/times"] = np.arange(4) / 1e5
        file["other"] = np.zeros((2, 3, 4))
    pictures = open_pictures(tmp_path / "a.h5")
    assert (pictures.bits, pictures.crop_offset) == (12, (192.0, 64.0))
    np.testing.assert_array_equal(pictures.times, np.arange(4) / 1e5)
    np.testing.assert_array_equal(read_all(pictures), pages)


def test_hdf5_with_two_series_needs_a_name(tmp_path, pages):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["a"], file["b"] = pages, pages[::-1]
    with pytest.raises(PictureError, match=r"2 datasets.*a, b"):
        open_pictures(tmp_path / "a.h5")
    np.testing.assert_array_equal(read_all(open_pictures(tmp_path / "a.h5", pattern="/b")), pages[::-1])
    with pytest.raises(PictureError, match="2 datasets"):
        open_pictures(tmp_path / "a.h5", pattern="c")


def test_hdf5_that_points_to_other_files_is_not_followed(tmp_path, pages):
    (tmp_path / "secret.raw").write_bytes(pages.tobytes())
    with h5py.File(tmp_path / "a.h5", "w") as file:
        outside = [("secret.raw", 0, pages.nbytes)]
        file.create_dataset("external", pages.shape, pages.dtype, external=outside)
        file["link"] = h5py.ExternalLink("other.h5", "/pictures")
    with pytest.raises(PictureError, match="0 datasets"):
        open_pictures(tmp_path / "a.h5")


def test_hdf5_cut_off_is_named(tmp_path, pages):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["a"] = pages
    whole = (tmp_path / "a.h5").read_bytes()
    with pytest.raises(PictureError, match="cannot be read"):
        open_pictures(written(tmp_path, whole[: len(whole) // 2], "b.h5"))


# --- the registry and what is declared ----------------------------------------------------------------


def test_what_is_no_picture_is_named(tmp_path):
    with pytest.raises(PictureError, match="is not one of TIFF, HDF5"):
        open_pictures(written(tmp_path, b"hello", "a.xyz"))
    with pytest.raises(PictureError, match="No such file"):
        open_pictures(tmp_path / "gone.tif")
    with pytest.raises(PictureError, match="no numbered pictures"):
        open_pictures(tmp_path)
    with pytest.raises(PictureError, match="cut off before its first page"):
        open_pictures(written(tmp_path, b"II*\0\xff\xff\0\0", "a.tif"))


def test_a_file_is_known_by_what_it_holds(tmp_path, pages):
    tifffile.imwrite(tmp_path / "a.tif", pages, photometric="minisblack")
    (tmp_path / "a.tif").rename(tmp_path / "a.png")
    np.testing.assert_array_equal(read_all(open_pictures(tmp_path / "a.png")), pages)


def test_declared_facts_replace_those_of_the_file(tmp_path, pages):
    tifffile.imwrite(tmp_path / "a.tif", pages, photometric="minisblack")
    times = [0.0, 1e-5, 2e-5, 4e-5]
    pictures = open_pictures(tmp_path / "a.tif", bits=12, crop_offset=(192, 190.5), times=times)
    assert (pictures.bits, pictures.crop_offset, pictures.shape) == (12, (192.0, 190.5), SHAPE)
    np.testing.assert_array_equal(pictures.times, times)
    np.testing.assert_array_equal(read_all(pictures), pages)


def test_a_grey_value_above_the_declared_bits_is_an_error_of_its_frame(tmp_path, pages):
    high = np.minimum(pages, 1023)
    high[2, 3, 3] = 1024
    tifffile.imwrite(tmp_path / "a.tif", high, photometric="minisblack")
    pictures = open_pictures(tmp_path / "a.tif", bits=10)
    assert [frame is None for frame in read_all(pictures)] == [False, False, True, False]
    with pytest.raises(PictureError, match="declare bits=11 or more"):
        pictures.frame(2)


def test_a_header_that_states_too_few_bits_is_seen_and_can_be_corrected(tmp_path, pages):
    pages[2, 3, 3] = 4095
    with h5py.File(tmp_path / "a.h5", "w") as file:
        largest = np.array([1023, 1023, 4095, 1023])
        file["a"] = np.minimum(pages, largest[:, None, None]).astype(np.uint16)
        file["a"].attrs["bits"] = 10
    pictures = open_pictures(tmp_path / "a.h5")
    assert [frame is None for frame in read_all(pictures)] == [False, False, True, False]
    assert frame_health(pictures).outcome[2] == FrameOutcome.UNREADABLE
    right = open_pictures(tmp_path / "a.h5", bits=12)
    assert all(frame is not None for frame in read_all(right))


@pytest.mark.parametrize(
    ("facts", "message"),
    [
        ({"bits": 0}, "bits = 0, must be from 1 to 16"),
        ({"bits": 17}, "bits = 17"),
        ({"crop_offset": (float("nan"), 0)}, "finite"),
        ({"times": [0.0, 1.0]}, "4 finite and rising"),
        ({"times": [0.0, 1.0, 1.0, 2.0]}, "rising"),
        ({"n_frames": 3}, "n_frames = 3, must be from the 4"),
    ],
)
def test_what_cannot_be_declared(tmp_path, pages, facts, message):
    tifffile.imwrite(tmp_path / "a.tif", pages, photometric="minisblack")
    with pytest.raises(ValueError, match=message):
        declared(open_pictures(tmp_path / "a.tif"), **facts)


@pytest.mark.parametrize("index", [-1, 4])
def test_frame_numbers_start_at_zero_and_end(tmp_path, pages, index):
    tifffile.imwrite(tmp_path / "a.tif", pages, photometric="minisblack")
    with pytest.raises(IndexError, match="from 0 to 3"):
        open_pictures(tmp_path / "a.tif").frame(index)


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


SIDE, FRAMES = 96, 24
NOISE = 8.0


def scene(*, bits=12, flicker=0.05, gain=1.0, at_bits=None):
    """A speckled specimen on a dark ground that moves and is pressed flat, under a flickering lamp."""
    rng = np.random.default_rng(11)
    speckles = gaussian_filter(rng.normal(size=(SIDE, SIDE)), 1.5)
    speckles = 0.35 + 0.12 * speckles / speckles.std()
    ground = np.zeros((SIDE, SIDE))
    frames = []
    for k in range(FRAMES):
        height = int(70 - 1.6 * k)
        light = gain * (1.0 + flicker * rng.normal())
        picture = ground + 0.03
        picture[10 : 10 + height, 12:84] = shift(speckles, (0, 0.5 * k), order=1, mode="wrap")[:height, :72]
        grey = light * picture * (2**bits - 1) + NOISE * 2 ** (bits - 12) * rng.normal(size=picture.shape)
        frames.append(np.clip(np.rint(grey), 0, 2**bits - 1).astype(np.uint8 if bits == 8 else np.uint16))
    return Memory(frames, at_bits or bits)


def dark(bits=12):
    """What a camera sees without light: its offset, noise, a few hot pixels."""
    grey = 20 + NOISE * np.random.default_rng(3).normal(size=(SIDE, SIDE))
    grey[::30, ::30] = 2**bits - 1
    return np.clip(np.rint(grey), 0, 2**bits - 1).astype(np.uint16)


@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize("flicker", [0.0, 0.05])
def test_good_frames_are_left_alone(bits, flicker):
    health = frame_health(scene(bits=bits, flicker=flicker))
    assert np.all(health.outcome == FrameOutcome.VALID)
    assert not health.flashed.any()
    assert not health.notes
    assert health.ceiling == 2**bits - 1


def test_each_bad_frame_has_its_outcome_and_the_others_stand():
    series = scene()
    series.frames[3] = None
    series.frames[7] = dark()
    series.frames[8] = np.zeros((SIDE, SIDE), dtype=np.uint16)
    series.frames[15] = np.full((SIDE, SIDE), 4095, dtype=np.uint16)
    bright = scene(gain=1.0).frames[20].astype(int) * 12
    series.frames[20] = np.minimum(bright, 4095).astype(np.uint16)  # overexposed: the specimen burnt out
    health = frame_health(series, mask=specimen())
    expected = np.full(FRAMES, int(FrameOutcome.VALID))
    expected[3] = FrameOutcome.UNREADABLE
    expected[[7, 8]] = FrameOutcome.BLACK
    expected[[15, 20]] = FrameOutcome.SATURATED
    np.testing.assert_array_equal(health.outcome, expected)
    assert sorted(health.notes) == [3, 7, 8, 15, 20]
    assert "is not there" in health.notes[3]
    assert health.notes[7].startswith("memory, frame 7: black: mean")
    assert np.isnan(health.mean[3])
    assert health.saturated[15] == 1.0


def specimen():
    mask = np.zeros((SIDE, SIDE), dtype=bool)
    mask[10:50, 12:84] = True
    return mask


def test_a_dim_frame_is_not_black_and_a_dim_series_neither():
    series = scene()
    series.frames[9] = (series.frames[9] * 0.3).astype(np.uint16)
    assert np.all(frame_health(series).outcome == FrameOutcome.VALID)
    assert np.all(frame_health(scene(gain=0.1)).outcome == FrameOutcome.VALID)


def test_a_series_without_light_is_black_throughout():
    series = Memory([dark() for _ in range(4)], 12)
    assert np.all(frame_health(series).outcome == FrameOutcome.BLACK)


def test_a_smooth_glow_is_black_once_the_noise_is_known():
    series = scene()
    glow = np.tile(np.linspace(10.0, 24.0, SIDE), (SIDE, 1))  # no noise at all: neighbours correlate
    series.frames[5] = np.rint(glow).astype(np.uint16)
    assert frame_health(series, noise=NOISE).outcome[5] == FrameOutcome.BLACK


@pytest.mark.parametrize("gain", [0.5, 1.0, 1.3])
def test_a_flash_is_seen_and_its_frame_stands(gain):
    series = scene(gain=gain)
    for k in (6, 7):  # a highlight of 3 % of the picture, whatever the exposure
        series.frames[k][20:36, 30:48] = 4095
    health = frame_health(series)
    assert np.flatnonzero(health.flashed).tolist() == [6, 7]
    assert np.all(health.outcome == FrameOutcome.VALID)
    assert "flash" in health.notes[6]
    share = 16 * 18 / SIDE**2
    np.testing.assert_allclose(health.flash[[6, 7]], share, rtol=0.05)  # a few bright speckles beside it


def test_where_saturation_is_the_rule_flicker_is_no_flash():
    health = frame_health(scene(gain=2.4))
    assert np.all(health.saturated > 0.05)
    assert not health.flashed.any()
    assert np.all(np.isnan(health.flash))


def test_where_pixels_pile_up_is_found_though_the_file_says_16_bits():
    health = frame_health(scene(gain=3.0, at_bits=16))
    assert health.ceiling == 4095
    assert frame_health(scene(gain=1.0, at_bits=16)).ceiling == 65535  # nothing piles up: nothing is guessed


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"most_saturated": 0.0}, "most_saturated"),
        ({"least_contrast": 1.5}, "least_contrast"),
        ({"flash_share": 0.0}, "flash_share"),
        ({"noise": -1.0}, "noise"),
        ({"mask": np.ones((3, 3), dtype=bool)}, "mask"),
        ({"mask": np.zeros((SIDE, SIDE), dtype=bool)}, "mask"),
    ],
)
def test_limits_out_of_range_are_refused(limits, message):
    with pytest.raises(ValueError, match=message):
        frame_health(scene(), **limits)

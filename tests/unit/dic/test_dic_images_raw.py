"""Photron and Phantom files, written byte by byte from their documented layouts."""

import numpy as np
import pytest
from picture_files import cih, cihx, cine, packed

from dic.images import PictureError, Pictures, open_pictures
from dic.images.cine import p10_to_linear
from dic.images.series import packed_size, unpack

SHAPE = (6, 16)


def grey(bits, frames=3, shape=SHAPE):
    return np.random.default_rng(bits).integers(0, 2**bits, (frames, *shape)).astype(np.uint16)


def read_all(pictures):
    assert isinstance(pictures, Pictures)
    return [pictures.frame(index) for index in range(pictures.n_frames)]


def failures(pictures):
    """Which frames raise a PictureError of one line that names them."""
    found = {}
    for index in range(pictures.n_frames):
        try:
            pictures.frame(index)
        except PictureError as error:
            found[index] = str(error)
    assert all(f"frame {index}" in text and "\n" not in text for index, text in found.items())
    return list(found)


# --- packed bits --------------------------------------------------------------------------------------


@pytest.mark.parametrize("bits", [10, 12])
@pytest.mark.parametrize("values", [1, 2, 3, 4, 5, 97])
def test_unpacking_undoes_packing_bit_by_bit(bits, values):
    wrote = grey(bits, 1, (values, 1)).ravel()
    raw = np.frombuffer(packed(wrote, bits), dtype=np.uint8)
    assert raw.size == packed_size(values, bits)
    np.testing.assert_array_equal(unpack(raw, bits, values), wrote)


def test_too_few_bytes_or_other_bits_are_refused():
    with pytest.raises(ValueError, match="need 3 bytes, there are 2"):
        unpack(np.zeros(2, dtype=np.uint8), 12, 2)
    with pytest.raises(ValueError, match="bits = 14"):
        unpack(np.zeros(9, dtype=np.uint8), 14, 1)


# --- Photron ------------------------------------------------------------------------------------------


def mraw(folder, data, header, suffix=".cih"):
    (folder / "shot.mraw").write_bytes(data)
    (folder / f"shot{suffix}").write_bytes(header if isinstance(header, bytes) else header.encode())
    return folder / "shot.mraw"


@pytest.mark.parametrize("opened", [".mraw", ".cih"])
@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_mraw_of_every_depth(tmp_path, bits, opened):
    wrote = grey(bits)
    data = packed(wrote, bits) if bits in (10, 12) else wrote.astype(f"<u{bits // 8}").tobytes()
    header = cih(**{"Color Bit": str(bits), "EffectiveBit Depth": str(bits)})
    pictures = open_pictures(mraw(tmp_path, data, header).with_suffix(opened))
    assert (pictures.n_frames, pictures.shape, pictures.bits) == (3, SHAPE, bits)
    assert pictures.path.name == "shot.mraw"
    np.testing.assert_array_equal(read_all(pictures), wrote)
    np.testing.assert_allclose(pictures.times, np.array([-1, 0, 1]) / 120e3, rtol=1e-15)


def test_mraw_of_12_bits_in_16_at_either_end(tmp_path):
    wrote = grey(12)
    low = open_pictures(mraw(tmp_path, wrote.astype("<u2").tobytes(), cih()))
    assert low.bits == 12
    np.testing.assert_array_equal(read_all(low), wrote)
    high = open_pictures(
        mraw(tmp_path, (wrote << 4).astype("<u2").tobytes(), cih(**{"EffectiveBit Side": "Higher"}))
    )
    assert high.bits == 12
    np.testing.assert_array_equal(read_all(high), wrote)
    # the same header over values that do use the low bits: said, not cut off
    lied = open_pictures(
        mraw(tmp_path, wrote.astype("<u2").tobytes(), cih(**{"EffectiveBit Side": "Higher"}))
    )
    with pytest.raises(PictureError, match="lowest 4 bits are not zero"):
        lied.frame(0)


def test_cihx(tmp_path):
    wrote = grey(12)
    pictures = open_pictures(mraw(tmp_path, packed(wrote, 12), cihx(), ".cihx"))
    assert pictures.bits == 12
    np.testing.assert_array_equal(read_all(pictures), wrote)
    np.testing.assert_allclose(pictures.times, np.array([-1, 0, 1]) / 120e3, rtol=1e-15)


def test_raw_of_a_camera_without_colours_is_grey_and_lies_on_the_sensor(tmp_path):
    wrote, place = grey(12), "<segmentPos><x>256</x><y>384</y></segmentPos>"
    device = "<deviceInfo><deviceName>FASTCAM SA-Z type 2100K-M-32GB</deviceName></deviceInfo>"
    header = cihx(colours="Raw", segment=place, inside=device)
    pictures = open_pictures(mraw(tmp_path, packed(wrote, 12), header, ".cihx"))
    np.testing.assert_array_equal(read_all(pictures), wrote)
    assert pictures.crop_offset == (256.0, 384.0)


def test_raw_of_a_colour_camera_and_a_damaged_place_are_refused(tmp_path):
    device = "<deviceInfo><deviceName>FASTCAM SA-Z type 2100K-C-32GB</deviceName></deviceInfo>"
    with pytest.raises(PictureError, match="raw pictures of the colour camera"):
        open_pictures(mraw(tmp_path, packed(grey(12), 12), cihx(colours="Raw", inside=device), ".cihx"))
    lost = mraw(
        tmp_path, packed(grey(12), 12), cihx(segment="<segmentPos><x>left</x><y>0</y></segmentPos>"), ".cihx"
    )
    with pytest.raises(PictureError, match='"segmentPos" must be two whole numbers'):
        open_pictures(lost)


def test_mraw_shorter_than_its_header_says(tmp_path):
    wrote = grey(12)
    pictures = open_pictures(mraw(tmp_path, packed(wrote, 12)[:-1], cihx(frames=1000), ".cihx"))
    assert failures(pictures) == list(range(2, 1000))
    np.testing.assert_array_equal(pictures.frame(1), wrote[1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"Image Width": "0"}, "6 rows and 0 columns"),
        ({"Image Height": "-6"}, "-6 rows"),
        ({"Image Width": "99999999999"}, "99999999999 columns"),
        ({"Total Frame": "0"}, "0 frames"),
        ({"Total Frame": "999999999999"}, "999999999999 frames"),
        ({"Total Frame": "__import__('os')"}, "must be a whole number"),
        ({"Image Width": None}, '"Image Width" must be a whole number, is None'),
        ({"Color Bit": "14"}, '"Color Bit" is 14'),
        ({"Color Type": "Color", "Color Bit": "24"}, "color pictures"),
        ({"File Format": "TIFF"}, "tiff files"),
        ({"EffectiveBit Depth": "0"}, "bits = 0"),
        ({"Record Rate(fps)": "fast"}, "must be a number"),
    ],
)
def test_a_header_that_lies_is_refused(tmp_path, changes, message):
    path = mraw(tmp_path, grey(12).tobytes(), cih(**changes))
    with pytest.raises(PictureError, match=message.replace("(", r"\(").replace(")", r"\)")):
        open_pictures(path)


@pytest.mark.parametrize(("stated", "stored"), [("12", 16), ("16", 12), ("8", 10)])
def test_a_depth_that_the_size_of_the_file_contradicts_is_refused(tmp_path, stated, stored):
    """Pictures of another depth would be read as noise; a file that is only cut short keeps its pictures."""
    rows, columns = SHAPE
    size = 3 * rows * columns * stored // 8
    with pytest.raises(PictureError, match=f'"Color Bit" is {stated}, but .* 3 pictures of {stored} bits'):
        open_pictures(mraw(tmp_path, bytes(size), cih(**{"Color Bit": stated})))
    assert open_pictures(mraw(tmp_path, bytes(size - 1), cih(**{"Color Bit": stated}))).n_frames == 3


def test_entities_are_not_read(tmp_path):
    bomb = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>'
    with pytest.raises(PictureError, match="declares entities"):
        open_pictures(mraw(tmp_path, grey(12).tobytes(), cihx(inside=bomb), ".cihx"))


def test_half_a_recording_is_named(tmp_path):
    (tmp_path / "a.mraw").write_bytes(b"\0")
    with pytest.raises(PictureError, match=r"no a.cih or .cihx next to it"):
        open_pictures(tmp_path / "a.mraw")
    (tmp_path / "b.cih").write_text(cih())
    with pytest.raises(PictureError, match=r"no b.mraw next to it"):
        open_pictures(tmp_path / "b.cih")
    (tmp_path / "a.cih").write_bytes(b"\0\1\2")
    with pytest.raises(PictureError, match='no line of the form "name : value"'):
        open_pictures(tmp_path / "a.mraw")


def test_frames_left_out_on_saving_leave_the_times_open(tmp_path):
    pictures = open_pictures(mraw(tmp_path, grey(12).tobytes(), cih(**{"Save Step": "5"})))
    assert pictures.times is None


# --- Phantom ------------------------------------------------------------------------------------------


def phantom(folder, *args, **options):
    path = folder / "shot.cine"
    path.write_bytes(cine(*args, **options))
    return path


@pytest.mark.parametrize("bits", [8, 12, 14])
def test_cine_uncompressed(tmp_path, bits):
    wrote = grey(bits)
    pictures = open_pictures(phantom(tmp_path, wrote, bits=bits))
    assert (pictures.n_frames, pictures.shape, pictures.bits) == (3, SHAPE, bits)
    np.testing.assert_array_equal(read_all(pictures), wrote)
    assert pictures.crop_offset == (0.0, 0.0)


def test_cine_with_the_top_row_first(tmp_path):
    wrote = grey(12)
    pictures = open_pictures(phantom(tmp_path, wrote[:, ::-1], height=-SHAPE[0]))
    np.testing.assert_array_equal(read_all(pictures), wrote)


@pytest.mark.parametrize(
    ("bits", "packing", "read"),
    [(12, {"packing": 1024}, np.arange(4096)), (10, {"bits": 10, "packing": 256}, p10_to_linear())],
    ids=["P12L", "P10, made linear"],
)
def test_packed_cine(tmp_path, bits, packing, read):
    wrote = grey(bits)
    pictures = open_pictures(phantom(tmp_path, wrote, **packing))
    assert pictures.bits == 12
    np.testing.assert_array_equal(read_all(pictures), read[wrote])


def test_the_curve_of_p10_is_the_printed_one():
    # places of the table in Vision Research, "Cine File Format"
    table = {1: 5, 64: 64, 128: 125, 200: 204, 256: 290, 300: 374, 400: 623, 512: 998, 640: 1559, 768: 2267}
    table |= {900: 3159, 1000: 3947, 1014: 4064, 1015: 4095, 1023: 4095}
    curve = p10_to_linear()
    for value, linear in table.items():
        assert abs(int(curve[value]) - linear) <= 1  # whole numbers: the table itself is rounded
    assert np.all(np.diff(curve.astype(int)) >= 0)


def test_cine_time_stamps_count_from_the_trigger(tmp_path):
    # 7.25 s is the trigger; the two lowest bits of a fraction are flags and no time
    stamps = [(7, (1 << 30) - (1 << 20)), (7, (1 << 30) | 3), (8, 0)]
    pictures = open_pictures(phantom(tmp_path, grey(12), stamps=stamps))
    np.testing.assert_array_equal(pictures.times, [-(2.0**-12), 0.0, 0.75])


def test_cine_without_time_stamps_counts_frames(tmp_path):
    pictures = open_pictures(phantom(tmp_path, grey(12), first=-2, rate=1000))
    np.testing.assert_allclose(pictures.times, [-2e-3, -1e-3, 0.0], atol=1e-18)
    assert open_pictures(phantom(tmp_path, grey(12), rate=0)).times is None
    few = phantom(tmp_path, grey(12), stamps=[(7, 0), (8, 0)])  # two for three pictures: none is believed
    assert open_pictures(few).times is None


def test_a_cine_cut_off_keeps_the_frames_before_the_cut(tmp_path):
    wrote = grey(12)
    path = phantom(tmp_path, wrote)
    path.write_bytes(path.read_bytes()[:-1])
    pictures = open_pictures(path)
    assert failures(pictures) == [2]
    np.testing.assert_array_equal(pictures.frame(1), wrote[1])


def test_a_cine_that_promises_more_frames_than_it_has(tmp_path):
    pictures = open_pictures(phantom(tmp_path, grey(12), count=500))
    # beyond the table its bytes are those of pictures: whatever they say, it is an error or a frame's bytes
    assert set(range(3)).isdisjoint(failures(pictures))
    assert len(failures(pictures)) > 400


@pytest.mark.parametrize(
    ("lies", "message"),
    [
        ({"count": 0}, "0 frames"),
        ({"count": 4_000_000_000}, "4000000000 frames"),
        ({"columns": 0}, "0 columns"),
        ({"columns": -5}, "-5 columns"),
        ({"height": 2_000_000_000}, "2000000000 rows"),
        ({"setup": 4_000_000_000}, "SETUP should lie at"),
        ({"mark": b"XX"}, "has the mark b'XX'"),
        ({"table": 4_000_000_000}, "table of pictures should lie at"),
        ({"table": 90}, "tagged blocks should lie at"),
        ({"compression": 1}, r"compressed pictures \(compression 1\).*export grey pictures"),
        ({"colours": 3}, r"taken with a colour filter \(3\)"),
        ({"packing": 512}, None),
    ],
)
def test_cine_headers_that_lie_are_refused(tmp_path, lies, message):
    if message is None:
        path = phantom(tmp_path, grey(12))
        raw = bytearray(path.read_bytes())
        raw[44 + 16 : 44 + 20] = (512).to_bytes(4, "little")
        path.write_bytes(bytes(raw))
        message = r"unknown packing \(512\)"
    else:
        path = phantom(tmp_path, grey(12), **lies)
    with pytest.raises(PictureError, match=message):
        open_pictures(path)


@pytest.mark.parametrize("lies", [{"notes": 0}, {"notes": 4_000_000_000}, {"size": 3}])
def test_a_cine_picture_that_lies_is_an_error_of_its_own(tmp_path, lies):
    assert failures(open_pictures(phantom(tmp_path, grey(12), **lies))) == [0, 1, 2]


@pytest.mark.parametrize("size", [3, 43, 44, 60, 90, 500])
def test_a_cine_cut_off_in_its_headers_is_named(tmp_path, size):
    path = phantom(tmp_path, grey(12))
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(PictureError, match=r"shot\.cine"):
        open_pictures(path)

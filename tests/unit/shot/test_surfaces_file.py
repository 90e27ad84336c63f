"""A stereo result on disk: HDF5 round trip, tables with VIC-3D's names, rejection of damaged files."""

import h5py
import numpy as np
import pytest
from synthetic_dic import BLACK, synthetic_result

from kolsky.base.errors import InputError
from kolsky.pictures.dic_file import read_stereo_result, stored_key, write_stereo_result


@pytest.fixture(scope="module")
def result():
    return synthetic_result()


def same(one, other) -> bool:
    """Whether two trees of dataclasses, mappings, tuples and arrays hold the same."""
    if hasattr(one, "__dataclass_fields__"):
        return type(one) is type(other) and all(
            same(getattr(one, name), getattr(other, name)) for name in one.__dataclass_fields__
        )
    if isinstance(one, np.ndarray):
        return one.shape == other.shape and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if hasattr(one, "items"):
        return dict(one).keys() == dict(other).keys() and all(same(one[k], other[k]) for k in one)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return bool(one == other)


@pytest.mark.parametrize("flyer", [True, False])
def test_hdf5_there_and_back(tmp_path, flyer):
    before = synthetic_result(flyer=flyer)
    write_stereo_result(tmp_path / "dic.h5", before, key="abc")
    assert same(read_stereo_result(tmp_path / "dic.h5"), before)
    assert stored_key(tmp_path / "dic.h5") == "abc"
    assert [path.name for path in tmp_path.iterdir()] == ["dic.h5"]  # nothing partial is left


def test_every_array_has_units_and_nothing_is_pickled(tmp_path, result):
    write_stereo_result(tmp_path / "dic.h5", result)
    seen = []

    def look(name, item):
        if isinstance(item, h5py.Dataset):
            seen.append(name)
            assert item.dtype.kind in "fib" or h5py.check_string_dtype(item.dtype).length is not None
            assert "units" in item.attrs or h5py.check_string_dtype(item.dtype)
        else:
            assert "NX_class" in item.attrs

    with h5py.File(tmp_path / "dic.h5") as file:
        file.visititems(look)
        assert file["entry/specimen/u"].attrs["units"] == "m"
        assert list(file["entry/specimen"].attrs["axes"]) == ["t", "points", "."]
    assert len(seen) > 40


def test_an_old_file_survives_a_failure(tmp_path, result):
    path = tmp_path / "dic.h5"
    write_stereo_result(path, result, key="old")
    broken = synthetic_result()
    object.__setattr__(broken, "facts", {"a": float("nan")})
    with pytest.raises(ValueError, match="JSON"):
        write_stereo_result(path, broken, key="new")
    assert stored_key(path) == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["dic.h5"]


def damaged(path, change):
    with h5py.File(path, "r+") as file:
        change(file)


CHANGES = {
    "missing": (lambda f: f.__delitem__("entry/specimen/u"), "u"),
    "shape": (lambda f: (f.__delitem__("entry/t"), f["entry"].create_dataset("t", data=np.zeros(3))),
     "size 3 along 'frames'|expected 3|in None"),
    "link": (lambda f: (f.__delitem__("entry/t"),
     f["entry"].__setitem__("t", h5py.SoftLink("/entry/specimen/t"))), "/entry/t: a SoftLink"),
    "type": (lambda f: (f.__delitem__("entry/t"),
     f["entry"].create_dataset("t", data=np.zeros(40, dtype="<f4"))), "/entry/t: type float32"),
    "no values": (lambda f: (f.__delitem__("entry/strain/gauge"),
     f["entry/strain"].create_dataset("gauge", data=h5py.Empty("<f8"))),
     "/entry/strain/gauge: holds nothing"),
    "8 TB of nothing": (lambda f: (f.__delitem__("entry/remark_names"),
     f["entry"].create_dataset("remark_names", shape=(2**40,), dtype="S8", chunks=(1024,))),
     "remark_names: the file unpacks to more than"),
    "unit": (lambda f: f["entry/t"].attrs.__setitem__("units", "ms"), "must be in 's'"),
    "version": (lambda f: f.attrs.__setitem__("format_version", 99), "99"),
    "outcome": (lambda f: f["entry/specimen/outcome"].__setitem__((0, 0), 77), "outcome 77"),
    "facts": (lambda f: f["entry/facts"].__setitem__((), b"{"), "facts: not JSON"),
    "camera": (lambda f: f["entry/cameras/0/fx"].__setitem__((), -1.0), "focal"),
}  # fmt: skip


@pytest.mark.parametrize("name", CHANGES)
def test_a_damaged_file_is_refused(tmp_path, result, name):
    change, says = CHANGES[name]
    path = tmp_path / "dic.h5"
    write_stereo_result(path, result)
    damaged(path, change)
    with pytest.raises(InputError, match=says) as refused:
        read_stereo_result(path)
    assert str(path) in str(refused.value)


def test_no_file_and_no_hdf5(tmp_path):
    (tmp_path / "text.h5").write_text("no HDF5")
    for name in ("text.h5", "nothing.h5"):
        assert stored_key(tmp_path / name) is None
        with pytest.raises(InputError, match=name):
            read_stereo_result(tmp_path / name)


def test_a_black_frame_is_told(result):
    assert result.outcome[BLACK].item() == 2  # FrameOutcome.BLACK
    assert np.count_nonzero(result.outcome) == 1

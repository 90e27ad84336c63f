"""Damage inside a valid HDF5 file: types, sizes, values, links."""

import random
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np


def _datasets(file: h5py.File) -> list[str]:
    names: list[str] = []
    file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    return names


def _replace(file: h5py.File, name: str, value: object) -> None:
    attributes = dict(file[name].attrs)
    del file[name]
    file[name] = value
    for key, kept in attributes.items():
        file[name].attrs[key] = kept


def wild(file: h5py.File, name: str, rng: random.Random) -> None:
    """One number is not finite, or of a size that nothing has."""
    values = np.array(file[name][()])
    if values.dtype.kind not in "fiu" or not values.size:
        return
    flat = values.reshape(-1)
    if values.dtype.kind == "f":
        flat[rng.randrange(flat.size)] = rng.choice([np.nan, np.inf, -np.inf, 1e300, -1.0, 0.0])
    else:
        flat[rng.randrange(flat.size)] = rng.choice([0, 1, np.iinfo(values.dtype).max])
    _replace(file, name, values)


def retyped(file: h5py.File, name: str, rng: random.Random) -> None:
    """The type is another."""
    shape = file[name].shape or ()
    attributes = dict(file[name].attrs)
    del file[name]
    space = h5py.h5s.create_simple(shape) if shape else h5py.h5s.create(h5py.h5s.SCALAR)
    kind = rng.choice(
        [h5py.h5t.UNIX_D64LE, h5py.h5t.STD_REF_OBJ, h5py.h5t.NATIVE_B8, h5py.h5t.C_S1, h5py.h5t.IEEE_F32LE,
         h5py.h5t.NATIVE_UINT64, h5py.h5t.py_create(np.dtype([("a", "f8"), ("b", "i4")])),
         h5py.h5t.py_create(np.dtype("c16"))]
    )  # fmt: skip
    made = h5py.h5d.create(file.id, name.encode(), kind, space, h5py.h5p.create(h5py.h5p.DATASET_CREATE))
    for key, kept in attributes.items():
        h5py.Dataset(made).attrs[key] = kept


def resized(file: h5py.File, name: str, rng: random.Random) -> None:
    """The shape is another."""
    values = np.array(file[name][()])
    made = rng.choice(
        [
            values.reshape(-1)[:0],
            values.reshape(-1)[:1],
            np.concatenate([values.reshape(-1)] * 2),
            values[None],
        ]
    )
    _replace(file, name, made)


def declared(file: h5py.File, name: str, rng: random.Random) -> None:
    """A billion numbers are declared and none is stored."""
    kind = file[name].dtype if file[name].dtype.kind in "fiu" else np.dtype("f8")
    attributes = dict(file[name].attrs)
    shape = rng.choice([(1_000_000_000,), (49_000_000,), (40_000, 30_000), (2**40,)])
    del file[name]
    file.create_dataset(name, shape=shape, dtype=kind, chunks=tuple(min(n, 1024) for n in shape))
    for key, kept in attributes.items():
        file[name].attrs[key] = kept


def missing(file: h5py.File, name: str, rng: random.Random) -> None:
    """A dataset is not there."""
    del file[name]


def linked(file: h5py.File, name: str, rng: random.Random) -> None:
    """A link stands in its place: to nothing, to another file, to the group above."""
    del file[name]
    above = name.rpartition("/")[0] or "/"
    kind = rng.choice(["soft", "external", "cycle"])
    if kind == "cycle":
        file[name] = file[above]
    else:
        file[name] = h5py.SoftLink("/nowhere") if kind == "soft" else h5py.ExternalLink("/etc/passwd", "/")


def attribute(file: h5py.File, name: str, rng: random.Random) -> None:
    """An attribute is missing, or another."""
    item = rng.choice([file, file[name], file[name].parent])
    keys = list(item.attrs)
    if keys:
        key = rng.choice(keys)
        del item.attrs[key]
        if rng.random() < 0.7:
            item.attrs[key] = rng.choice(
                [np.nan, -1, "x", "x" * 60_000, np.zeros(5), 1e308, np.inf, b"\xff\xfe"]
            )


OF_HDF5: dict[str, Callable[[h5py.File, str, random.Random], None]] = {
    made.__name__: made for made in (wild, retyped, resized, declared, missing, linked, attribute)
}
"""Damage of HDF5 files."""


def damage_hdf5(path: Path, kind: str, rng: random.Random) -> None:
    """Damage one dataset of a file, in its place."""
    with h5py.File(path, "r+") as file:
        names = _datasets(file)
        OF_HDF5[kind](file, rng.choice(sorted(names)), rng)

"""All contents of an HDF5 file, read with h5py only."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np


def contents(path: Path) -> dict[str, tuple[Any, ...]]:
    """Contents by path: attributes of a group; attributes, type, shape and bytes of a dataset, for each of
    its names."""
    found: dict[str, tuple[Any, ...]] = {}

    def look(group: h5py.Group, place: str) -> None:
        found[place] = (_attributes(group),)
        for name, item in group.items():
            if isinstance(item, h5py.Group):
                look(item, f"{place}{name}/")
            else:
                values = np.asarray(item[()])
                found[place + name] = (_attributes(item), str(item.dtype), item.shape, values.tobytes())

    with h5py.File(path) as file:
        look(file, "/")
    return found


def _attributes(item: h5py.Group | h5py.Dataset) -> dict[str, Any]:
    return {name: np.asarray(value).tolist() for name, value in item.attrs.items()}

"""What several methods find, in the result's HDF5 file and its JSON object."""

from typing import Any

import h5py

from kolsky.inverse.method_comparison import Method
from kolsky.results.datasets import group, numbered, read, read_numbers, write, write_numbers
from kolsky.results.layout import Table

METHOD: Table = {
    "name": ("", "", "t"),
    "runs": ("1", "", "i"),
    "shared_runs": ("1", "", "i"),
    "converged": ("1", "", "b"),
    "ended": ("", "", "t"),
}


def write_methods(entry: h5py.Group, methods: tuple[Method, ...]) -> None:
    """Write them into a result's entry, in their order."""
    place = group(entry, "methods", "NXcollection")
    for number, method in enumerate(methods):
        part = group(place, str(number), "NXcollection")
        write(part, METHOD, vars(method), {})
        write_numbers(part, "values", method.values)
        write_numbers(part, "distances", method.distances, "1")


def read_methods(file: h5py.File) -> tuple[Method, ...]:
    """What `write_methods` wrote.

    Raises
    ------
    kolsky.results.datasets.Refused
        If a dataset is missing or not as it was written.
    """
    return tuple(
        Method(
            **read(file, place, METHOD, {}),
            values=read_numbers(file, f"{place}/values"),
            distances=read_numbers(file, f"{place}/distances"),
        )
        for place in numbered(file, "entry/methods")
    )


def methods_json(methods: tuple[Method, ...]) -> list[dict[str, Any]]:
    """The same as JSON types."""
    return [dict(vars(method)) for method in methods]

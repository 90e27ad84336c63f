"""Contents of the files of a command, for `benchmarks.kills`: digests by file and position."""

import hashlib
import json
import sqlite3
from pathlib import Path

import h5py
import numpy as np

READ = (".h5", ".csv", ".json", ".toml", ".html", ".sqlite", ".npz")
"""Extensions of the files that are read."""


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file() and path.suffix in READ)


def contents(folder: Path) -> dict[str, str]:
    """Digests of numbers and texts in the files of a folder, by file and position. For a page only the name
    is used."""
    found: dict[str, str] = {}
    for path in _files(folder):
        name = str(path.relative_to(folder))
        if path.suffix == ".h5":
            found |= _of_hdf5(path, name)
        elif path.suffix == ".json":
            found |= _of_json(json.loads(path.read_text()), name)
        elif path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as arrays:
                found |= {f"{name}:{key}": _digest(arrays[key].tobytes()) for key in arrays}
        elif path.suffix == ".sqlite":
            found |= {f"{name}:{key}": "" for key in ledger_runs(folder)}
        elif path.suffix == ".html":
            found[name] = ""
        else:
            found[name] = _digest(path.read_bytes())
    return found


def _of_hdf5(path: Path, name: str) -> dict[str, str]:
    found: dict[str, str] = {}

    def look(place: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            found[f"{name}:{place}"] = _digest(np.asarray(item[()]).tobytes())

    with h5py.File(path, "r") as file:
        file.visititems(look)
    return found


def _of_json(value: object, place: str) -> dict[str, str]:
    if isinstance(value, dict):
        return {k: v for key, item in value.items() for k, v in _of_json(item, f"{place}:{key}").items()}
    if isinstance(value, list):
        return {k: v for i, item in enumerate(value) for k, v in _of_json(item, f"{place}:{i}").items()}
    return {place: repr(value)}


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def ledger_runs(folder: Path) -> dict[str, float]:
    """Key of every run in the ledgers of a folder, with its duration [s], which differs if a run is
    repeated."""
    found: dict[str, float] = {}
    for path in sorted(folder.rglob("*.sqlite")):
        with sqlite3.connect(path) as book:
            found |= {key.hex(): seconds for key, seconds in book.execute("SELECT key, seconds FROM runs")}
        book.close()
    return found


def unreadable(folder: Path) -> list[str]:
    """The files of a folder that cannot be read, with the reason; hidden files are ignored."""
    found = []
    for path in _files(folder):
        if any(part.startswith(".") for part in path.relative_to(folder).parts):
            continue
        try:
            if path.suffix == ".h5":
                _of_hdf5(path, path.name)
            elif path.suffix == ".json":
                json.loads(path.read_text())
            elif path.suffix == ".sqlite":
                with sqlite3.connect(path) as book:
                    health = book.execute("PRAGMA quick_check(1)").fetchone()[0]
                book.close()
                if health != "ok":
                    found.append(f"{path.name} ({health})")
            elif (path.suffix == ".html" and not path.read_text().rstrip().endswith("</html>")) or (
                path.suffix == ".csv" and not path.read_bytes().endswith(b"\n")
            ):
                found.append(f"{path.name} (does not end)")
        except (OSError, ValueError, sqlite3.Error, KeyError) as error:
            found.append(f"{path.name} ({error})")
    return found

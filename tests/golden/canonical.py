"""The compared content of a file: its values by name, without times, versions and paths."""

import base64
import csv
import hashlib
import html
import io
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

MASKED_KEYS: dict[str, str] = {
    "wall times": r"(^|[/ _@])(seconds|elapsed)([/ _(@]|$)|(wall|processor)[ _](times?|s|median|99|worst)\b"
    r"|(wall|processor)_(median|99_9|worst)_s$",
    "ticks of the controller that came late": r"(^|/)late_ticks",
    "versions of packages": r"(^|/)(software|versions?|python|packages)(/|$)",
    "dates": r"(^|[/@])(date|created|file_time|start_time_utc|written)(/|$)",
    "the machine": r"(^|/)(machine|host|hostname|platform|processor|cores)(/|$)",
    "places of files": r"(^|/)(page|folder|path|cwd|command_line|ledger)(/|$)",
}
"""Rules by the name of a value (group, key or column): what they leave out, and the pattern of the name."""

MASKED_TEXT: dict[str, tuple[str, str]] = {
    "a wall time as printed": (r"(?<![\w.+-])\d+\.\d s\b", "# s"),
    "a wall time in a line that says so": (r"(?i)^(.*\bwall[ _-]time\b).*$", r"\1 #"),
    "wall times of a controller in a table of a page": (
        r"(Hz × [\d.]+ s \|) [\d.]+ / [\d.]+ \| [\d.]+ / [\d.]+ \| \d+",
        r"\1 #",
    ),
    "a version in a table of a page": (r"^(python|numpy|scipy|h5py|kolsky|warp-lang) \|.*$", r"\1 | #"),
}
"""Rules for texts, line by line: what they mask, the pattern and what stands there instead."""

MASKED_TABLES = ("Versions", "Wall time", "Wall times", "Machine")
"""Captions of the tables of a page that are left out."""

PRESENCE = {".png", ".gif", ".mp4", ".pdf", ".svg", ".sqlite", ".sqlite-wal", ".sqlite-shm", ".js", ".css"}
"""Endings of files of which only the presence is compared: pictures that are drawn, ledgers with times."""

Content = dict[str, Any]


@dataclass(frozen=True)
class Change:
    """One value that is another one.

    ``key``: name of the value in its file. ``said``: what differs, in words.
    """

    key: str
    said: str


def masked(key: str) -> bool:
    """Whether a value of this name is left out by one of `MASKED_KEYS`."""
    return any(re.search(pattern, key, re.IGNORECASE) for pattern in MASKED_KEYS.values())


def masked_text(text: str, places: dict[str, str]) -> str:
    """Return a text without what `MASKED_TEXT` masks.

    ``text``: one line or several. ``places``: folders of this run, and what stands for each.
    """
    for place, name in places.items():
        text = text.replace(place, name)
    lines = [re.sub(r"\s+", " ", line).strip() for line in text.splitlines()]
    for pattern, instead in MASKED_TEXT.values():
        lines = [re.sub(pattern, instead, line) for line in lines]
    return "\n".join(lines)


def content_of(path: Path, places: dict[str, str] | None = None) -> Content:
    """Return the values of a file that are compared, by their names.

    ``path``: the file; its ending says how it is read. ``places``: folders of the run that wrote it, and what
    stands for each in texts. Returns: arrays, numbers and texts by name, without those that the rules leave
    out.
    """
    ending, places = path.suffix.lower(), places or {}
    if ending in PRESENCE:
        return {"present": True}
    if ending in {".h5", ".hdf5"}:
        found = dict(_hdf5(path))
    elif ending == ".json":
        found = dict(_tree("", json.loads(path.read_text(encoding="utf-8"))))
    elif ending in {".npz", ".npy"}:
        loaded = np.load(path)
        found = dict(loaded) if ending == ".npz" else {"array": loaded}
    elif ending == ".csv":
        found = _table(path.read_text(encoding="utf-8", errors="replace"))
    elif ending in {".vtu", ".vtp"}:
        found = _vtk(path.read_text(encoding="utf-8"))
    elif ending == ".html":
        found = {"text": _page(path.read_text(encoding="utf-8"))}
    else:
        data = path.read_bytes()
        try:
            found = dict(_text("text", data.decode("utf-8").strip()))
        except UnicodeDecodeError:
            found = {"bytes": hashlib.sha256(data).hexdigest()}
    kept = {key: value for key, value in found.items() if not masked(key)}
    return {k: masked_text(v, places) if isinstance(v, str) else v for k, v in kept.items()}


def changes(old: Content, new: Content) -> list[Change]:
    """Return the values that differ between two contents of a file, by name."""
    found = [Change(key, "is missing") for key in sorted(old.keys() - new.keys())]
    found += [Change(key, "is new") for key in sorted(new.keys() - old.keys())]
    for key in sorted(old.keys() & new.keys()):
        said = _difference(old[key], new[key])
        if said:
            found.append(Change(key, said))
    return found


def _difference(old: Any, new: Any) -> str:
    """Say how two values differ; nothing where their bits are the same."""
    if isinstance(old, np.ndarray) or isinstance(new, np.ndarray):
        a, b = np.asarray(old), np.asarray(new)
        if a.dtype != b.dtype or a.shape != b.shape:
            return f"{a.dtype} {a.shape} became {b.dtype} {b.shape}"
        if a.dtype.kind in "OSU":
            return _difference(tuple(a.ravel().tolist()), tuple(b.ravel().tolist()))
        if a.tobytes() == b.tobytes():
            return ""
        return _largest(a, b)
    if type(old) is not type(new):
        return f"{type(old).__name__} {str(old)[:60]!r} became {type(new).__name__} {str(new)[:60]!r}"
    if isinstance(old, float) and old != old and new != new:
        return ""
    if old == new:
        return ""
    if isinstance(old, tuple):
        if len(old) != len(new):
            return f"{len(old)} values became {len(new)}"
        try:
            return _largest(np.array(old, dtype=float), np.array(new, dtype=float))
        except ValueError:
            pairs = [(x, y) for x, y in zip(old, new, strict=True) if x != y]
            return f"{len(pairs)} of {len(old)} texts differ, first {pairs[0][0]!r} became {pairs[0][1]!r}"
    if isinstance(old, (int, float)):
        return f"{_largest(np.array([old], float), np.array([new], float))}: {old!r} became {new!r}"
    old_lines, new_lines = str(old).splitlines(), str(new).splitlines()
    for x, y in zip(old_lines, new_lines, strict=False):
        if x != y:
            return f"{_numbers(str(old), str(new))}first line that differs: {x[:160]!r} became {y[:160]!r}"
    return f"{len(old_lines)} lines became {len(new_lines)}"


def _numbers(old: str, new: str) -> str:
    """Say how far the numbers of two texts are apart, if all else in them is the same."""
    number = r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?"
    if re.sub(number, "#", old) != re.sub(number, "#", new):
        return ""
    pair = [np.array(re.findall(number, text), dtype=float) for text in (old, new)]
    return f"{_largest(*pair)}; "


def _largest(a: np.ndarray, b: np.ndarray) -> str:
    """Say the largest relative difference of two arrays of numbers, and of how many of them."""
    one = np.iscomplexobj(a)
    a, b = (np.atleast_1d(x if one else x.astype(float)) for x in (a, b))
    off = ~((a == b) | (np.isnan(a) & np.isnan(b)))
    if not off.any():
        return "written in another way, the same numbers (as -0 for 0)"
    with np.errstate(all="ignore"):
        share = np.abs(a - b) / np.maximum(np.abs(a), np.abs(b))
    worst = float(np.nanmax(np.where(off, np.where(np.isfinite(share), share, np.inf), 0.0)))
    return f"{int(off.sum())} of {off.size} values differ, relatively by up to {worst:.2g}"


def _hdf5(path: Path) -> Iterator[tuple[str, Any]]:
    """Every dataset and attribute of an HDF5 file; texts that are JSON are taken apart."""
    found: list[tuple[str, Any]] = []

    def take(name: str, one: h5py.Group | h5py.Dataset) -> None:
        found.extend((f"{name}@{key}", one.attrs[key]) for key in one.attrs)
        if isinstance(one, h5py.Dataset):
            found.append((name, one[()]))
        else:
            found.append((f"{name}/", "group"))

    with h5py.File(path) as file:
        take("", file)
        file.visititems(take)
    for key, value in found:
        if isinstance(value, np.ndarray) and value.dtype.kind in "OS":
            texts = [x.decode() if isinstance(x, bytes) else str(x) for x in value.ravel()]
            yield key, (str(value.shape), *texts)
        elif isinstance(value, (bytes, str)):
            text = value.decode() if isinstance(value, bytes) else value
            yield from _text(key, text)
        elif isinstance(value, (np.ndarray, np.generic)):
            yield key, np.asarray(value)
        else:
            yield key, str(value)


def _text(key: str, text: str) -> Iterator[tuple[str, Any]]:
    """A text, or the values of the JSON object that it is."""
    if text.startswith(("{", "[")):
        try:
            yield from _tree(key, json.loads(text))
        except json.JSONDecodeError:
            yield key, text
    else:
        yield key, text


def _tree(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    """The values of a JSON object by their way from the root; a list of numbers is one value."""
    if isinstance(value, dict):
        for name in sorted(value):
            yield from _tree(f"{key}/{name}", value[name])
        if not value:
            yield key, "{}"
    elif isinstance(value, list):
        if all(x is None or isinstance(x, (int, float)) for x in value):
            yield key, tuple(repr(x) for x in value)
        else:
            for i, one in enumerate(value):
                yield from _tree(f"{key}/{i}", one)
    else:
        yield key, value


def _table(text: str) -> Content:
    """The columns of a CSV file as texts, by heading; of two with one heading also by number."""
    rows = list(csv.reader(io.StringIO(text)))
    if not rows:
        return {"rows": 0}
    found: Content = {"heading": tuple(name for name in rows[0] if not masked(name))}
    for i, name in enumerate(rows[0]):
        key = name if name not in found else f"{name} {i}"
        found[key] = tuple(row[i] if i < len(row) else "" for row in rows[1:])
    found["surplus"] = tuple(",".join(row[len(rows[0]) :]) for row in rows[1:] if len(row) > len(rows[0]))
    return found


def _vtk(text: str) -> Content:
    """The arrays of a VTK XML file whose data are base64 with a length in front; the rest is one text."""
    found: Content = {}
    types = {"Float64": "<f8", "Float32": "<f4", "Int64": "<i8", "Int32": "<i4", "UInt8": "|u1"}
    plain = 'header_type="UInt64"' in text and "compressor=" not in text

    def take(match: re.Match[str]) -> str:
        facts = dict(re.findall(r'(\w+)="([^"]*)"', match[1]))
        if not plain or facts.get("format") != "binary" or facts.get("type") not in types:
            return match[0]
        data = np.frombuffer(base64.b64decode(match[2])[8:], dtype=types[facts["type"]])
        name = facts.get("Name", "array")
        found[name if name not in found else f"{name} {len(found)}"] = data
        return match[1]

    found["text"] = re.sub(r"(?s)(<DataArray\b[^>]*>)([^<]*)</DataArray>", take, text)
    return found


def _page(text: str) -> str:
    """The words of a page: no scripts, no drawings, no tables of `MASKED_TABLES`."""
    text = re.sub(r"(?s)<(script|style|svg|head)\b.*?</\1>", " ", text)
    for caption in MASKED_TABLES:
        text = re.sub(rf"(?s)<table(?:(?!</table>).)*?<caption>\s*{caption}.*?</table>", " ", text)
    text = re.sub(r"</(td|th)>", " | ", text)
    text = re.sub(r"</(p|tr|li|h\d|div|caption|figcaption|summary)>", "\n", text)
    text = html.unescape(re.sub(r"(?s)<[^>]*>", " ", text))
    return "\n".join(line.strip() for line in text.splitlines() if line.strip())

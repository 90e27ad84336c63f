"""A new shot file: the blank one filled with what the folder's files say, or the last one of a series.

What is certain is written: files, columns, units, layouts, with the clocks as remarks. Facts that no file
holds stay blank, and a blank is refused by every command (`kolsky.shot.schema.blanks`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from kolsky.base.units import unit_factor
from kolsky.shot.found_table import FoundColumn, FoundTable, quoted
from kolsky.shot.survey import Survey, displacement_of, sigma_of, strain_of, stress_of, voltage_of

BLANK = '""'
"""A value that is to be filled in."""
COLUMN = 38
"""Where the remark of a line begins."""
PER_SHOT = ("specimen.diameter", "specimen.length", "frames.static")
"""Keys that the next shot of a series does not share with the last."""
SHIFT = "on the file's clock"
_TABLE = re.compile(r"\[\s*([\w.]+)\s*\]")
_VALUE = r"""(?P<value>"[^"]*"|\{.*?\}|\[.*?\]|[^\s#]+)"""
_LINE = re.compile(rf"(?P<off># )?(?P<key>\w+) = {_VALUE}(?P<rest>\s*(?:#.*)?)")


def filled(text: str, values: Mapping[str, str | None]) -> str:
    """A shot file with other values, its remarks kept.

    Parameters
    ----------
    text
        The shot file.
    values
        Dotted key -> value as TOML writes it; None turns the line into a remark. A line that is a remark is
        taken out of it.

    Raises
    ------
    KeyError
        If a key has no line.
    """
    table, lines, left = "", [], dict(values)
    for line in text.split("\n"):
        header, found = _TABLE.match(line.lstrip("# ")), _LINE.fullmatch(line)
        if (header and not line.startswith("# ")) or (header and "=" not in line):
            table = header.group(1)
        key = f"{table}.{found['key']}" if found else ""
        if key in left and (found["off"] is None or left[key] is not None):  # type: ignore[index]
            lines.append(_written(found, left.pop(key)))  # type: ignore[arg-type]
        else:
            lines.append(line)
    if left:
        raise KeyError(f"no line for {', '.join(left)}")
    return "\n".join(lines)


def _written(found: re.Match[str], value: str | None) -> str:
    remark = found["rest"].strip()
    head = f"{found['key']} = {value}" if value is not None else f"# {found['key']} = {found['value']}"
    return f"{head:<{COLUMN - 1}} {remark}" if remark else head


def noted(text: str, notes: Mapping[str, str]) -> str:
    """A shot file with remarks in lines of their own, each above the line of its dotted key."""
    table, lines = "", []
    for line in text.split("\n"):
        header, found = _TABLE.match(line), _LINE.fullmatch(line)
        if header:
            table = header.group(1)
        if found and found["off"] is None and (said := notes.get(f"{table}.{found['key']}")):
            lines.append(f"# {said}")
        lines.append(line)
    return "\n".join(lines)


def values_of(found: Survey) -> dict[str, str | None]:
    """Dotted key -> value, for all that the files of a folder say beyond doubt."""
    parts, values = found.parts, dict[str, str | None]()
    frames = parts.get("frames", parts.get("flyer"))
    for name, table in (("frames", frames), *parts.items()):
        if table is None or f"{name}.file" in values:
            continue
        values[f"{name}.file"] = quoted(table.path.name)
        if table.layout:
            values[f"{name}.layout"] = table.toml_layout()
        if table.frame is not None and name in ("frames", "flyer", "centre_line"):
            values[f"{name}.frame"] = quoted(table.frame.name)
        if name == "force" and table.clock is not None:
            values["force.time"] = None  # the layout says how to read it
        elif table.time is not None and name != "curve":
            values[f"{name}.time"] = table.time.toml()
    chosen: dict[str, FoundColumn | None] = {}
    if "force" in parts:
        chosen["force.voltage"] = voltage_of(parts["force"])
    if "flyer" in parts:
        chosen["flyer.displacement"] = displacement_of(parts["flyer"])
    if "centre_line" in parts:
        line = parts["centre_line"]
        chosen |= {"centre_line.y": line.only(r"y\b", "m"), "centre_line.Z": line.only(r"z\b", "m")}
        if (sigma := sigma_of(line)) is not None:
            chosen["centre_line.sigma_column"], values["centre_line.sigma"] = sigma, None
    if "curve" in parts:
        chosen |= {"curve.strain": strain_of(parts["curve"]), "curve.stress": stress_of(parts["curve"])}
    return values | {key: column.toml() for key, column in chosen.items() if column is not None}


def notes_of(found: Survey) -> dict[str, str]:
    """Dotted key -> remark: what the files say that helps to fill in what they do not."""
    notes = {}
    parts = found.parts
    frames = parts.get("frames", parts.get("flyer"))
    for name, table in (("force", parts.get("force")), ("frames", frames)):
        if table is not None and (clock := clock_text(table)):
            notes[f"{name}.clock_offset"] = f"{table.path.name}: {clock}"
    if frames is not None and frames.time is not None and frames.time.unit:
        before = int((frames.time.values * unit_factor(frames.time.unit, "s") <= 0.0).sum())
        notes["frames.static"] = f"{before} frames of {frames.time.values.size} have times up to 0 {SHIFT}"
    if (force := parts.get("force")) is not None:
        first = float(force.seconds()[0])
        if np.isfinite(first):
            notes["force.baseline"] = f"the record begins at {microseconds(first)} {SHIFT}"
        if voltage_of(force) is None:
            notes["force.voltage"] = "one of " + ", ".join(
                c.toml() for c in force.columns[:9] if c != force.time
            )
    return notes


def clock_text(table: FoundTable) -> str:
    """First and last time and the step of a file, in words; empty where they are not known."""
    first, last, step = table.seconds().tolist()
    if not np.isfinite([first, last, step]).all():
        return ""
    return f"{microseconds(first)} to {microseconds(last)}, every {microseconds(step)}, {SHIFT}"


def microseconds(seconds: float) -> str:
    """A time as text."""
    return f"{1e6 * seconds:.6g} us"


def next_of_series(text: str, folder: Path, found: Survey) -> str:
    """The shot file of the last shot made into the next one's.

    The apparatus stays; what each shot has of its own is blank, and a file that is not in the folder is
    replaced by the one that was found for its part, with its columns, or is blank.

    Parameters
    ----------
    text
        The last shot's file.
    folder
        The next shot's folder.
    found
        What is in it.
    """
    declared = dict(_declared(text))
    changed: dict[str, str | None] = {key: BLANK for key in PER_SHOT if key in declared}
    if "name" in declared:
        changed["name"] = None
    new = values_of(found)
    for key, value in declared.items():
        part, _, name = key.partition(".")
        if name == "file" and not (folder / value.strip('"')).is_file():
            changed |= {k: v for k, v in new.items() if k.startswith(f"{part}.") and (k in declared)}
            changed.setdefault(key, BLANK)
    top = {key: value for key, value in changed.items() if "." not in key}
    below = {key: value for key, value in changed.items() if "." in key}
    for key in top:
        text = re.sub(rf"(?m)^{key} = ", f"# {key} = ", text, count=1)
    return filled(text, below)


def _declared(text: str) -> Iterator[tuple[str, str]]:
    """Dotted key -> value as written, of the lines that are no remarks."""
    table = ""
    for line in text.split("\n"):
        header, found = _TABLE.match(line), _LINE.fullmatch(line)
        if header:
            table = header.group(1)
        elif found and found["off"] is None:
            yield (f"{table}.{found['key']}" if table else found["key"]), found["value"]

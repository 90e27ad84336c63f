"""A new shot file: the blank one completed from a folder's files, or the next of a series."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.readers.contents import Channel, Contents
from kolsky.readers.header import si_unit
from kolsky.readers.recordings import read_contents
from kolsky.survey.signals import FEWEST_SAMPLES, Findings, quiet_stretch
from kolsky.survey.tables import (
    SHIFT,
    SIGMA,
    ColumnEntry,
    Survey,
    TableEntry,
    clock_text,
    microseconds,
    quoted,
)

BLANK = '""'
"""Placeholder of a value that the user must fill in."""
COLUMN = 38
"""Column at which the remark of a line begins."""
PER_SHOT = ("specimen.diameter", "specimen.length", "frames.static")
"""Keys with a different value in every shot of a series."""
_TABLE = re.compile(r"\[\s*([\w.]+)\s*\]")
_VALUE = r"""(?P<value>"[^"]*"|\{.*?\}|\[.*?\]|[^\s#]+)"""
_LINE = re.compile(rf"(?P<off># )?(?P<key>\w+) = {_VALUE}(?P<rest>\s*(?:#.*)?)")


def _keyed_lines(text: str) -> Iterator[tuple[str, str, re.Match[str] | None]]:
    """Each line of a shot file, commented out or not, with its dotted key and its parts if it has a key."""
    table = ""
    for line in text.split("\n"):
        match = _LINE.fullmatch(line)
        header = _TABLE.match(line.lstrip("# "))
        if header and not match:
            table = header.group(1)
        yield line, (f"{table}.{match['key']}" if match else "").removeprefix("."), match


def fill_in(text: str, values: Mapping[str, str | None]) -> str:
    """A shot file with other values. Its remarks are kept.

    ``text``: the shot file. ``values``: dotted key -> value in TOML syntax; None comments the line out. A
    value for a commented-out line makes it active. Raises KeyError if a key has no line.
    """
    lines, left = [], dict(values)
    for line, key, match in _keyed_lines(text):
        if match and key in left and (match["off"] is None or left[key] is not None):
            line = _written(match, left.pop(key))
        lines.append(line)
    if left:
        raise KeyError(f"no line for {', '.join(left)}")
    return "\n".join(lines)


def _written(match: re.Match[str], value: str | None) -> str:
    head = f"{match['key']} = {value}" if value is not None else f"# {match['key']} = {match['value']}"
    return _aligned(head, match["rest"].strip())


def _aligned(head: str, remark: str) -> str:
    return f"{head:<{COLUMN - 1}} {remark}" if remark else head


def with_notes(text: str, notes: Mapping[str, str]) -> str:
    """A shot file with remarks on separate lines, each above the line of its dotted key."""
    lines = []
    for line, key, match in _keyed_lines(text):
        if match and match["off"] is None and key in notes:
            lines.append(f"# {notes[key]}")
        lines.append(line)
    return "\n".join(lines)


def table_findings(survey: Survey) -> Findings:
    """Values that follow unambiguously from the tables of a folder, and remarks that help with the others."""
    found, parts = Findings(), survey.parts
    values, notes = found.values, found.notes
    frames, force = parts.get("frames", parts.get("flyer")), parts.get("force")
    for name, table in (("frames", frames), *parts.items()):
        if table is None or f"{name}.file" in values:
            continue
        values[f"{name}.file"] = quoted(table.path.name)
        if table.form:
            values[f"{name}.layout"] = f"{{ format = {quoted(table.form)} }}"
        if table.frame is not None and name in ("frames", "flyer", "centre_line"):
            values[f"{name}.frame"] = quoted(table.frame.name)
        if name == "force" and table.clock is not None:
            values["force.time"] = None  # the layout defines the times
        elif table.time is not None and name != "curve":
            values[f"{name}.time"] = table.time.toml()
        if name in ("frames", "force") and (clock := clock_text(table)):
            notes[f"{name}.clock_offset"] = f"{table.path.name}: {clock}"
    chosen: dict[str, ColumnEntry | None] = {}
    if force is not None:
        chosen["force.voltage"] = force.voltage
    if "flyer" in parts:
        chosen["flyer.displacement"] = parts["flyer"].displacement
    if "centre_line" in parts:
        line = parts["centre_line"]
        chosen |= {"centre_line.y": line.only(r"^y\b", "m"), "centre_line.Z": line.only(r"^z\b", "m")}
        if (sigma := line.only(SIGMA, "m")) is not None:
            chosen["centre_line.sigma_column"], values["centre_line.sigma"] = sigma, None
    if "curve" in parts:
        chosen |= {"curve.strain": parts["curve"].strain, "curve.stress": parts["curve"].stress}
    values |= {key: column.toml() for key, column in chosen.items() if column is not None}
    if frames is not None and (times := frames.times) is not None:
        notes["frames.static"] = f"{(times <= 0.0).sum()} frames of {times.size} have times up to 0 {SHIFT}"
    if force is not None:
        if force.times is not None:
            notes["force.baseline"] = f"the record begins at {microseconds(force.times[0])} {SHIFT}"
        if force.voltage is None:
            columns = (c.toml() for c in force.columns[:9] if c != force.time)
            notes["force.voltage"] = f"one of {', '.join(columns)}"
    return found


def next_of_series(text: str, folder: Path, survey: Survey) -> str:
    """The shot file of the next shot, made from that of the last one.

    Values of the apparatus are kept. Values that differ between shots are blank. If a file is not in the
    folder, the one found for the same purpose replaces it, with its columns. Otherwise it is left blank.
    """
    declared = {key: m["value"] for _, key, m in _keyed_lines(text) if m and m["off"] is None}
    changed: dict[str, str | None] = {key: BLANK for key in PER_SHOT if key in declared}
    if "name" in declared:
        changed["name"] = None
    new = table_findings(survey).values
    for key, value in declared.items():
        part, _, name = key.partition(".")
        if name == "file" and not (folder / value.strip('"')).is_file():
            found = {f"{part}.layout": None, **new}
            changed |= {k: v for k, v in found.items() if k.startswith(f"{part}.") and k in declared}
            changed.setdefault(key, BLANK)
    return fill_in(text, changed)


SIDES = {
    "incident": re.compile(r"(?<![a-z])(inc|input|eingang|einfall|entr|in(?![a-z]))", re.IGNORECASE),
    "transmission": re.compile(r"(?<![a-z])(tra(?!in|ck|ce)|out|ausgang|sortie)", re.IGNORECASE),
}
"""Beginnings of words that identify a bar in a channel's name."""
Signal = tuple[str, Channel]
"""Name of a recorder, and a channel of its file."""


def with_recordings(text: str, survey: Survey) -> str:
    """The blank file with recorders and channels, and with properties of the recordings as remarks.

    A channel is assigned if its name identifies the bar. Otherwise it stays blank and the channels are
    listed.
    """
    recorders = _recorders(survey.recordings)
    if not recorders:
        return text
    block = text[text.index("[recorders.scope]") : text.index("[gauges.incident]")]
    text = text.replace(block, "".join(_recorder(n, c) for n, c in recorders.items()), 1)
    signals = [(name, channel) for name, contents in recorders.items() for channel in contents.channels]
    values, notes = dict[str, str | None](), dict[str, str]()
    for side, pattern in SIDES.items():
        table = f"gauges.{side}"
        channels = [s for s in signals if pattern.search(s[1].name)]
        if not channels:  # one file per bar: the file names identify the bars
            channels = [s for s in signals if pattern.search(s[0])]
        if 1 <= len(channels) <= 2:
            values |= _chosen(table, channels, text)
            if (at := _leaves_rest(channels[0][1])) is not None:
                notes[f"{table}.baseline"] = (
                    f"{channels[0][1].name} leaves the level of its beginning at about {microseconds(at)} on "
                    "the file's clock"
                )
        else:
            notes[f"{table}.channels"] = "one of " + ", ".join(map(_described, signals[:9]))
            values[f"{table}.recorder"] = BLANK if len(recorders) > 1 else quoted(next(iter(recorders)))
    return with_notes(fill_in(text, values), notes)


def _recorders(tables: tuple[TableEntry, ...]) -> dict[str, Contents]:
    """Name in the shot file -> contents of each recording."""
    contents: dict[str, Contents] = {}
    for table in tables:
        name = re.sub(r"\W+", "_", table.path.stem).strip("_") or "scope"
        while name in contents:
            name += "_2"
        contents["scope" if len(tables) == 1 else name] = read_contents(table.path)
    return contents


def _recorder(name: str, contents: Contents) -> str:
    """A recorder's table, with its clock as a remark."""
    lines = [f"[recorders.{name}]", f"file = {quoted(contents.path.name)}"]
    try:
        clock = contents.channels[0].clock()
    except InputError as error:
        lines.append(f"# {error.message}")
        key, hint = "interval", 'from the recorder\'s settings, e.g. "80 ns"'
        if "has no unit" in error.message:
            key, hint = "time_unit", '"s", "ms", "us" or "ns"'
        lines.append(_aligned(f'{key} = ""', f"# {hint}"))
    else:
        last = clock.start + clock.interval * (contents.channels[0].samples - 1)
        span = f"{microseconds(clock.start)} to {microseconds(last)}"
        lines.append(f"# {span}, every {microseconds(clock.interval)}, on the file's clock: {clock.source}")
    if any(channel.unit is None for channel in contents.channels):
        lines.append(_aligned('unit = ""', '# the file does not state it: "V", "mV", "strain"'))
    hint = "# \"0 us\" where it is the shot's: clock = the file's time + this"
    lines.append(_aligned('clock_offset = ""', hint))
    return "\n".join(lines) + "\n\n"


def _described(signal: Signal) -> str:
    """A channel as text, with its recorder and the time of its onset."""
    recorder, channel = signal
    at = _leaves_rest(channel)
    when = "" if at is None else f", leaves its rest at about {microseconds(at)}"
    return f"{quoted(channel.name)} ({recorder}{when})"


def _chosen(table: str, channels: list[Signal], text: str) -> dict[str, str | None]:
    """Recorder and channels of one gauge and, for a file of strains, its calibration."""
    recorders = [recorder for recorder, _ in channels]
    one = quoted(recorders[0]) if len(set(recorders)) == 1 else f"[{', '.join(map(quoted, recorders))}]"
    values: dict[str, str | None] = {
        f"{table}.recorder": one,
        f"{table}.channels": f"[{', '.join(quoted(channel.name) for _, channel in channels)}]",
    }
    unit, _ = si_unit(channels[0][1].unit or "") or ("", 0.0)
    if unit == "1" and f"{table}.strain" in (key for _, key, _ in _keyed_lines(text)):
        values |= {f"{table}.strain_per_volt": None, f"{table}.strain": "true"}
    return values


def _leaves_rest(channel: Channel) -> float | None:
    """Time at which a signal leaves its rest level, on the file's clock [s]; None if unknown."""
    try:
        quiet, clock = quiet_stretch(channel.values(), fewest=FEWEST_SAMPLES), channel.clock()
    except InputError:
        return None
    return None if quiet is None else clock.start + clock.interval * quiet.count

"""The blank shot file of a test between bars, filled with what the recordings of its folder say."""

import re
from collections.abc import Mapping

import numpy as np

from kolsky.base.errors import InputError
from kolsky.readers.contents import Channel, Contents
from kolsky.readers.recordings import read_contents
from kolsky.readers.signalunits import si_unit
from kolsky.shot.found_table import FoundTable, quoted
from kolsky.shot.new_file import COLUMN, filled, microseconds, noted
from kolsky.shot.survey import Survey

_INCIDENT = re.compile(r"(?<![a-z])(inc|input|eingang|einfall|entr|in(?![a-z]))", re.IGNORECASE)
_TRANSMITTED = re.compile(r"(?<![a-z])(tra(?!in|ck|ce)|out|ausgang|sortie)", re.IGNORECASE)
SIDES = {"incident": _INCIDENT, "transmission": _TRANSMITTED}
"""How a word in the name of a bar's channel begins."""
REST = 0.05
"""Share of a record's beginning that is taken for rest, to say when a signal leaves it."""
LEAVES = 8.0
"""Standard deviations of the rest beyond which five samples in a row have left it."""

Signal = tuple[str, Channel]
"""Name of the recorder, and a channel of its file."""


def with_recordings(text: str, found: Survey) -> str:
    """The blank file with recorders, channels and, as remarks, what the recordings show.

    A channel is written where its name says its bar, else it stays blank and the channels are listed.

    Parameters
    ----------
    text
        The blank file.
    found
        What is in the folder.
    """
    recorders = _recorders(found.recordings)
    if not recorders:
        return text
    text = text.replace(_block(text), "".join(_recorder(n, c) for n, c in recorders.items()), 1)
    signals = [(name, channel) for name, contents in recorders.items() for channel in contents.channels]
    values: dict[str, str | None] = {}
    notes: dict[str, str] = {}
    for side, pattern in SIDES.items():
        table = f"gauges.{side}"
        own = [s for s in signals if pattern.search(s[1].name)]
        if not own:  # one file a bar, of which the files' names say which
            own = [s for s in signals if pattern.search(s[0])]
        if 1 <= len(own) <= 2:
            values |= _chosen(table, own, text)
            if (at := _leaves_rest(own[0][1])) is not None:
                notes[f"{table}.baseline"] = (
                    f"{own[0][1].name} leaves the level of its beginning at about {microseconds(at)} on the "
                    "file's clock"
                )
        else:
            notes[f"{table}.channels"] = "one of " + ", ".join(map(_described, signals[:9]))
            if len(recorders) > 1:
                values[f"{table}.recorder"] = '""'
            else:
                values[f"{table}.recorder"] = quoted(next(iter(recorders)))
    return noted(filled(text, values), notes)


def _recorders(tables: tuple[FoundTable, ...]) -> dict[str, Contents]:
    """Name in the shot file -> contents of each recording."""
    found: dict[str, Contents] = {}
    for table in tables:
        name = re.sub(r"\W+", "_", table.path.stem).strip("_") or "scope"
        while name in found:
            name += "_2"
        found["scope" if len(tables) == 1 else name] = read_contents(table.path)
    return found


def _block(text: str) -> str:
    """The lines of the recorder of the blank file, up to the gauges."""
    return text[text.index("[recorders.scope]") : text.index("[gauges.incident]")]


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
        lines.append(_blank(key, hint))
    else:
        last = clock.start + clock.interval * (contents.channels[0].samples - 1)
        span = f"{microseconds(clock.start)} to {microseconds(last)}"
        lines.append(f"# {span}, every {microseconds(clock.interval)}, on the file's clock: {clock.source}")
    if any(channel.unit is None for channel in contents.channels):
        lines.append(_blank("unit", 'the file does not say it: "V", "mV", "strain"'))
    lines.append(_blank("clock_offset", "\"0 us\" where it is the shot's: clock = the file's time + this"))
    return "\n".join(lines) + "\n\n"


def _blank(key: str, hint: str) -> str:
    """A line that is to be filled in."""
    head = f'{key} = ""'
    return f"{head:<{COLUMN - 1}} # {hint}"


def _described(signal: Signal) -> str:
    """A channel with its recorder and the time at which it leaves its rest."""
    recorder, channel = signal
    at = _leaves_rest(channel)
    when = "" if at is None else f", leaves its rest at about {microseconds(at)}"
    return f"{quoted(channel.name)} ({recorder}{when})"


def _chosen(table: str, own: list[Signal], text: str) -> dict[str, str | None]:
    """Recorder, channels and, of a file of strains, the calibration of one gauge."""
    recorders = [recorder for recorder, _ in own]
    one = quoted(recorders[0]) if len(set(recorders)) == 1 else f"[{', '.join(map(quoted, recorders))}]"
    values: dict[str, str | None] = {
        f"{table}.recorder": one,
        f"{table}.channels": f"[{', '.join(quoted(channel.name) for _, channel in own)}]",
    }
    known = si_unit(own[0][1].unit or "")
    if known is not None and known[0] == "1" and f"{table}.strain" in _keys(text):
        values |= {f"{table}.strain_per_volt": None, f"{table}.strain": "true"}
    return values


def _keys(text: str) -> Mapping[str, None]:
    """Dotted keys that have a line in the file, remarks included."""
    table, found = "", dict[str, None]()
    for line in text.split("\n"):
        if header := re.match(r"\[([\w.]+)\]", line):
            table = header.group(1)
        elif key := re.match(r"(?:# )?(\w+) = ", line):
            found[f"{table}.{key.group(1)}"] = None
    return found


def _leaves_rest(channel: Channel) -> float | None:
    """Time at which a signal leaves the level of its beginning [s], on the file's clock; None if unknown."""
    try:
        values, clock = channel.values(), channel.clock()
    except InputError:
        return None
    rest = values[: max(20, int(REST * values.size))]
    scatter = max(float(rest.std()), float(np.ptp(values)) * 1e-4)
    away = np.abs(values - rest.mean()) > LEAVES * scatter
    run = np.flatnonzero(np.convolve(away, np.ones(5), "valid") > 4.5)
    return clock.start + clock.interval * int(run[0]) if run.size else None

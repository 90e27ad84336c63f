"""`kolsky channels`: what is in a recorder's file and how it was understood."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import typer

from kolsky.base.errors import InputError, one_line
from kolsky.base.units import UnitError, quantity
from kolsky.cli.work import options
from kolsky.readers.contents import ChannelInfo, Layout
from kolsky.readers.recordings import list_channels


def show(file: Path, *, as_json: bool, interval: str | None = None, **said: Any) -> None:
    """Print the channels of a file, as a table or as one JSON object in SI units.

    Parameters
    ----------
    file
        The file.
    as_json
        Whether to print JSON.
    interval
        Time from sample to sample with its unit, e.g. "100 ns".
    said
        Other fields of `Layout`.

    Raises
    ------
    InputError
        If the file cannot be read, or the interval is no time.
    """
    try:
        seconds = None if interval is None else quantity(interval, "s")
    except UnitError as error:
        raise InputError(options.COMMAND_LINE, f"--interval: {error}") from None
    found = list_channels(file, layout=Layout(interval=seconds, **said))
    typer.echo(
        json.dumps(_as_json(file, found), indent=2, allow_nan=False) if as_json else _table(file, found)
    )


def _as_json(file: Path, found: list[ChannelInfo]) -> dict[str, Any]:
    first = asdict(found[0])
    return {
        "file": str(file),
        "found": first["facts"],
        "metadata": first["metadata"],
        "channels": [
            {key: value for key, value in asdict(channel).items() if key not in ("facts", "metadata")}
            for channel in found
        ],
    }


def _table(file: Path, found: list[ChannelInfo]) -> str:
    facts, metadata = found[0].facts, found[0].metadata
    lines = [str(file), *(f"  {key}: {value}" for key, value in facts.items()), ""]
    width = max(len(channel.name) for channel in found)
    for channel in found:
        unit = channel.unit or "unit not stated"
        lines.append(f"  {channel.number:>3}  {channel.name:<{width}}  {unit}  {channel.samples} samples")
    for words, clock in dict.fromkeys((c.time, (c.start, c.interval)) for c in found):
        start, interval = clock
        known = "" if interval is None else f"from {start:.9g} s every {interval:.9g} s: "
        lines += ["", f"  time: {known}{words}"]
    if metadata:
        lines += ["", *(f"  {key} = {value}" for key, value in metadata.items() if value)]
    return "\n".join(one_line(line) for line in lines)

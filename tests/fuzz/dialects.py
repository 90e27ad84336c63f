"""Text files of recorders in any dialect, each with its correct samples and clock.

`python -m tests.fuzz.dialects 10000 [SEED]` reads random files. It counts files that are read correctly,
rejected, or read wrongly without a message.
"""

import random
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.base.errors import InputError
from kolsky.readers.recordings import list_channels, read_recordings

DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "blanks": "  "}
RATES = {
    "Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9, "S/s": 1.0, "kS/s": 1e3, "MS/s": 1e6, "Sa/s": 1.0,
    "kSa/s": 1e3, "MSa/s": 1e6, "khz": 1e3, "KHz": 1e3, "samples/s": 1.0, "1/s": 1.0,
}  # fmt: skip
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "sec": 1.0, "msec": 1e-3, "usec": 1e-6}
RATE_NAMES = ("Sample rate", "Sampling Rate", "SampleRate", "fs", "Sampling Frequency", "Abtastrate")
INTERVAL_NAMES = ("dt", "Sample Interval", "Sampling interval", "Delta_X", "XINC", "Abtastintervall")
UNITS = {"V": ("V", 1.0), "mV": ("V", 1e-3), "N": ("N", 1.0), "kN": ("N", 1e3), "Volts": ("V", 1.0)}
CHANNELS = ("CH1", "CH2", "Force", "Kraft A", "Strain gauge 1", "Kanal 3")
REMARKS = ("gel A", "operator B", "shot 17, second try", "Probe: Gelatine 20 %", "temperature 21.5 C")
SETTINGS = ("Coupling", "Probe", "Bandwidth")
PERIODS = (1e-7, 2e-7, 2.5e-7, 5e-7, 1e-6, 1.25e-6, 2e-6, 4e-6, 1e-5, 2.5e-5, 1e-3)


@dataclass(frozen=True)
class Drawn:
    """A file and what it says."""

    data: bytes
    names: tuple[str, ...]
    units: tuple[tuple[str, float], ...]  # SI unit and factor of each channel
    values: np.ndarray  # as printed, shape [samples, channels]
    interval: float  # [s]
    start: float  # [s]
    dialect: str  # in words, for a message


def draw(rng: random.Random) -> Drawn:
    """A file of a drawn dialect."""
    delimiter = rng.choice(list(DELIMITERS))
    decimal = "," if delimiter != "comma" and rng.random() < 0.45 else "."
    count, samples = rng.choice((1, 1, 2, 3)), rng.choice((5, 12, 40, 150, 400))
    interval = rng.choice(PERIODS)
    clock = rng.choice(("column", "rate", "interval", "rate and column", "interval and column"))
    quoted_commas = delimiter == "comma" and rng.random() < 0.3  # "0,12","3,5"
    decimal = "," if quoted_commas else decimal
    timed = "column" in clock
    quotes = rng.choice(("none", "none", "names", "cells", "lines"))
    unit_place = rng.choice(("round", "square", "slash", "line", "line in round", "line in square"))
    if delimiter == "blanks":
        quotes, unit_place = "none", rng.choice(("slash", "line", "line in round"))
    if quoted_commas:
        quotes, count = "cells", max(count, 2)
    if quotes == "lines" and count + timed == 1:
        quotes = "none"
    names = tuple(rng.sample(CHANNELS, count))
    if delimiter == "blanks":
        names = tuple(name.replace(" ", "_") for name in names)
    units = tuple(rng.choice(list(UNITS)) for _ in names)
    time_unit = rng.choice(("s", "ms", "us"))
    start = rng.choice((0.0, 0.0, -100 * interval, 58.3)) if timed else 0.0
    figures = rng.choice((4, 6))
    t = np.arange(samples)
    values = np.array(
        [
            [
                float(f"{np.sin(0.3 * i + 0.7 * j) * 10 ** (j - 1) + 0.01 * j:.{figures}e}")
                for j in range(count)
            ]
            for i in t
        ]
    )
    fixed = rng.random() < 0.5
    if fixed:
        values = np.round(values, 5)

    def number(value: float, form: str) -> str:
        return format(value, form).replace(".", decimal)

    def cell(text: str, kind: str) -> str:
        return f'"{text}"' if quotes == "cells" or (quotes == "names" and kind == "name") else text

    join = DELIMITERS[delimiter].join
    factor = TIMES[time_unit]
    digits = 12 if start == 58.3 else 9
    rows = []
    for i in range(samples):
        time = [number((start + i * interval) / factor, f".{digits}e")] if timed else []
        rows.append(
            join(
                cell(text, "number")
                for text in [*time, *(number(v, ".5f" if fixed else f".{figures}e") for v in values[i])]
            )
        )
    shown = list(units)
    heads = [*(["Time"] if timed else []), *names]
    all_units = [*([time_unit] if timed else []), *shown]
    above = []
    if unit_place in ("round", "square", "slash"):
        form = {"round": "{} ({})", "square": "{} [{}]", "slash": "{}/{}"}[unit_place]
        above.append(join(cell(form.format(*pair), "name") for pair in zip(heads, all_units, strict=True)))
    else:
        form = {"line": "{}", "line in round": "({})", "line in square": "[{}]"}[unit_place]
        above.append(join(cell(head, "name") for head in heads))
        above.append(join(cell(form.format(unit), "name") for unit in all_units))
    sign = rng.choice(("", "# ", "% ", "// "))
    header = []
    for _ in range(rng.choice((0, 0, 1, 5, 30))):
        header.append(sign + rng.choice(REMARKS))
    if "rate" in clock:
        unit = rng.choice(list(RATES))
        header.insert(
            0,
            sign
            + _stated(rng, rng.choice(RATE_NAMES), 1.0 / interval / RATES[unit], unit, delimiter, decimal),
        )
    if "interval" in clock:
        unit = rng.choice(list(TIMES))
        header.insert(
            0,
            sign + _stated(rng, rng.choice(INTERVAL_NAMES), interval / TIMES[unit], unit, delimiter, decimal),
        )
    if rng.random() < 0.2:  # a second block, of settings by channel, between blank lines
        block = [join(("Setting", *names)), *(join((word, *("1" for _ in names))) for word in SETTINGS)]
        header += ["", *(sign + line for line in block), ""]
    if delimiter != "blanks" and quotes != "lines" and rng.random() < 0.15:  # a delimiter ends each line
        above, rows = (
            [f"{line}{DELIMITERS[delimiter]}" for line in above],
            [f"{line}{DELIMITERS[delimiter]}" for line in rows],
        )
    if delimiter in ("semicolon", "comma") and quotes == "none" and rng.random() < 0.15:  # and a blank
        rows = [line.replace(DELIMITERS[delimiter], f"{DELIMITERS[delimiter]} ") for line in rows]
    lines = [*header, *([""] if header and rng.random() < 0.3 else []), *above, *rows]
    if quotes == "lines":
        lines = [f'"{line}"' if line else line for line in lines]
    end = rng.choice(("\n", "\r\n", "\r"))
    encoding = rng.choice(("utf-8", "utf-8-sig", "utf-16", "cp1252"))
    text = end.join(lines) + rng.choice(("", end, end + end))
    said = f"{delimiter}, decimal {decimal}, quotes {quotes}, units {unit_place}, clock {clock}, {encoding}"
    return Drawn(text.encode(encoding), names, tuple(UNITS[u] for u in units), values, interval, start, said)


def _stated(rng: random.Random, key: str, value: float, unit: str, delimiter: str, decimal: str) -> str:
    """A line of the header: the unit behind the number, in the key's bracket, or in a column of its own."""
    text = f"{value:.10g}".replace(".", decimal)
    column = DELIMITERS[delimiter] if delimiter != "blanks" else "\t"
    return rng.choice(
        (
            f"{key}: {text} {unit}", f"{key}: {text}{unit}", f"{key} = {text} {unit}",
            f"{key} [{unit}]: {text}", f"{key} ({unit}) = {text}", f"{key}{column}{text}{column}{unit}",
            f"{key} ({unit}){column}{text}",
        )
    )  # fmt: skip


def difference(drawn: Drawn, path: Path) -> str:
    """What was read wrongly; empty if everything is right.

    Raises InputError if the file was refused.
    """
    path.write_bytes(drawn.data)
    channels = list_channels(path)
    if len(channels) != len(drawn.names):
        return f"channels {[c.name for c in channels]}"
    read = read_recordings(path, [str(channel.number) for channel in channels])
    for j, (recording, (unit, factor)) in enumerate(zip(read.values(), drawn.units, strict=True)):
        if recording.unit != unit:
            return f"unit {recording.unit} for {unit}"
        if not np.allclose(recording.value, drawn.values[:, j] * factor, rtol=1e-12, atol=0.0):
            return f"values of {recording.channel}"
        times = drawn.start + drawn.interval * np.arange(len(drawn.values))
        if np.abs(recording.time - times).max() > 1e-3 * drawn.interval:
            return f"times {recording.time[:2]} for {times[:2]}"
    return ""


def study(
    files: int, seed: int, folder: Path
) -> tuple[Counter[str], list[tuple[int, str, str]], Counter[str]]:
    """Counts of right, refused and wrong files; the wrong ones; the reasons of refusals."""
    counts: Counter[str] = Counter()
    wrong: list[tuple[int, str, str]] = []
    reasons: Counter[str] = Counter()
    for number in range(files):
        drawn = draw(random.Random(seed * 1_000_003 + number))
        try:
            problem = difference(drawn, folder / "file.csv")
        except InputError as error:
            counts["refused"] += 1
            reasons[f"{error.message[:70]} | {drawn.dialect}"] += 1
            continue
        counts["wrong" if problem else "right"] += 1
        if problem:
            wrong.append((number, problem, drawn.dialect))
    return counts, wrong, reasons


def main(words: list[str]) -> int:
    """Read drawn files; exit code 1 if one was read wrongly."""
    files, seed = int(words[0]), int(words[1]) if len(words) > 1 else 1
    with tempfile.TemporaryDirectory() as folder:
        counts, wrong, reasons = study(files, seed, Path(folder))
    print(dict(counts))
    for number, problem, dialect in wrong[:20]:
        print(f"file {number}: {problem}; {dialect}")
    for reason, count in reasons.most_common(20):
        print(f"{count:5d} {reason}")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

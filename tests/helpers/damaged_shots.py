"""Copies of open-01 with one damage each, and the text that the message must contain."""

from collections.abc import Callable
from pathlib import Path

Mutation = Callable[[Path], object]

# Mutations: each returns a function that damages a copy of open-01.


def toml(old: str, new: str, times: int = 1) -> Mutation:
    def mutate(folder: Path) -> None:
        path = folder / "shot.toml"
        assert path.read_text().count(old) == times, f"{old!r} stands {path.read_text().count(old)} times"
        path.write_text(path.read_text().replace(old, new))

    return mutate


def line(name: str, number: int, new: str) -> Mutation:
    """Replace one line, counted from 1."""

    def mutate(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        lines[number - 1] = new
        (folder / name).write_text("\n".join(lines) + "\n")

    return mutate


def lines(name: str, change: Callable[[list[str]], list[str]]) -> Mutation:
    """Change the list of all lines, header first."""

    def mutate(folder: Path) -> None:
        (folder / name).write_text("\n".join(change((folder / name).read_text().splitlines())) + "\n")

    return mutate


def fields(name: str, change: Callable[[list[str]], list[str]]) -> Mutation:
    """Change the fields of every data line."""
    return lines(name, lambda all_: [all_[0], *(",".join(change(row.split(","))) for row in all_[1:])])


def both(*mutations: Mutation) -> Mutation:
    def mutate(folder: Path) -> None:
        for mutation in mutations:
            mutation(folder)

    return mutate


def number(text: str, factor: float = 1.0, shift: float = 0.0) -> str:
    return repr(float(text) * factor + shift)


def sparse(name: str) -> Mutation:
    def mutate(folder: Path) -> None:
        with (folder / name).open("wb") as file:
            file.truncate(2_000_000_000)

    return mutate


def insert_blank(all_: list[str]) -> list[str]:
    return [*all_[:9], "", *all_[9:]]


def repeat_line(all_: list[str]) -> list[str]:
    return [*all_[:100], all_[99], *all_[100:]]


def swap_lines(all_: list[str]) -> list[str]:
    return [*all_[:99], all_[100], all_[99], *all_[101:]]


def latin1(folder: Path) -> None:
    path = folder / "flyer.csv"
    path.write_bytes(path.read_bytes() + "186,1.4875e-03,3.59 µm\n".encode("latin-1"))


def clip(rows: list[str]) -> list[str]:
    """A 1 V recorder that saw 60 times the force: the top of the pulse is flat."""
    clipped = [rows[0]]
    for row in rows[1:]:
        t, a, b = row.split(",")
        clipped.append(f"{t},{a},{max(-1.0, min(float(b) * 60, 0.999512)):.6f}")
    return clipped


def replaced_by_folder(folder: Path) -> None:
    (folder / "frames.csv").unlink()
    (folder / "frames.csv").mkdir()


BAD: dict[str, tuple[Mutation, list[str]]] = {
    # files
    "missing file": (lambda f: (f / "flyer.csv").unlink(),
     ['flyer.file = "flyer.csv" names a missing file', "flyer.csv. Cure"]),
    "folder for a file": (replaced_by_folder, ["frames.csv: is a folder"]),
    "no shot.toml": (lambda f: (f / "shot.toml").unlink(), ["has no shot.toml", "`kolsky new "]),
    "empty folder": (lambda f: [p.unlink() for p in f.iterdir()], ["has no shot.toml", "`kolsky new "]),
    "empty file": (lambda f: (f / "scope.csv").write_text(""), ["scope.csv: is empty"]),
    "header only": (lines("scope.csv", lambda a: a[:1]), ["scope.csv: has a header but no data"]),
    "two gigabytes": (sparse("scope.csv"), ["scope.csv: has 2000 MB, more than the 200 MB"]),
    "two gigabytes of toml": (sparse("shot.toml"), ["shot.toml: has 2000 MB"]),
    # Another code page is detected and read, but the text after the number is no valid unit.
    "not UTF-8": (latin1, ["flyer.csv line 188", "is not a number: '3.59 µm'",
     "export numbers without a unit behind them"]),
    "not UTF-8 toml": (lambda f: (f / "shot.toml").write_bytes("format = 1 # Ø\n".encode("latin-1")),
     ["shot.toml line 1: is not UTF-8 text: byte 0xd8 at byte offset 13"]),
    # text
    "not a number": (line("scope.csv", 412, "5.0e-06,0.0,1.2.3"),
     ["scope.csv line 412: column 'CH2 transmitted (V)' is not a number: '1.2.3'"]),
    "nan": (line("scope.csv", 412, "4.5e-06,0.0,nan"), ["scope.csv line 412", "not a finite number: 'nan'"]),
    "inf": (line("flyer.csv", 20, "18,8.75e-05,inf"), ["flyer.csv line 20", "not a finite number: 'inf'"]),
    "fields": (line("flyer.csv", 20, "18,8.75e-05"), ["flyer.csv line 20: has 2 fields, the header has 3"]),
    "blank line": (lines("scope.csv", insert_blank), ["scope.csv line 10: is an empty line"]),
    "missing column": (line("scope.csv", 1, "Time (s),CH1 incident (V),CH3 (V)"),
     ["'CH2 transmitted (V)' is missing; the columns are 'Time (s)', 'CH1 incident (V)', 'CH3 (V)'"]),
    # order
    "repeated time": (lines("scope.csv", repeat_line), ["scope.csv line 101", "repeats"]),
    "unsorted times": (lines("scope.csv", swap_lines), ["scope.csv line 101", "is not sorted"]),
    "repeated frame": (lines("frames.csv", repeat_line),
     ["frames.csv line 101: column 'frame' repeats '98'"]),
    "unsorted frames": (lines("flyer.csv", swap_lines), ["flyer.csv line 101: column 'frame' is not sorted"]),
    "unsorted points": (lines("centreline.csv", lambda a: [a[0], a[-1], *a[1:-1]]),
     ["centreline.csv line 3: column 'frame' is not sorted: 0 after 185"]),
    "gap in the record": (lines("scope.csv", lambda a: [*a[:500], *a[520:]]),
     ["scope.csv line 501", "the step is 1.05e-05 s where the others are 5e-07 s"]),
    "times rounded too far": (lines("scope.csv",
     lambda a: [a[0], *(f"{k * 1.3e-6 - 2e-4:.6f},0,{k % 3}e-3" for k in range(1300))]),
     ["is rounded to 1e-06 s: steps between 1e-06 and 2e-06 s"]),
    # swapped columns
    "swapped scope columns": (fields("scope.csv", lambda r: [r[2], r[1], r[0]]),
     ["scope.csv line 4: column 'Time (s)'", "are two columns swapped?"]),
    "swapped scope declarations": (both(toml('time = { column = "Time (s)"', 'time = { column = "x"'),
     toml('voltage = { column = "CH2 transmitted (V)"', 'voltage = { column = "Time (s)"'),
     toml('{ column = "x"', '{ column = "CH2 transmitted (V)"')),
     ["column 'CH2 transmitted (V)'", "are two columns swapped?"]),
    "swapped frame columns": (fields("frames.csv", lambda r: [r[1], r[0]]),
     ["frames.csv line 2: column 'frame' is not a frame number", "are two columns swapped?"]),
    "swapped flyer columns": (fields("flyer.csv", lambda r: [r[0], r[2], r[1]]),
     ["flyer.csv line 2: frame 0 has the time -0.00078 s", "are two columns swapped?"]),
    "flyer displacement is no displacement": (
        toml('displacement = { column = "flyer displacement toward the specimen (mm)"',
         'displacement = { column = "frame"'),
        ["flyer.displacement reaches 17", "exceeds the specimen's length (6.5 mm", "right column?"],
    ),
    "swapped outline columns": (fields("centreline.csv", lambda r: [r[0], r[1], r[3], r[2], r[4]]),
     ["centreline.csv", "are y and Z swapped?"]),
    "swapped curve columns": (fields("quasi_static.csv", lambda r: [r[1], r[0]]),
     ["quasi_static.csv line 3: the strain -745.98 is not a strain", "right column"]),
    # contradictions between declarations and recordings
    "clipping": (lines("scope.csv", clip), ["scope.csv line", "'CH2 transmitted (V)' is clipped: ",
     "samples at or beyond full scale", "= 1 V)"]),
    "volts beyond full scale": (line("scope.csv", 3342, "1.4700000e-03,0.0,1.2"),
     ["scope.csv line 3342", "clipped: 1.2 V in the first of 1 samples"]),
    "frames beyond the flyer record": (lines("flyer.csv", lambda a: a[:100]),
     ["frames.csv line 101: frame 99 is beyond the flyer record, which ends with frame 98", "window.end"]),
    "flyer frame missing": (lines("flyer.csv", lambda a: [*a[:50], *a[51:]]),
     ["frames.csv line 51: frame 49 has no displacement in flyer.csv"]),
    "flyer frames not in the frames": (lines("frames.csv", lambda a: a[:150]),
     ["flyer.csv line 151: frame 149 is not in frames.csv (37 such lines)"]),
    "frames beyond the scope record": (lines("scope.csv", lambda a: a[:2000]),
     ["scope.csv", "camera frames are beyond the scope record, which spans -200 us to 799 us"]),
    "scope starts late": (both(lines("scope.csv", lambda a: [a[0], *a[302:]]),
     toml('["-200 us", "0 us"]', '["-50 us", "0 us"]'), toml('# start = "0 us"', 'start = "-60 us"')),
     ["scope.csv: begins at -49.5 us, after the window's start at -60 us", "clock_offset"]),
    "other clock": (lines("shot.toml", lambda a: ([row.replace('clock_offset = "0 us"',
     'clock_offset = "2 ms"', 1) for row in a[:40]] + a[40:])), ["force.baseline", "holds 0 samples"]),
    "times of another test": (fields("flyer.csv", lambda r: [r[0], number(r[1], shift=1e-3), r[2]]),
     ["flyer.csv line 2: frame 0 has the time", "in frames.csv it has -6.25e-05 s (186 such lines)"]),
    "outline times of another test": (fields("centreline.csv", lambda r: [r[0], number(r[1], 1.001), *r[2:]]),
     ["centreline.csv line 2: frame 0 has the time"]),
    "flyer the other way": (fields("flyer.csv", lambda r: [r[0], r[1], number(r[2], -1.0)]),
     ['flyer.positive = "toward specimen" contradicts flyer.csv', "moves away from the specimen"]),
    "flyer at rest": (fields("flyer.csv", lambda r: [r[0], r[1], "0.0"]),
     ["flyer.csv: the flyer never moves"]),
    "static frames that move": (toml("static = 12", "static = 20"),
     ["flyer.csv line", "frames declared static", "lower frames.static"]),
    "more static frames than frames": (toml("static = 12", "static = 186"),
     ["frames.static = 186", "186 frames"]),
    "force the other way": (toml('compression = "positive"', 'compression = "negative"'),
     ['force.compression = "negative" contradicts the recording', "the specimen pulls"]),
    "short baseline": (toml('["-200 us", "0 us"]', '["-5 us", "0 us"]'),
     ['force.baseline = ["-5 us", "0 us"] holds 10 samples', "at least 20 samples"]),
    "baseline in the motion": (toml('["-200 us", "0 us"]', '["-200 us", "60 us"]'),
     ["force.baseline", "overlaps the flyer's motion", "before the last static frame at 29.1666"]),
    "dead channel": (fields("scope.csv", lambda r: [r[0], r[1], "0.0"]),
     ["force.baseline", "holds the same value 0 V 400 times"]),
    "window beyond the record": (toml('# end = "1.4 ms"', 'end = "1.5 ms"'),
     ['window.end = "1.5 ms" is not allowed', "at most 1470 us"]),
    "window from the motion": (toml('# start = "0 us"', 'start = "100 us"'),
     ['window.start = "100 us" is not allowed', "starts from rest"]),
    # outline
    "Z behind the axis": (toml('Z_offset = "0 mm"', 'Z_offset = "-5 mm"'),
     ["centre_line (centreline.csv): Z from the axis is -0.2", 'centre_line.Z_offset = "0 mm" would fit']),
    "y outside": (toml('y_offset = "0 mm"', 'y_offset = "3 mm"'),
     ["centreline.csv line", "y above the transmission platen is", "in [-0.65, 7.15] mm"]),
    "outline of another specimen": (toml('diameter = "9.5 mm"', 'diameter = "19 mm"'),
     ["(centreline.csv): Z from the axis is 4.75", "the radius 9.5 mm; they must agree within 20 %"]),
    # curve
    "curve of the wrong sign": (fields("quasi_static.csv",
     lambda r: [number(r[0], -1.0), number(r[1], -1.0)]),
     ["quasi_static.csv line 3: the strain is in tension (+0.01", 'curve.branch is "compression"']),
    "curve of the wrong convention": (toml('convention = "tension positive"',
     'convention = "compression positive"'), ["the strain is in tension",
     'curve.convention "compression positive"']),
    "stress against strain": (fields("quasi_static.csv", lambda r: [r[0], number(r[1], -1.0)]),
     ["quasi_static.csv line 3: the stress +745.98 Pa has the opposite sign of the strain"]),
    "no length left": (fields("quasi_static.csv", lambda r: [number(r[0], 2.0), r[1]]),
     ["quasi_static.csv line 52: the strain -1 would leave no length"]),
    "curve with unloading": (lines("quasi_static.csv", lambda a: [*a[:40], a[41], a[40], *a[42:]]),
     ["quasi_static.csv line 42: the strain does not move on"]),
    "preload": (line("quasi_static.csv", 2, "0.00000,-1.0e+02"),
     ["quasi_static.csv line 2: the stress is -100 Pa at zero strain"]),
    "short curve": (lines("quasi_static.csv", lambda a: a[:4]), ["has 2 points away from rest"]),
    # declarations; tests/unit/shot/test_shotfile.py tests the others
    "Poisson's ratio": (toml("poisson = 0.499 ", "poisson = 0.5 "),
     ["model.poisson = 0.5", "in [0, 0.49999]", "0.499", '"incompressible"']),
    "negative density": (toml('density = "870 kg/m^3"\n\n', 'density = "-870 kg/m^3"\n\n'),
     ["shot.toml line",
     'specimen.density = "-870 kg/m^3" is not allowed; it must be > 0 kg/m^3. Cure: write']),
    "wrong dimension": (toml('length = "6.5 mm"', 'length = "6.5 kg"'),
     ["specimen.length", "must be a length"]),
    "unknown key": (toml("static = 12", "statics = 12"), ["frames.statics", "did you mean static?"]),
}  # fmt: skip

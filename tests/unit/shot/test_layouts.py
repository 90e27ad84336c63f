"""Tables of a shot in other dialects, and wrong files for a command."""

import re
import shutil
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from kolsky_command import run_kolsky
from typer.testing import CliRunner

from kolsky.base.errors import InputError
from kolsky.cli import app
from kolsky.schema.shot_file import shot_toml
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot

# Every CSV of a shot in the dialect of another program: semicolons, decimal commas, cp1252, lines above.

OPEN_01 = Path(__file__).resolve().parents[3] / "runs" / "open-01"
FILES = {
    "force": "scope.csv",
    "frames": "frames.csv",
    "flyer": "flyer.csv",
    "centre_line": "centreline.csv",
    "curve": "quasi_static.csv",
}
ABOVE = ["Prüfer;Müller", "Temperatur;21,5 °C", ""]
LAYOUT = 'layout = { delimiter = ";", decimal = ",", encoding = "cp1252", header_line = 4 }'
PLAIN = 'layout = { delimiter = ",", header_line = 1 }'


def foreign(text: str) -> bytes:
    """A table of commas and points as a German program writes it, units below the names, CR LF."""
    names, *rows = text.splitlines()
    lines = [*ABOVE, names.replace(",", ";"), *(row.replace(",", ";").replace(".", ",") for row in rows)]
    return ("\r\n".join(lines) + "\r\n").encode("cp1252")


def with_layouts(folder: Path, layout: str, tables: tuple[str, ...] = tuple(FILES)) -> Path:
    """A copy of open-01 whose shot file says the layout of some tables."""
    shutil.copytree(OPEN_01, folder, ignore=shutil.ignore_patterns("results"))
    path = folder / "shot.toml"
    text = path.read_text("utf-8")
    for table in tables:
        said = f"[{table}]"
        at = text.index('file = "', text.index(f"\n{said}"))
        text = f"{text[:at]}{layout}\n{text[at:]}"
    path.write_text(text, "utf-8")
    return folder


@pytest.fixture(scope="module")
def german(tmp_path_factory) -> Path:
    folder = with_layouts(tmp_path_factory.mktemp("shots") / "open-01", LAYOUT)
    for name in FILES.values():
        (folder / name).write_bytes(foreign((OPEN_01 / name).read_text("utf-8")))
    return folder


def arrays(record: object) -> dict[str, np.ndarray]:
    return {f.name: v for f in fields(record) if isinstance(v := getattr(record, f.name), np.ndarray)}


def assert_same_bits(one: object, other: object) -> None:
    a, b = arrays(one), arrays(other)
    assert a.keys() == b.keys()
    assert a
    for name in a:
        np.testing.assert_array_equal(a[name], b[name])


def test_the_same_shot_bit_for_bit(german: Path, tmp_path: Path) -> None:
    """Frames, flyer, outline and curve as without layouts; the force as by a layout of the plain file."""
    plain, found = load_shot(OPEN_01), load_shot(german)
    for part in ("flyer", "centre_line", "curve"):
        assert_same_bits(getattr(found, part), getattr(plain, part))
    assert found.window == plain.window
    assert (found.specimen, found.interface, found.model) == (plain.specimen, plain.interface, plain.model)
    stated = load_shot(with_layouts(tmp_path / "open-01", PLAIN, ("force",)))
    assert_same_bits(found.force.recording, stated.force.recording)
    assert_same_bits(found.force.history(), stated.force.history())


def test_times_of_a_layout_are_those_printed(german: Path) -> None:
    """[force] alone has a clock with a layout, start + i times the interval: the volts are the same, the
    times within the rounding of one product."""
    plain, found = load_shot(OPEN_01).force.recording, load_shot(german).force.recording
    np.testing.assert_array_equal(found.value, plain.value)
    np.testing.assert_allclose(found.time, plain.time, rtol=0.0, atol=1e-17)


def test_a_layout_that_says_what_is_so_anyway_changes_nothing(tmp_path: Path) -> None:
    tables = tuple(name for name in FILES if name != "force")
    plain, found = load_shot(OPEN_01), load_shot(with_layouts(tmp_path / "open-01", PLAIN, tables))
    for part in ("flyer", "centre_line", "curve"):
        assert_same_bits(getattr(found, part), getattr(plain, part))


DAMAGE = {
    "no number": ("flyer.csv", 20, "x", ["flyer.csv line 20: column 'flyer disp", "is not a number: 'x'"]),
    "a point": ("flyer.csv", 20, "1.5", ["flyer.csv line 20", "is not a number: '1.5'"]),
    "a field more": ("frames.csv", 9, "1;2;3", ["frames.csv line 9: has 3 fields, the header has 2"]),
    "an empty line": ("centreline.csv", 30, "", ["centreline.csv line 30: is an empty line"]),
    "not finite": ("quasi_static.csv", 12, "-0,08;nan", ["quasi_static.csv line 12", "not a finite number"]),
    "another sign": ("quasi_static.csv", 12, "0,08;-1", ["quasi_static.csv line 12", "strain is in tension"]),
    "no frame": ("centreline.csv", 30, "0,5;0;1;4;0,1", ["line 30", "'frame' is not a frame number: '0.5'"]),
    "an unknown frame": (
        "centreline.csv", 5, "-9;-6,25e-05;1;4;0,1", ["centreline.csv line 5: frame -9 is not in frames.csv"]
    ),
    "a negative radius": (
        "centreline.csv", 5, "0;-6,25000000e-05;1;-4;0,1", ["centreline.csv line 5: Z from the axis is -4 mm"]
    ),
    "a displacement at rest": (
        "flyer.csv", 8, "3;-3,75000000e-05;0,01", ["flyer.csv line 8: frame 3 is", "declared static"]
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", DAMAGE)
def test_damage_is_named_by_the_line_of_the_file(case: str, german: Path, tmp_path: Path) -> None:
    name, line, new, fragments = DAMAGE[case]
    folder = Path(shutil.copytree(german, tmp_path / "open-01"))
    lines = (folder / name).read_bytes().decode("cp1252").split("\r\n")
    old = lines[line - 1]
    lines[line - 1] = new if ";" in new or not new else ";".join([*old.split(";")[:-1], new])
    (folder / name).write_bytes("\r\n".join(lines).encode("cp1252"))
    with pytest.raises(InputError) as caught:
        load_shot(folder)
    assert "\n" not in str(caught.value)
    for fragment in fragments:
        assert fragment in str(caught.value)


@pytest.mark.parametrize(
    ("layout", "fragments"),
    [
        ('{ delimiter = "," , decimal = "," }', ["is declared to have ',' as delimiter and as decimal sign"]),
        ('{ delimiter = "x" }', ["is declared to have the delimiter 'x'", '"semicolon"']),
        ('{ decimal = ";" }', ["is declared to have the decimal ';'"]),
        ('{ encoding = "klingon" }', ["is declared to be encoded as 'klingon'"]),
        ("{ header_line = 900000 }", ["header_line = 900000", "the file's lines"]),
        ("{ header_line = 3, first_line = 2 }", ["first_line = 2", "below the header in line 3"]),
        ('{ delimiter = ";" }', ["'frame' is missing", "separated by semicolons"]),
        ('{ sheet = "A" }', ["is declared with the sheet 'A'", "it is text"]),
    ],
)
def test_a_layout_that_does_not_fit_is_refused(layout: str, fragments: list[str], tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        load_shot(with_layouts(tmp_path / "open-01", f"layout = {layout}", ("frames",)))
    for fragment in fragments:
        assert fragment in str(caught.value)


@pytest.mark.parametrize(
    ("delimiter", "layout"),
    [("\t", 'delimiter = "tab"'), (" ", 'delimiter = "blanks"'), (";", 'delimiter = ";"')],
)
def test_delimiters_a_file_without_header_and_comments(delimiter: str, layout: str, tmp_path: Path) -> None:
    text = (OPEN_01 / "frames.csv").read_text("utf-8")
    rows = [row.replace(",", delimiter) for row in text.splitlines()[1:]]
    bare = with_layouts(tmp_path / "bare", f"layout = {{ {layout}, header_line = 0 }}", ("frames",))
    shot = bare / "shot.toml"
    start = shot.read_text("utf-8").index("[frames]")
    said = shot.read_text("utf-8")
    said = said[:start] + said[start:].replace('"frame"', '"1"', 1).replace('"time (s)"', '"2"', 1)
    shot.write_text(said, "utf-8")
    (bare / "frames.csv").write_text("\n".join(rows) + "\n", "utf-8")
    commented = with_layouts(
        tmp_path / "commented",
        f'layout = {{ {layout}, comment = "#", header_line = 2, units_line = 3 }}',
        ("frames",),
    )
    shot = commented / "shot.toml"
    shot.write_text(
        shot.read_text("utf-8").replace('time = { column = "time (s)"', 'time = { column = "time"', 1)
    )
    heading = ["# made by hand", f"# frame{delimiter}time", f"# -{delimiter}s"]
    (commented / "frames.csv").write_text("\n".join([*heading, *rows]) + "\n", "utf-8")
    plain: Shot = load_shot(OPEN_01)
    for folder in (bare, commented):
        assert_same_bits(load_shot(folder).flyer, plain.flyer)


def test_every_table_of_a_shot_takes_a_layout() -> None:
    """By the schema itself: whatever names a file of text has the key `layout`."""
    declared = shot_toml(OPEN_01).declared
    named = {key.split(".")[0] for key in declared.data_files()}
    assert named == set(FILES)
    for table in named:
        assert "layout" in type(getattr(declared, table)).model_fields


# A wrong file for a command: exit code 2, a line with file and cure, no output.

WRONG_FILES_FILES = {
    "words.csv": b"strain,stress\n1,2\n2,3\n3,4\n4,banana\n",
    "noise.csv": bytes([*range(128, 256), 0]) * 8,
    "empty.csv": b"",
    "shot/shot.toml": b"[specimen\n",
    "points.csv": b"stiffness_factor (1)\n1.0\nbanana\n",
}
SHOTS = {
    "words.csv": "words.csv line 1: .*'strain,stress'. Cure: give the folder of a shot",
    "noise.csv": "noise.csv line 1: is not UTF-8 text: byte 0x80.* Cure: ",
    "shot": "shot.toml line 1: .*'.specimen'. Cure: ",
    "absent": "absent: there is no such f.*Cure: ",
}
"""Given in place of a shot -> what must be said."""
TABLES = {
    "words.csv": "words.csv line 5: .*'banana'.*Cure: is it the right file",
    "noise.csv": "noise.csv: is of no known format. Cure: is it the right file",
    "empty.csv": "empty.csv: is empty. Cure: ",
    "absent.csv": "absent.csv: there is no such file. Cure: ",
}
"""Given in place of a table of numbers."""
DESIGNS = {
    "points.csv": "points.csv line 3: column 'stiffness_factor \\(1\\)' is not a number: 'banana'.*Cure: ",
    "noise.csv": "noise.csv line 1: is not UTF-8 text: byte 0x80.*Cure: ",
    "absent.csv": "absent.csv: there is no such file. Cure: ",
}
"""Given in place of a design."""
OF_SHOTS = (
    *("check", "waves", "wavespeed", "repeats", "identify", "simulate", "report", "film", "plan", "sweep"),
    *("dic", "rate", "calibrate"),
)
OF_TABLES = {
    "channels": "channels {f}",
    "fit": "material fit uniaxial:{f} --convention tension-positive --out out",
    "baseline": "material reference-curve {f} --convention tension-positive --branch tension --strain strain "
    "--stress stress --out curve.csv",
}
CASES = {
    **{f"{c}-{f}": (f"{c} {f}", said) for c in OF_SHOTS for f, said in SHOTS.items()},
    **{f"{n}-{f}": (c.format(f=f), said) for n, c in OF_TABLES.items() for f, said in TABLES.items()},
    **{f"sweep-{f}": (f"sweep shot --design csv --points {f}", said) for f, said in DESIGNS.items()},
    # It has two names of files, so no folder is asked for.
    "calibrate-absent": ("calibrate absent", "absent: there is no such file. Cure: "),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with every wrong file, the current one."""
    for name, content in WRONG_FILES_FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_file_is_refused_with_its_name_and_a_cure(case: str, folder: Path) -> None:
    command, said = CASES[case]
    there = sorted(folder.rglob("*"))
    words = command.split()
    done = CliRunner().invoke(app, [*words, words[1]] if words[0] == "repeats" else words)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert re.search(said, done.stderr), done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sorted(folder.rglob("*")) == there


def test_a_fit_without_columns_is_told_what_the_file_has(folder: Path) -> None:
    (folder / "good.csv").write_text("step,stress (kPa)\n0,0\n0.1,10\n0.2,18\n0.3,24\n0.4,29\n0.5,33\n")
    done = run_kolsky("material", "fit", "good.csv", "--convention", "tension-positive", code=2)
    assert re.search(r"good.csv: .*has the columns of numbers .*stress.*Cure: .*--stress COLUMN", done.stderr)

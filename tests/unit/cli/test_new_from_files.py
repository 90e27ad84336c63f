"""`kolsky new` writes facts of unknown files and leaves others blank; no command accepts a blank."""

import csv
import os
import re
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest
from kolsky_command import run_kolsky
from shot_folders import FILES, OPEN_01
from typer.testing import CliRunner

from kolsky.base.errors import InputError
from kolsky.base.toml import blanks
from kolsky.base.units import dimension_of
from kolsky.cli import app
from kolsky.readers.header import likely_unit
from kolsky.shot.load import load_shot
from kolsky.shot.records import ForceChannel
from kolsky.survey.blank_file import template
from kolsky.survey.new_file import fill_in, with_notes
from kolsky.survey.tables import survey

runner = CliRunner()
GERMAN = {
    "scope.csv": ("Oszi Versuch 7.csv", ["Zeit (s)", "Kanal 1 Eingang (V)", "Kanal 2 Ausgang (V)"]),
    "frames.csv": ("Bildzeiten.csv", ["Bildnummer", "Zeit (s)"]),
    "flyer.csv": ("Stoessel.csv", ["Bildnummer", "Zeit (s)", "Weg des Stößels zur Probe (mm)"]),
    "centreline.csv": ("Kontur.csv", ["Bildnummer", "Zeit (s)", "Y (mm)", "Z (mm)", "Unsicherheit Z (mm)"]),
    "quasi_static.csv": ("Druckversuch.csv", ["Nenndehnung (-)", "Nennspannung (Pa)"]),
}
FACTS = {
    "specimen.diameter": '"9.5 mm"', "specimen.length": '"6.5 mm"', "specimen.density": '"870 kg/m^3"',
    "interface.faces": '"bonded"', "interface.side": '"bonded"', "transmission.support": '"rigid"',
    "force.sensitivity": '"0.0112 V/N"', "frames.clock_offset": '"0 us"', "centre_line.y_offset": '"0 mm"',
    "centre_line.Z_offset": '"0 mm"', "model.poisson": "0.499", "model.damping": '"25 us"',
}  # fmt: skip
"""What no file of the shot shows: twelve values."""
READ = {
    "force.full_scale": '"1 V"',
    "force.baseline": '["-200 us", "0 us"]',
    "frames.static": "12",
    "flyer.sigma": '"1 um"',
    "curve.relative_sigma": '"0.2 %"',
}
"""What `kolsky new` reads from the numbers, as open-01 declares it."""


def german(folder: Path) -> Path:
    """Open-01 as a German spreadsheet exports it: semicolons, decimal commas, cp1252, other names."""
    folder.mkdir()
    for name, (other, header) in GERMAN.items():
        with (OPEN_01 / name).open(encoding="utf-8") as file:
            rows = list(csv.reader(file))[1:]
        lines = [header, *([cell.replace(".", ",") for cell in row] for row in rows)]
        (folder / other).write_bytes("\r\n".join(";".join(line) for line in lines).encode("cp1252"))
    return folder


def new(folder: Path, *options: str) -> str:
    run_kolsky("new", *options, folder)
    return (folder / "shot.toml").read_text(encoding="utf-8")


def test_a_german_folder_needs_its_facts_and_nothing_else(tmp_path: Path) -> None:
    folder = german(tmp_path / "shot")
    text = new(folder)
    assert set(blanks(tomllib.loads(text))) == set(FACTS)
    declared = tomllib.loads(text)
    assert "layout" not in declared["force"] | declared["flyer"]  # it is detected at every reading
    assert declared["force"]["voltage"] == {"column": "Kanal 2 Ausgang (V)", "unit": "V"}
    assert "# Oszi Versuch 7.csv: -200 us to 1470 us, every 0.5 us, on the file's clock" in text
    assert "# Stoessel.csv: the first clear motion is in frame 14; a tenth of the frames before" in text
    # What the numbers show, against what open-01 declares: signs alike, sizes of the same kind.
    assert declared["force"]["compression"] == "positive"
    assert declared["force"]["full_scale"] == "0.5 V"
    assert declared["flyer"]["positive"] == "toward specimen"
    assert (declared["curve"]["convention"], declared["curve"]["branch"]) == (
        "tension positive", "compression",
    )  # fmt: skip
    assert declared["frames"]["static"] == 12
    assert 0.5 <= float(declared["flyer"]["sigma"].removesuffix(" um")) <= 1.1
    assert 0.15 <= float(declared["curve"]["relative_sigma"].removesuffix(" %")) <= 0.25
    assert len(FACTS) <= 12
    (folder / "shot.toml").write_text(fill_in(text, FACTS), encoding="utf-8")
    assert runner.invoke(app, ["check", str(folder)]).exit_code == 0
    (folder / "shot.toml").write_text(fill_in(text, {**FACTS, **READ}), encoding="utf-8")
    # It is the very shot of the English files.
    ours, theirs = load_shot(folder), load_shot(OPEN_01)
    assert (ours.centre_line.Z == theirs.centre_line.Z).all()
    assert isinstance(ours.force, ForceChannel)
    assert isinstance(theirs.force, ForceChannel)
    assert (ours.force.recording.value == theirs.force.recording.value).all()
    assert (ours.flyer.time == theirs.flyer.time).all()
    assert (ours.curve.stress == theirs.curve.stress).all()
    assert ours.window == theirs.window


@pytest.mark.parametrize("options", [[], ["--pictures"], ["--bars"]])
def test_an_empty_template_is_refused_by_every_command_with_the_whole_list(
    options: list[str], tmp_path: Path
) -> None:
    folder = tmp_path / "shot"
    empty = list(blanks(tomllib.loads(new(folder, *options))))
    for command in ("check", "identify", "waves", "simulate", "dic", "report"):
        said = run_kolsky(command, folder, code=2).stderr.splitlines()
        listed = [found[1] for line in said if (found := re.search(r": ([\w.]+) is not filled in", line))]
        assert sorted(listed) == sorted(empty), command
        lines = [int(found[1]) for line in said if (found := re.search(r"shot\.toml line (\d+):", line))]
        assert len(lines) == len(listed), command
        assert lines == sorted(lines), command  # in the order of the file
        assert os.listdir(folder) == ["shot.toml"], command


def test_a_blank_says_what_is_allowed(tmp_path: Path) -> None:
    new(tmp_path / "shot")
    with pytest.raises(InputError) as refused:
        load_shot(tmp_path / "shot")
    said = {problem.key: str(problem) for problem in refused.value.problems}
    for key, words in {
        "specimen.length": "a length > 0. Cure: write a length, e.g.",
        "model.poisson": "in [0, 0.49999]",
        "force.compression": '"positive" or "negative"',
        "force.voltage.column": "is not filled in",
    }.items():
        assert words in said[key]


def test_the_next_shot_of_a_series_keeps_the_apparatus(tmp_path: Path) -> None:
    folder = german(tmp_path / "next")
    text = new(folder, "--from", str(OPEN_01))
    declared = tomllib.loads(text)
    assert list(blanks(declared)) == ["specimen.diameter", "specimen.length", "frames.static"]
    assert declared["force"]["sensitivity"] == "0.0112 V/N"
    assert declared["force"]["file"] == "Oszi Versuch 7.csv"
    assert declared["centre_line"]["sigma_column"] == {"column": "Unsicherheit Z (mm)", "unit": "mm"}


def test_the_next_shot_with_the_same_names_differs_in_its_own_facts_alone(tmp_path: Path) -> None:
    folder = tmp_path / "next"
    folder.mkdir()
    for name in FILES[1:]:
        shutil.copy(OPEN_01 / name, folder)
    text = new(folder, "--from", str(OPEN_01 / "shot.toml"))
    own = {**{key: FACTS[key] for key in ("specimen.diameter", "specimen.length")}, "frames.static": "12"}
    assert tomllib.loads(fill_in(text, own)) == tomllib.loads((OPEN_01 / "shot.toml").read_text("utf-8"))


def test_options_that_exclude_each_other(tmp_path: Path) -> None:
    result = run_kolsky("new", "--bars", "--pictures", tmp_path / "shot", code=2)
    assert "exclude each other" in result.stderr


def test_what_could_be_two_things_is_left_open_and_said(tmp_path: Path) -> None:
    shutil.copy(OPEN_01 / "scope.csv", tmp_path / "a.csv")
    shutil.copy(OPEN_01 / "scope.csv", tmp_path / "b.csv")
    (tmp_path / "notes.txt").write_text("a talk, no table")
    found = survey(tmp_path)
    assert found.parts == {}
    assert "could be [force], and so could each of a.csv, b.csv" in found.doubtful["a.csv"]
    assert "notes.txt" in found.doubtful


def test_two_channels_of_unknown_meaning_are_offered(tmp_path: Path) -> None:
    rows = "\n".join(f"{1e-6 * i:.7f},{0.1 * (i % 3)},{0.2 * (i % 5)}" for i in range(300))
    (tmp_path / "scope.csv").write_text(f"t (s),CH1 (V),CH2 (V)\n{rows}\n")
    text = new(tmp_path)
    assert '# one of { column = "CH1 (V)", unit = "V" }, { column = "CH2 (V)", unit = "V" }' in text
    assert tomllib.loads(text)["force"]["voltage"] == {"column": "", "unit": ""}


@pytest.mark.parametrize(
    ("heading", "unit", "dimension"),
    [
        ("Zeit [ms]", "ms", "s"), ("Weg / µm", "µm", "m"), ("force_kN", "kN", "N"), ("strain (-)", "1", "1"),
        ("Spannung in MPa", "MPa", "Pa"), ("Kraft", "", ""), ("y (oben)", "", ""),
    ],
)  # fmt: skip
def test_units_in_headings(heading: str, unit: str, dimension: str) -> None:
    assert likely_unit(heading) == unit
    assert dimension_of(unit) == dimension


def test_values_and_remarks_of_a_shot_file() -> None:
    text = '[a]\nx = ""    # first\n# y = 2       # second\n[b]\nx = ""\n'
    assert fill_in(text, {"a.x": "3", "a.y": '"z"'}) == (
        f'[a]\n{"x = 3":<38}# first\n{"y = " + chr(34) + "z" + chr(34):<38}# second\n[b]\nx = ""\n'
    )
    assert fill_in(text, {"a.x": None}).split("\n")[1] == f"{'# x = ' + chr(34) * 2:<38}# first"
    with pytest.raises(KeyError, match=r"b\.y"):
        fill_in(text, {"b.y": "1"})
    assert with_notes(text, {"b.x": "look"}).split("\n")[3:6] == ["[b]", "# look", 'x = ""']


def test_blanks_are_found_in_order() -> None:
    content: dict[str, Any] = {
        "a": "",
        "b": {"c": ["", ""], "d": {"e": "", "f": 1}},
        "g": ["", "0 us"],
        "h": 0,
    }
    assert list(blanks(content)) == ["a", "b.c", "b.d.e"]
    assert list(blanks(tomllib.loads(template()))) != []

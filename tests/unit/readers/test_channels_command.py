"""`kolsky channels`, and [force] with a layout."""

import numpy as np
import pytest
import readerfiles as files
from damaged_shots import toml
from kolsky_command import json_of, run_kolsky

from kolsky.base.errors import InputError
from kolsky.readers.layout import Layout
from kolsky.schema.fields import LayoutSection
from kolsky.shot.load import load_shot


def test_a_table_tells_channels_clock_and_what_was_found(tmp_path):
    path = files.german(tmp_path / "a.csv")
    run = run_kolsky("channels", path)
    for words in (
        "encoding: cp1252",
        "delimiter: semicolon",
        "decimal: ,",
        "CH1 [V]  V  400 samples",
        "every 1e-07 s",
    ):
        assert words in run.stdout
    assert "Prüfer = Müller" in run.stdout


def test_json_is_one_object_in_si(tmp_path):
    path = files.german(tmp_path / "a.csv")
    answer = json_of("channels", path)
    assert answer["found"]["encoding"] == "cp1252"
    assert answer["channels"][1]["name"] == "CH2 [V]"
    assert answer["channels"][1]["interval"] == 1e-7
    assert answer["channels"][1]["start"] == pytest.approx(files.START, rel=1e-15)


def test_a_clock_that_is_not_known_says_why_and_an_option_settles_it(tmp_path):
    path = files.text(tmp_path / "a.csv", ["Time (s),CH1 (V),CH2 (V)"], time="{:.6f}")
    run = run_kolsky("channels", path)
    assert "is rounded to 1e-06 s" in run.stdout
    run = run_kolsky("channels", path, "--interval", "100 ns")
    assert "every 1e-07 s (10 MHz, 400 samples, 40 us): stated" in run.stdout


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--interval", "fast"], "--interval: 'fast' is not a number with a unit"),
        (["--format", "wav"], "is declared to have the format 'wav'"),
        (["--delimiter", "slash"], "is declared to have the delimiter 'slash'"),
        (["--time", "CH9"], "time column 'CH9' is missing"),
    ],
)
def test_bad_options_are_one_line_and_exit_code_2(options, words, tmp_path):
    path = files.plain(tmp_path / "a.csv")
    run = run_kolsky("channels", path, *options, code=2)
    assert words in run.stderr
    assert run.stderr.count("\n") == 1


TIME = 'time = { column = "Time (s)", unit = "s" }\n'


def test_the_force_of_a_german_export_is_that_of_the_plain_one(shot):
    plain = load_shot(shot).force
    lines = (shot / "scope.csv").read_text().splitlines()
    rows = [line.replace(",", ";").replace(".", ",") for line in lines]
    (shot / "scope.csv").write_bytes("\r\n".join(["Prüfer;Müller", *rows]).encode("cp1252"))
    toml(TIME, 'layout = { decimal = "," }\n')(shot)
    found = load_shot(shot).force
    np.testing.assert_array_equal(found.recording.value, plain.recording.value)
    # The strict reader takes the printed times (8 figures: 1e-11 s), the layout start + i * interval.
    np.testing.assert_allclose(found.recording.time, plain.recording.time, rtol=0, atol=1e-11)


def test_a_layout_beside_the_time_column_needs_no_second_word_for_it(shot):
    toml(TIME, TIME + 'layout = { time = "Time (s)" }\n')(shot)
    with pytest.raises(InputError, match=r"force.time .*is given twice, in layout.time too"):
        load_shot(shot)


@pytest.mark.parametrize(
    ("layout", "words"),
    [
        ('interval = "0 ns"', 'force.layout.interval = "0 ns" is not allowed; it must be > 0 s'),
        ('unit = "parsec"', 'force.layout.unit = "parsec" is not a known unit'),
        ('time_unit = "V"', 'force.layout.time_unit = "V" is not a unit of time'),
        ('delimeter = ";"', "force.layout.delimeter .* did you mean delimiter"),
        ("header_line = -1", "force.layout.header_line = -1 is not allowed; it must be >= 0"),
    ],
)
def test_bad_layouts_are_told_with_their_key(layout, words, shot):
    toml(TIME, f"layout = {{ {layout} }}\n")(shot)
    with pytest.raises(InputError, match=words):
        load_shot(shot)


def test_force_needs_a_time_column_or_a_layout(shot):
    path = shot / "shot.toml"
    before, force = path.read_text().split("\n[force]")
    path.write_text(before + "\n[force]" + force.replace(TIME, "", 1))
    with pytest.raises(InputError, match=r"force.time is missing"):
        load_shot(shot)


def test_a_section_becomes_a_layout():
    section = LayoutSection.model_validate(
        {"delimiter": ";", "decimal": ",", "interval": "80 ns", "time": {"CH1": "t1"}, "unit": "mV"}
    )
    assert section.as_layout(full_scale=2.0) == Layout(
        delimiter=";", decimal=",", interval=8e-8, time={"CH1": "t1"}, unit="mV", full_scale=2.0
    )
    assert section.as_layout(unit="V").unit == "V"

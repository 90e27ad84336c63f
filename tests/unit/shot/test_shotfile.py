"""shot.toml: declared values are converted to SI; all else is rejected with line, key, value and cure."""

import re
from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, Field

from kolsky.base.errors import InputError, InputErrors
from kolsky.base.toml import key_lines, line_of, parse_toml
from kolsky.schema.shot_file import shot_toml

FILLED = Path(__file__).parents[2] / "data" / "filled_shot.toml"
"""A shot file with every key, optional ones as remarks."""


def template() -> str:
    return FILLED.read_text(encoding="utf-8")


@pytest.fixture
def written(tmp_path: Path):
    def written(text: str) -> Path:
        path = tmp_path / "shot.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return written


def changed(old: str, new: str) -> str:
    """The filled file with one line changed."""
    text = template()
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in the file"
    return text.replace(old, new)


def line_number(text: str, part: str) -> int:
    return text[: text.index(part)].count("\n") + 1


def test_a_filled_file_is_valid_and_in_si(written) -> None:
    shot = shot_toml(written(template())).declared
    assert (shot.specimen.diameter, shot.specimen.length, shot.specimen.density) == (9.5e-3, 6.5e-3, 870.0)
    assert (shot.interface.faces, shot.interface.side, shot.interface.friction) == ("bonded", "bonded", None)
    assert (shot.transmission.support, shot.transmission.bar) == ("rigid", None)
    assert (shot.force.sensitivity, shot.force.full_scale, shot.force.bits) == (0.0112, 1.0, 12)
    assert shot.force.baseline == (-2.0e-4, 0.0)
    assert shot.flyer.sigma == 1e-6
    assert shot.flyer.displacement.unit == pytest.approx(1e-3, rel=1e-15)  # one rounding in pint
    assert shot.curve.relative_sigma == pytest.approx(0.002, rel=1e-15)  # likewise
    assert (shot.model.poisson, shot.model.damping, shot.model.mass_damping) == (0.499, 2.5e-5, 0.0)
    assert (shot.window.start, shot.window.end) == (None, None)


def test_a_bar_behind_the_specimen(written) -> None:
    text = changed('support = "rigid"', 'support = "bar"')
    text = re.sub(
        r"^# (\[transmission\.bar\]|diameter|length|youngs|density|poisson)", r"\1", text, count=6, flags=re.M
    )
    bar = shot_toml(written(text)).declared.transmission.bar
    assert (bar.diameter, bar.length, bar.youngs_modulus, bar.density, bar.poisson) == (
        0.015,
        1.5,
        1.9e11,
        8048.0,
        0.29,
    )


DENSITY = 'density = "870 kg/m^3"\n\n[interface]'

BAR = """[transmission.bar]
diameter = "15 mm"
length = "1 m"
youngs_modulus = "190 GPa"
density = "8048 kg/m^3"
#"""
TIME = 'time = { column = "Time (s)", unit = "s" }'

REFUSED = [
    # old line, new line, key, fragments of the message
    (DENSITY, 'density = "870 kg/m^2"\n\n[interface]', "specimen.density", ["it must be a mass density"]),
    (DENSITY, "density = 870\n\n[interface]", "specimen.density", ["= 870 has no unit", '"870 kg/m^3"']),
    (DENSITY, "\n[interface]", "specimen.density", ["is missing"]),
    ('length = "6.5 mm"', 'length = "0 mm"', "specimen.length",
     ['= "0 mm" is not allowed; it must be > 0 m']),
    ('length = "6.5 mm"', 'length = "6.5 us"', "specimen.length", ["is a time; it must be a length"]),
    ('length = "6.5 mm"', 'lenght = "6.5 mm"', "specimen.lenght",
     ["not a known key", "diameter, length, density. Cure: did you mean length?"]),
    ('length = "6.5 mm"', 'length = "6,5 mm"', "specimen.length", ["the unit ',5 mm', which is not a unit"]),
    ('length = "6.5 mm"', 'length = "6.5\\tmm\\nwide"', "specimen.length", ["6.5\\tmm\\nwide"]),
    ("poisson = 0.499 ", "poisson = 0.5 ", "model.poisson",
     ["= 0.5 is not allowed", "in [0, 0.49999]", "slight compressibility", "0.499"]),
    ("poisson = 0.499 ", "poisson = -0.1 ", "model.poisson", ["in [0, 0.49999]"]),
    ("poisson = 0.499 ", "poisson = nan ", "model.poisson", ["in [0, 0.49999]"]),
    ("poisson = 0.499 ", f"poisson = {'9' * 400} ", "model.poisson", ["is too large"]),
    ("poisson = 0.499 ", "poisson = true ", "model.poisson", ["is not a number"]),
    ('damping = "25 us"', 'damping = "-25 us"', "model.damping", [">= 0 s"]),
    ('damping_kind = "deviatoric"', 'damping_kind = "Rayleigh"', "model.damping_kind",
     ['it must be "deviatoric" or "full"']),
    ('faces = "bonded"', 'faces = "glued"', "interface.faces",
     ['"bonded", "bonded_release", "rough", "coulomb", "frictionless" or "penalty"']),
    ('faces = "bonded"', 'faces = "coulomb"', "interface.friction", ["is missing", "friction = 0.3"]),
    ("# friction = 0.3 ", "friction = 0.3 ", "interface.friction", ["= 0.3 is given", "no effect"]),
    ('faces = "bonded"', 'faces = "bonded_release"', "interface.release_stress",
     ["is missing", 'release_stress = "50 kPa"']),
    ("# friction = 0.3 ", 'release_stress = "50 kPa" ', "interface.release_stress",
     ['= "50 kPa" is given', "no effect"]),
    ('side = "bonded" ', 'side = "bonded_release"\nrelease_stress = "-50 kPa" ', "interface.release_stress",
     ["is not allowed", ">= 0 Pa"]),
    ('side = "bonded" ', 'side = "coulomb"\nfriction = -0.3 ', "interface.friction",
     ["= -0.3 is not allowed", ">= 0"]),
    ('support = "rigid"', 'support = "bar"', "transmission.bar", ["is missing"]),
    ("# [transmission.bar]", BAR, "transmission.bar", ["no effect"]),
    ('sensitivity = "0.0112 V/N"', 'sensitivity = "-0.0112 V/N"', "force.sensitivity", ["> 0 V/N"]),
    ('sensitivity = "0.0112 V/N"', 'sensitivity = "0.0112 N/V"', "force.sensitivity",
     ["it must be volts per force"]),
    ('compression = "positive"', 'compression = "up"', "force.compression",
     ['it must be "positive" or "negative"']),
    ('full_scale = "1 V"', 'full_scale = "0 V"', "force.full_scale", ["> 0 V"]),
    ("bits = 12", "bits = 2", "force.bits", ["= 2 is not allowed; it must be >= 4"]),
    ("bits = 12", "bits = 64", "force.bits", ["it must be <= 32"]),
    ("bits = 12", "bits = true", "force.bits", ["is not a whole number"]),
    ('["-200 us", "0 us"]', '["0 us", "-200 us"]', "force.baseline", ["ends before it begins"]),
    ('["-200 us", "0 us"]', '["0 us"]', "force.baseline", ["is not a pair of times"]),
    ('["-200 us", "0 us"]', '["0 us", 1]', "force.baseline", ["has no unit"]),
    ('file = "scope.csv"', 'file = "../scope.csv"', "force.file", ["outside the shot"]),
    ('file = "scope.csv"', 'file = "/etc/passwd"', "force.file", ["outside the shot"]),
    ('file = "scope.csv"', 'file = ""', "force.file", ["is not filled in"]),
    (TIME, 'time = { column = "Time (s)", unit = "mm" }', "force.time.unit",
     ['= "mm" is a length; it must be a unit of a time']),
    (TIME, 'time = { column = "Time (s)" }', "force.time.unit", ["is missing"]),
    (TIME, 'time = { column = "Time (s)", units = "s", unit = "s" }', "force.time.units",
     ["did you mean unit?"]),
    (TIME, 'time = "Time (s)"', "force.time", ["is not a table", "column, unit"]),
    ("static = 12", "static = 2", "frames.static", ["= 2 is not allowed; it must be >= 3"]),
    ('positive = "toward specimen"', 'positive = "up"', "flyer.positive",
     ['"toward specimen" or "away from specimen"']),
    ('sigma = "1 um"    ', 'sigma = "0 um"    ', "flyer.sigma", ["> 0 m"]),
    ('y_offset = "0 mm"', 'y_offset = "0 mm"\nsigma = "4 um"', "centre_line.sigma_column",
     ["is given beside sigma"]),
    ("sigma_column = {", "# sigma_column = {", "centre_line.sigma", ["is missing"]),
    ('relative_sigma = "0.2 %"', 'relative_sigma = "0 %"', "curve.relative_sigma",
     ["as if the curve had no uncertainty"]),
    ('relative_sigma = "0.2 %"', 'relative_sigma = "100 %"', "curve.relative_sigma", ["in [0, 1)"]),
    ('branch = "compression"', 'branch = "both"', "curve.branch", ['"compression" or "tension"']),
    ('# end = "1.4 ms"', 'start = "1 ms"\nend = "1 ms"', "window.end", ["later than window.start"]),
    ("format = 1", "format = 2", "format", ["= 2 is not allowed; it must be 1"]),
    ("format = 1", "formal = 1", "formal", ["did you mean format?"]),
    ("format = 1", "format = 1\ncolour = 'red'", "colour",
     ["is not a known key; the keys here are format, name, material, group, rig, specimen,",
     "Cure: remove it"]),
]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "key", "fragments"), REFUSED, ids=[f"{r[2]}-{i}" for i, r in enumerate(REFUSED)]
)
def test_refused_declarations(written, old: str, new: str, key: str, fragments: list[str]) -> None:
    text = changed(old, new)
    path = written(text)
    with pytest.raises(InputError) as caught:
        shot_toml(path)
    problems = {problem.key: problem for problem in caught.value.problems}
    assert key in problems
    line = str(problems[key])
    assert "\n" not in line
    assert line.startswith(f"{path} line ") or problems[key].line is None
    for fragment in fragments:
        assert fragment in line


def test_the_line_of_the_key_is_named(written) -> None:
    text = changed(DENSITY, 'density = "-870 kg/m^3"\n\n[interface]')
    path = written(text)
    with pytest.raises(InputError) as caught:
        shot_toml(path)
    assert str(caught.value) == (
        f'{path} line {line_number(text, "density")}: specimen.density = "-870 kg/m^3" is not allowed;'
        ' it must be > 0 kg/m^3. Cure: write the mass density, e.g. "870 kg/m^3"'
    )


def test_several_problems_are_listed_one_line_each(written) -> None:
    text = changed("poisson = 0.499 ", "poisson = 0.5 ").replace('length = "6.5 mm"', 'length = "-6.5 mm"')
    with pytest.raises(InputErrors) as caught:
        shot_toml(written(text))
    lines = str(caught.value).split("\n")
    assert len(lines) == len(caught.value.problems) == 2
    assert f"line {line_number(text, 'length = ')}: specimen.length" in lines[0]
    assert f"line {line_number(text, 'poisson = 0.5 ')}: model.poisson" in lines[1]


def test_a_misspelt_key_is_one_problem(written) -> None:
    with pytest.raises(InputError) as caught:
        shot_toml(written(changed('length = "6.5 mm"', 'lenght = "6.5 mm"')))
    assert [problem.key for problem in caught.value.problems] == ["specimen.lenght"]


def test_a_missing_table_is_named(written) -> None:
    text = template()
    start, end = text.index("[curve]"), text.index("[model]")
    with pytest.raises(InputError, match="curve is missing") as caught:
        shot_toml(written(text[:start] + text[end:]))
    assert caught.value.line is None


@pytest.mark.parametrize(
    ("text", "fragments"),
    [
        ("format = 1\nlength = 9.5 mm\n", ["line 2", "not valid TOML"]),
        ("format = 1\nformat = 1\n", ["line 2", "not valid TOML"]),
        ("format = 'x", ["not valid TOML"]),
        (f"format = {'[' * 100_000}", ["line 1: has a line of more than 20000 characters", "break the list"]),
        (f"format = {'9' * 5000}", ["not valid TOML: Exceeds the limit"]),
    ],
)
def test_no_toml(written, text: str, fragments: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        shot_toml(written(text))
    for fragment in fragments:
        assert fragment in str(caught.value)


def test_a_shot_file_of_two_gigabytes_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "shot.toml"
    with path.open("wb") as file:
        file.truncate(2_000_000_000)  # sparse: takes no disk
    with pytest.raises(InputError, match="2000 MB, more than the 1 MB"):
        shot_toml(path)


def test_lines_of_keys() -> None:
    text = 'a = 1\n\n[ t ]  # note\n"b" = { x = 1 }\nc = [\n  1,\n]\n[t.u]\r\nd.e = 3\r\n'
    lines = key_lines(text)
    assert lines == {"a": 1, "t": 3, "t.b": 4, "t.c": 5, "t.u": 8, "t.u.d.e": 9}
    assert line_of(lines, "t.b.x") == 4
    assert line_of(lines, "t.unknown") == 3
    assert line_of(lines, "unknown") is None


def test_what_stands_inside_a_value_is_no_key() -> None:
    text = 'a = """\nb = 1\n[c]\n"""\nd = [\n  [1, 2],  # ]\n  { e = 3 },\n]\nf = 4\n'
    assert key_lines(text) == {"a": 1, "d": 5, "f": 9}


class OfSeveralKinds(BaseModel):
    """A table whose value is one word or two, and one whose value is a table."""

    sign: Literal["up", "down"] | Annotated[list[Literal["up", "down"]], Field(min_length=2)]
    named: dict[str, float] = {}


@pytest.mark.parametrize(
    ("text", "key", "allowed"),
    [('sign = "upp"', "sign", '"up" or "down"'), ('sign = "up"\nnamed = "x"', "named", "a valid table")],
)
def test_a_value_of_several_kinds_is_one_problem_with_its_own_key(written, text, key, allowed) -> None:
    with pytest.raises(InputError) as caught:
        parse_toml(written(text + "\n")).validated(OfSeveralKinds)
    (problem,) = caught.value.problems
    assert (problem.key, problem.allowed) == (key, allowed)
    assert "is not allowed; it must be" in str(problem)


def test_a_file_that_ends_inside_a_value_names_its_last_line(tmp_path):
    place = tmp_path / "shot.toml"
    place.write_text('material = "gel"\ncurve = [\n')
    with pytest.raises(InputError, match="is not valid TOML: Invalid value") as refused:
        parse_toml(place)
    assert refused.value.line == 2
    assert "end of document" not in str(refused.value)

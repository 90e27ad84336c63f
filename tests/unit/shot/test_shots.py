"""A loaded shot, compared with an independent reading of its files: every sign and every clock."""

import csv
import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.shot.load import load_shot

ROOT = Path(__file__).parents[3]
OPEN_01 = ROOT / "runs" / "open-01"
OPEN_02 = ROOT / "tests" / "data" / "open-02"


def columns(path: Path) -> list[list[float]]:
    with path.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    return [[float(row[k]) for row in rows] for k in range(len(rows[0]))]


@pytest.fixture
def variant(tmp_path: Path) -> Callable[..., Path]:
    """A copy of open-01 with replacements in its shot.toml and, file by file, in its data lines."""

    def variant(*toml_changes: tuple[str, str], rows: dict[str, Callable[[str], str]] | None = None) -> Path:
        folder = tmp_path / "shot"
        shutil.copytree(OPEN_01, folder)
        text = (folder / "shot.toml").read_text()
        for old, new in toml_changes:
            assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
            text = text.replace(old, new)
        (folder / "shot.toml").write_text(text)
        for name, change in (rows or {}).items():
            header, *lines = (folder / name).read_text().splitlines()
            (folder / name).write_text("\n".join([header, *(change(line) for line in lines)]) + "\n")
        return folder

    return variant


@pytest.fixture(params=["open-01", "open-02"])
def folder(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Both known-answer shots, with one and the same shot.toml."""
    if request.param == "open-01":
        return OPEN_01
    target = tmp_path / "open-02"
    shutil.copytree(OPEN_02, target)
    shutil.copy(OPEN_01 / "shot.toml", target)
    return target


def test_what_the_facts_say_is_what_is_loaded(folder: Path) -> None:
    facts = json.loads((folder / "facts.json").read_text())
    shot = load_shot(folder)
    assert shot.name == folder.name
    assert shot.specimen.diameter == facts["specimen"]["diameter_mm"] / 1e3
    assert shot.specimen.length == facts["specimen"]["length_mm"] / 1e3
    assert shot.specimen.density == facts["specimen"]["density_kg_m3"]
    assert shot.force.transducer.sensitivity == facts["scope"]["sensitivity_V_per_N"]["transmitted"]
    assert shot.force.transducer.compression_sign == 1
    assert shot.force.transducer.full_scale == facts["scope"]["full_scale_V"]
    assert (shot.interface.faces, shot.interface.side) == ("bonded", "bonded")


def test_recordings_are_the_files_numbers_in_si(folder: Path) -> None:
    shot = load_shot(folder)
    time, _, transmitted = columns(folder / "scope.csv")
    np.testing.assert_array_equal(shot.force.recording.time, time)
    np.testing.assert_array_equal(shot.force.recording.value, transmitted)
    _, frame_time, travel = columns(folder / "flyer.csv")
    np.testing.assert_array_equal(shot.flyer.time, frame_time)
    # rtol: the product with 1e-3 is rounded once more than the decimal quotient
    np.testing.assert_allclose(shot.flyer.displacement, np.array(travel) / 1e3, rtol=4e-16)
    frame, point_time, y, Z, sigma = columns(folder / "centreline.csv")
    line = shot.centre_line
    np.testing.assert_array_equal(line.frame, frame)
    np.testing.assert_array_equal(line.time, point_time)
    for measured, column in ((line.y, y), (line.Z, Z), (line.sigma, sigma)):
        np.testing.assert_allclose(measured, np.array(column) / 1e3, rtol=4e-16)
    strain, stress = columns(folder / "quasi_static.csv")
    np.testing.assert_allclose(shot.curve.stretch, 1.0 + np.array(strain), rtol=4e-16)
    np.testing.assert_array_equal(shot.curve.stress, stress)
    np.testing.assert_allclose(shot.curve.sigma, 0.002 * np.abs(stress), rtol=1e-15)


def test_default_window_is_from_the_last_static_frame_to_the_last_covered_one(folder: Path) -> None:
    # frames.csv: frame 11 at 29.1667 us is the twelfth; the scope ends at 1470 us, frame 183 is at 1462.5 us.
    assert load_shot(folder).window == (2.91666667e-05, 1.46250000e-03)


def test_inputs_are_the_hashes_of_everything_read(folder: Path) -> None:
    names = ["shot.toml", "scope.csv", "frames.csv", "flyer.csv", "centreline.csv", "quasi_static.csv"]
    expected = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in names}
    assert load_shot(folder).inputs == expected


def test_noise_declared_for_the_flyer_is_what_the_static_frames_show(folder: Path) -> None:
    shot = load_shot(folder)
    rest = shot.flyer.displacement[:12]
    # The scatter of 12 values has a relative standard deviation of 1/sqrt(22) = 21 %: three of them.
    assert rest.std(ddof=1) == pytest.approx(shot.flyer.sigma[0], rel=0.64)


def test_toml_path_and_folder_are_the_same_shot() -> None:
    one, other = load_shot(OPEN_01), load_shot(OPEN_01 / "shot.toml")
    assert (one.name, one.inputs, one.window) == (other.name, other.inputs, other.window)


def negated(column: int) -> Callable[[str], str]:
    def change(line: str) -> str:
        fields = line.split(",")
        fields[column] = str(-float(fields[column]))
        return ",".join(fields)

    return change


def test_declared_signs_undo_the_signs_of_the_files(variant) -> None:
    def both(line: str) -> str:
        return negated(0)(negated(1)(line))

    folder = variant(
        ('compression = "positive"', 'compression = "negative"'),
        ('positive = "toward specimen"', 'positive = "away from specimen"'),
        ('convention = "tension positive"', 'convention = "compression positive"'),
        rows={"scope.csv": negated(2), "flyer.csv": negated(2), "quasi_static.csv": both},
    )
    shot, plain = load_shot(folder), load_shot(OPEN_01)
    np.testing.assert_array_equal(shot.force.raw_force(), plain.force.raw_force())
    np.testing.assert_array_equal(shot.flyer.displacement, plain.flyer.displacement)
    np.testing.assert_array_equal(shot.curve.stretch, plain.curve.stretch)
    np.testing.assert_array_equal(shot.curve.stress, plain.curve.stress)


def test_clock_offsets_shift_each_recording(variant) -> None:
    folder = variant(('baseline = ["-200 us", "0 us"]', 'baseline = ["-100 us", "90 us"]'))
    text = (folder / "shot.toml").read_text().replace('clock_offset = "0 us"', 'clock_offset = "100 us"')
    (folder / "shot.toml").write_text(text)
    shot, plain = load_shot(folder), load_shot(OPEN_01)
    atol = 1e-18  # one rounding of times of 1e-3 s
    np.testing.assert_allclose(shot.force.time, plain.force.time + 1e-4, atol=atol)
    np.testing.assert_allclose(shot.flyer.time, plain.flyer.time + 1e-4, atol=atol)
    np.testing.assert_allclose(shot.centre_line.time, plain.centre_line.time + 1e-4, atol=atol)
    assert shot.window == pytest.approx([t + 1e-4 for t in plain.window], abs=atol)


def test_spatial_offsets_are_added(variant) -> None:
    folder = variant(
        ('y_offset = "0 mm"', 'y_offset = "0.1 mm"'), ('Z_offset = "0 mm"', 'Z_offset = "-20 um"')
    )
    shot, plain = load_shot(folder).centre_line, load_shot(OPEN_01).centre_line
    np.testing.assert_allclose(shot.y, plain.y + 1e-4, rtol=1e-15)
    np.testing.assert_allclose(shot.Z, plain.Z - 2e-5, rtol=1e-15)


def test_a_file_without_time_column_and_a_curve_that_begins_at_its_end(variant) -> None:
    folder = variant()
    toml = folder / "shot.toml"
    time = 'time = { column = "time (s)", unit = "s" }   # optional'
    assert toml.read_text().count(time) == 2
    toml.write_text(toml.read_text().replace(time, "#"))
    header, *lines = (folder / "quasi_static.csv").read_text().splitlines()
    (folder / "quasi_static.csv").write_text("\n".join([header, *reversed(lines)]))
    shot, plain = load_shot(folder), load_shot(OPEN_01)
    np.testing.assert_array_equal(shot.flyer.time, plain.flyer.time)
    np.testing.assert_array_equal(shot.centre_line.time, plain.centre_line.time)
    np.testing.assert_array_equal(shot.curve.stretch, plain.curve.stretch)


def test_declared_window_and_a_flyer_record_that_ends_with_it(variant) -> None:
    folder = variant(('# end = "1.4 ms"', 'end = "0.9 ms"'), ('# start = "0 us"', 'start = "0 us"'))
    flyer = (folder / "flyer.csv").read_text().splitlines()
    (folder / "flyer.csv").write_text("\n".join(flyer[:120]))
    shot = load_shot(folder)
    assert shot.window == (0.0, 0.9e-3)
    assert shot.flyer.time.size == 119


def test_a_name_can_be_declared(variant) -> None:
    assert load_shot(variant(('# name = "shot 17"', 'name = "shot 17"'))).name == "shot 17"


def test_errors_are_exceptions_of_one_kind(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="kolsky new"):
        load_shot(tmp_path)
    with pytest.raises(InputError, match="no such folder or file"):
        load_shot(tmp_path / "nowhere")


def test_an_outline_row_that_stands_five_hundred_times_is_counted_once(shot: Path) -> None:
    sound = load_shot(shot)
    assert sound.notes == ()
    path = shot / "centreline.csv"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([*rows[:1001], *[rows[1000]] * 499, *rows[1001:]]) + "\n")
    found = load_shot(shot)
    for name in ("time", "frame", "y", "Z", "sigma"):
        assert (getattr(found.centre_line, name) == getattr(sound.centre_line, name)).all()
    frame = rows[1000].split(",")[0]
    (note,) = found.notes
    assert note.startswith(f"centreline.csv line 1001: the point of frame {frame} stands 500 times")

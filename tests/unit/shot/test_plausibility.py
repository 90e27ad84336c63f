"""Consistency of inputs: every rule on both sides with numbers by hand, and whole shots."""

import os
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaged_shots import Mutation, both, fields, number, toml
from shot_folders import OPEN_01, OPEN_02, ROOT

from kolsky.base.apparatus import Specimen
from kolsky.base.errors import InputError
from kolsky.base.records import CentreLine, MaterialCurve
from kolsky.base.toml import TomlFile
from kolsky.shot.bars import load_waves
from kolsky.shot.evidence import Evidence, fitting_factor, fitting_unit, power_of_1000
from kolsky.shot.load import check_shot, load_shot
from kolsky.shot.plausibility import RULES, gate, quasi_static_stress

TEXT = """
[specimen]
diameter = "10 mm"
length = "5 mm"
density = "1000 kg/m^3"
[model]
poisson = 0.49
[force]
time = { column = "t", unit = "s" }
sensitivity = "0.01 V/N"
[frames]
time = { column = "t", unit = "s" }
[flyer]
displacement = { column = "u", unit = "mm" }
[centre_line]
y = { column = "y", unit = "mm" }
Z = { column = "Z", unit = "mm" }
[curve]
strain = { column = "e", unit = "1" }
stress = { column = "s", unit = "kPa" }
"""


class Declared:
    """What a shot file declares, as far as rules ask for it."""

    def __init__(self, diameter: float = 0.01, length: float = 5e-3, poisson: float = 0.49) -> None:
        self.specimen = Specimen(diameter=diameter, length=length, density=1000.0)
        self.model = type("Model", (), {"poisson": poisson})
        self.centre_line = type("Line", (), {"Z_offset": 0.0})


def known(*changes: tuple[str, str], declared: Declared | None = None, **found: Any) -> Evidence:
    """Evidence of the file above with some texts replaced."""
    text = TEXT
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file = TomlFile(Path("shot.toml"), "0", tomllib.loads(text), {})
    return Evidence(file=file, declared=declared or Declared(), **found)


def words(evidence: Evidence, *, contradiction: bool = True) -> str:
    """What the rules say of one kind."""
    found = [finding for rule in RULES for finding in rule(evidence)]
    return "\n".join(str(error) for error, contradicts in found if contradicts == contradiction)


def test_the_force_is_not_the_channel_of_the_other_bar() -> None:
    force = ('sensitivity = "0.01 V/N"', 'sensitivity = "0.01 V/N"\nvoltage = { column = "CH1", unit = "V" }')
    other = ("[frames]", '[incident_force]\nvoltage = { column = "CH1", unit = "V" }\n[frames]')
    assert "force.voltage is the column 'CH1', which is incident_force.voltage too" in words(
        known(force, other)
    )
    elsewhere = other[1].replace("voltage", 'file = "other.csv"\nvoltage')
    assert words(known(force, ("[frames]", elsewhere))) == words(known(force)) == ""
    named = known((force[0], force[1].replace("CH1", "CH1 Incident bar")))
    assert words(named) == ""
    assert "whose heading is that of the other bar" in words(named, contradiction=False)


# Units and factors.


def test_units_that_fit() -> None:
    assert fitting_unit("kPa", "Pa", 1e3) == "MPa"
    assert fitting_unit("ms", "s", 1e-3) == "us"
    assert fitting_unit("mm", "m", 25.4) == "in"
    assert fitting_unit("%", "1", 100.0) == "1"
    assert fitting_unit("kPa", "Pa", 30.0) is None
    assert fitting_unit("furlongs of", "Pa", 1e3) is None
    assert [power_of_1000(x) for x in (1.0, 31.0, 32.0, 1 / 31, 1 / 32, 3e-6)] == [1, 1, 1e-3, 1, 1e3, 1e6]
    assert fitting_factor(0.5, (2.0, 0.5), tolerance=0.2) == 2.0
    assert fitting_factor(0.39, (2.0, 0.5), tolerance=0.2) is None  # 0.78


def test_the_unit_of_a_heading_is_the_declared_one() -> None:
    assert words(known(('"s", unit = "kPa"', '"s (kPa)", unit = "kPa"'))) == ""
    said = words(known(('"s", unit = "kPa"', '"s (MPa)", unit = "kPa"')))
    assert (
        "curve.stress.unit = \"kPa\" contradicts the column 's (MPa)', whose unit in the file, 'MPa'," in said
    )
    assert 'by a factor of 0.001. Cure: write curve.stress.unit = "MPa"' in said
    assert "curve.strain.unit" in words(known(('"e", unit = "1"', '"e (%)", unit = "1"')))
    volts = (
        'time = { column = "t", unit = "s" }\nsens',
        'time = { column = "CH1 (Volts)", unit = "s" }\nsens',
    )
    assert "of another kind" in words(known(volts), contradiction=False)
    microseconds = (
        'time = { column = "t", unit = "s" }\nsens',
        'time = { column = "t (usec)", unit = "s" }\nsens',
    )
    assert "differs by a factor of 1e+06" in words(known(microseconds))
    other = known(('"s", unit = "kPa"', '"s (N)", unit = "kPa"'))
    assert words(other) == ""
    assert "of another kind" in words(other, contradiction=False)


def test_the_unit_below_a_heading_is_the_declared_one(tmp_path: Path) -> None:
    """A line of units under the names, as a workbook and many test machines write it."""
    rows = "".join(f"{0.01 * k:.2f},{0.1 * k:.1f}\n" for k in range(20))
    (tmp_path / "curve.csv").write_text(f"e,s\n-,MPa\n{rows}")
    evidence = known(("[curve]", '[curve]\nfile = "curve.csv"'))
    placed = replace(evidence, file=replace(evidence.file, path=tmp_path / "shot.toml"))
    said = words(placed)
    assert "contradicts the column 's', whose unit in the file, 'MPa', differs by a factor of 0.001" in said
    (tmp_path / "curve.csv").write_text(f"e,s\n-,kPa\n{rows}")
    assert words(placed) == ""


# What is declared alone.


@pytest.mark.parametrize(
    ("density", "fits"), [("9.99", "9990"), ("0.87", "870"), ("25001", "25.001"), ("870000", "870")]
)
def test_a_density_of_no_solid(density: str, fits: str) -> None:
    said = words(known(("1000 kg", f"{density} kg")))
    assert "specimen.density" in said
    assert f'specimen.density = "{fits} kg/m^3" would fit' in said


def test_a_foam_is_not_incompressible() -> None:
    """Below 100 kg/m^3 Poisson's ratio is at most 0.45."""
    for density, poisson, kind in (
        ("99", 0.46, "refused"),
        ("99", 0.45, "warning"),
        ("10", 0.3, "warning"),
        ("100", 0.499, ""),
        ("25000", 0.3, ""),
    ):
        evidence = known(("1000 kg", f"{density} kg"), declared=Declared(poisson=poisson))
        assert bool(words(evidence)) == (kind == "refused")
        assert bool(words(evidence, contradiction=False)) == (kind == "warning")


def bar(modulus: str, density: str) -> Evidence:
    table = f'[transmission.bar]\nyoungs_modulus = "{modulus}"\ndensity = "{density}"\n[force]'
    return known(("[force]", table))


def test_a_bar_has_the_wave_speed_of_a_bar() -> None:
    """c = sqrt(E/rho): 1 GPa over 1000 kg/m^3 gives 1000 m/s, 90 MPa 300 m/s, 400 GPa 20 000 m/s."""
    for modulus in ("1 GPa", "90.1 MPa", "399.9 GPa"):
        assert words(bar(modulus, "1000 kg/m^3")) == ""
    for modulus in ("89.9 MPa", "400.1 GPa"):
        assert "transmission.bar.youngs_modulus" in words(bar(modulus, "1000 kg/m^3"))
    said = words(bar("200 MPa", "8000 kg/m^3"))
    assert "waves of 158.1 m/s with transmission.bar.density = 8000 kg/m^3" in said
    assert 'transmission.bar.youngs_modulus = "200 GPa" would fit' in said
    assert "transmission.bar.density" in words(bar("200 GPa", "8 kg/m^3"))  # one cause, one refusal
    assert "youngs_modulus" not in words(bar("200 GPa", "8 kg/m^3"))


def test_a_specimen_has_the_size_of_one() -> None:
    said = words(known(('"5 mm"', '"5 um"'), declared=Declared(length=5e-6)))
    assert 'specimen.length = "5 mm" would fit' in said
    assert words(known(declared=Declared(length=1.01e-4)), contradiction=True) == ""
    for length, warned in ((0.0999, False), (0.1001, True), (2.01e-4, False), (1.99e-4, True)):
        said = words(known(declared=Declared(length=length)), contradiction=False)
        assert ("specimen.diameter = 10 mm" in said) == warned


# Clocks.


def times(step: float, count: int) -> np.ndarray:
    return step * np.arange(count)


def test_frames_of_a_camera() -> None:
    for step, refused in ((4.99e-3, False), (5.01e-3, True), (1.01e-9, False), (0.99e-9, True)):
        assert bool(words(known(frame_time=times(step, 100)))) == refused
    said = words(known(frame_time=times(8e-3, 186)))
    assert "186 frames at 125 frames/s, 1.488 s in all" in said
    assert 'frames.time.unit = "ms" in place of "s" would fit' in said


def test_force_and_frames_are_of_one_test() -> None:
    """Frames of 1 ms: ten samples every 0.1 ms are enough, nine are not; 10 us of force are a hundredth."""
    frames = times(1e-5, 101)
    assert words(known(frame_time=frames, force_time=times(0.99e-4, 100))) == ""
    said = words(known(frame_time=frames, force_time=times(1.01e-3, 1000)))
    assert "force.time contradicts frames.time" in said
    assert 'force.time.unit = "ms" in place of "s" would fit' in said
    assert words(known(frame_time=frames, force_time=times(1.01e-8, 1001))) == ""
    said = words(known(frame_time=frames, force_time=times(0.98e-8, 1001)))
    assert "frames.time contradicts force.time" in said
    said = words(known(frame_time=frames, force_time=times(1e-12, 1001)))
    assert said.index("force.time contradicts") < said.index("would fit")


def test_a_bars_recorder_resolves_a_wave_and_lasts_as_long() -> None:
    """A wave takes 0.4 ms: a sample every 40 us, and 40 us in all."""
    for time, refused in (
        (times(3.99e-5, 100), False),
        (times(4.01e-5, 100), True),
        (times(1e-7, 402), False),
        (times(1e-7, 400), True),
    ):
        said = words(known(recorders={"recorders.scope": time}, bar_transit=4e-4))
        assert bool(said) == refused
    said = words(known(recorders={"recorders.scope": times(1e-3, 5000)}, bar_transit=4e-4))
    assert "recorders.scope has a sample every 0.001 s" in said
    assert "times 0.001 times as large would fit" in said


# The flyer.


def moving(speed: float, step: float = 1e-5, count: int = 101) -> dict[str, np.ndarray]:
    return {"flyer_time": times(step, count), "travel": speed * times(step, count)}


def test_a_flyer_has_the_speed_of_an_impact() -> None:
    for speed, refused in ((0.051, False), (0.049, True)):
        assert bool(words(known(**moving(speed)))) == refused
    for speed, refused in ((499.0, False), (501.0, True)):
        assert bool(words(known(**moving(speed, step=5e-8)))) == refused
    said = words(known(**moving(2e-3, step=1e-2)))  # 2 mm in a second
    assert 'frames.time.unit = "ms" in place of "s" would fit' in said
    said = words(known(**moving(2e-3)))  # 2 um in a millisecond
    assert said.startswith("shot.toml: flyer.displacement gives a flyer of 0.002 m/s")
    assert 'Cure: flyer.displacement.unit = "m" in place of "mm" would fit; or frames.time.unit' in said


def test_a_flyer_does_not_go_through_the_specimen() -> None:
    assert words(known(**moving(4.99))) == ""  # 4.99 mm of 5 mm
    said = words(known(**moving(5.01)))
    assert "flyer.displacement reaches 5.01 mm, which exceeds the specimen's length (5 mm" in said
    assert 'flyer.displacement.unit = "um"' in words(known(**moving(2000.0)))


# The outline.


def outline(Z: float, y: float = 4.5e-3) -> dict[str, Any]:
    one = np.ones(5)
    line = CentreLine(
        time=0.0 * one, frame=np.zeros(5, dtype=int), y=np.linspace(0.0, y, 5), Z=Z * one, sigma=1e-6 * one
    )
    return {"outline": line, "rest": 0.0}


def test_the_outline_at_rest_has_the_specimens_radius() -> None:
    """The radius is 5 mm: 4 to 6 mm."""
    for Z, refused in ((4.01e-3, False), (3.99e-3, True), (5.99e-3, False), (6.01e-3, True)):
        assert bool(words(known(**outline(Z)))) == refused
    radius = words(known(**outline(1e-2)))
    assert 'specimen.diameter = "20 mm" would fit: was the radius given?' in radius
    assert 'centre_line.Z_offset = "-5 mm" would fit' in radius
    assert 'specimen.diameter = "5 mm" would fit: was twice' in words(known(**outline(2.5e-3)))
    assert 'centre_line.Z.unit = "um" in place of "mm"' in words(known(**outline(5.0)))
    assert 'centre_line.Z_offset = "-2 mm" would fit' in words(known(**outline(7e-3)))


def test_y_and_z_are_swapped_where_that_fits() -> None:
    swapped = outline(2.5e-3)
    line = swapped["outline"]
    swapped["outline"] = replace(line, y=np.full(5, 5e-3))
    assert "Cure: are y and Z swapped?" in words(known(**swapped))
    assert "swapped" not in words(known(**outline(2.5e-3)))  # y reaches 4.5 mm, its median is 2.25 mm


def test_the_outline_at_rest_has_the_specimens_height() -> None:
    assert words(known(**outline(5e-3, y=2.5e-3))) == ""  # half of it was exported
    said = words(known(**outline(5e-3, y=4.5e-6)))
    assert "specimen.length" in said
    assert 'centre_line.y.unit = "m" in place of "mm" would fit' in said


# Stress.

MU = 1e5
STRESS = MU * (0.6**-2 - 0.6)
"""Of the neo-Hookean material at a compression of 0.4 [Pa]."""
AREA = 0.25 * np.pi * 1e-4


def curve(mu: float = MU, end: float = 0.6) -> MaterialCurve:
    stretch = np.linspace(1.0, end, 9)
    return MaterialCurve(stretch, mu * (stretch - stretch**-2), np.full(9, 1.0))


def stressed(
    stress: float, *, duration: float = 1e-3, changes: tuple[tuple[str, str], ...] = (), **rest: Any
) -> Evidence:
    """A flyer of 2 m/s, whose rho v^2 is 4 kPa, and a force whose peak over the area is `stress`."""
    step = duration / 100.0
    move = moving(2.0 * 1e-3 / duration, step=step)
    force = AREA * stress * np.linspace(0.0, 1.0, 101)
    return known(
        *changes,
        **{**move, "rest": 0.0, "force_time": times(step, 101), "force": force, "curve": curve()} | rest,
    )


def test_stress_of_the_curve_at_a_strain() -> None:
    np.testing.assert_allclose(quasi_static_stress(curve(), 0.4), STRESS, rtol=1e-12)
    np.testing.assert_allclose(quasi_static_stress(curve(end=1.5), 0.4), STRESS, rtol=1e-12)
    low, high = quasi_static_stress(
        MaterialCurve(*np.array([[1.0, 0.8, 0.6], [0, -1e5, -1e6], [1, 1, 1]])), 0.4
    )
    np.testing.assert_allclose(low, 1e5 * (0.6**-2 - 0.6) / (0.8**-2 - 0.8), rtol=1e-12)
    np.testing.assert_allclose(high, 1e6, rtol=1e-12)


@pytest.mark.parametrize(
    ("stress", "kind"),
    [
        (STRESS, ""), (0.99 * (10.0 * STRESS + 3.0 * 4e3), ""),
        (1.01 * (10.0 * STRESS + 3.0 * 4e3), "warning"), (0.99 * (30.0 * STRESS + 3.0 * 4e3), "warning"),
        (1.01 * (30.0 * STRESS + 3.0 * 4e3), "refused"), (1.01 * STRESS / 5.0, ""),
        (0.99 * STRESS / 5.0, "warning"), (1.01 * STRESS / 30.0, "warning"),
        (0.99 * STRESS / 30.0, "refused"),
    ],
)  # fmt: skip
def test_force_over_area_is_the_curves_stress(stress: float, kind: str) -> None:
    evidence = stressed(stress)
    assert bool(words(evidence)) == (kind == "refused")
    assert bool(words(evidence, contradiction=False)) == (kind == "warning")


def test_inertia_alone_can_press_on_a_soft_specimen() -> None:
    """A curve of 1 Pa: up to 3 rho v^2 = 12 kPa belong to inertia."""
    assert words(stressed(11.9e3, curve=curve(1e-3))) == ""
    assert words(stressed(12.1e3, curve=curve(1e-3)))


def test_a_force_that_has_not_arrived_is_not_too_small() -> None:
    """Waves of 17.3 m/s take 0.577 ms twice through 5 mm."""
    assert words(stressed(STRESS / 100.0, duration=0.57e-3)) == ""
    assert words(stressed(STRESS / 100.0, duration=0.59e-3))
    assert words(stressed(STRESS / 100.0, force_noise=AREA * STRESS / 999.0)) == ""  # 9.99 sigmas


def test_the_unit_that_would_fit_is_named() -> None:
    said = words(stressed(STRESS, curve=curve(1e-3 * MU)))
    assert 'Cure: curve.stress.unit = "MPa" in place of "kPa" would fit' in said
    said = words(stressed(1e3 * STRESS))
    assert 'Cure: force.sensitivity = "10 V/N" would fit; or curve.stress.unit = "MPa"' in said
    # Ratios declared as per cent: the curve ends at a strain of 0.004.
    squeezed = replace(curve(), stretch=1.0 - 0.01 * (1.0 - curve().stretch))
    short = stressed(STRESS, changes=(('"e", unit = "1"', '"e", unit = "%"'),), curve=squeezed)
    assert 'Cure: curve.strain.unit = "1" in place of "%" would fit; or' in words(short)
    assert "ends at 0.004" in words(short, contradiction=False)


def test_a_stretch_of_no_rubber() -> None:
    assert words(known(curve=curve(end=7.99)), contradiction=False) == ""
    assert 'curve.strain.unit = "%" in place of "1"' in words(
        known(curve=curve(end=8.01)), contradiction=False
    )


# Whole shots.


def test_no_false_alarm_on_the_shots() -> None:
    for name in ("open-01", "open-03", "open-04", "open-05"):
        assert load_shot(ROOT / "runs" / name).notes == ()
    load_waves(ROOT / "runs" / "bar-01")


def test_no_false_alarm_on_copies_of_the_shared_shots(tmp_path: Path) -> None:
    """Every folder of shots with the one shot.toml that serves it."""
    shared = ROOT.parent / "shared" / "data" / "shots"
    folders = [*shared.glob("open-*")] or [OPEN_02]
    for source in folders:
        target = tmp_path / source.name
        target.mkdir()
        for file in source.glob("*.csv"):
            os.symlink(file, target / file.name)
        (target / "shot.toml").write_text((OPEN_01 / "shot.toml").read_text())
        assert load_shot(target).notes == ()


def without_units(folder: Path) -> None:
    """Headings without units, so that only values can show a wrong one."""
    toml = folder / "shot.toml"
    toml.write_text(_plain(toml.read_text()))
    for path in folder.glob("*.csv"):
        head, rest = path.read_text().split("\n", 1)
        path.write_text(f"{_plain(head)}\n{rest}")


def _plain(text: str) -> str:
    for unit in ("(s)", "(mm)", "(-)", "(Pa)"):
        text = text.replace(f" {unit}", "")
    return text


def scaled(name: str, column: int, factor: float) -> Mutation:
    return fields(name, lambda r: [*r[:column], number(r[column], factor), *r[column + 1 :]])


MILLISECONDS = both(
    *(scaled(n, c, 1e3) for n, c in {"frames.csv": 1, "flyer.csv": 1, "centreline.csv": 1}.items())
)
WRONG: dict[str, tuple[Mutation, list[str]]] = {
    "curve 1000 times too soft": (scaled("quasi_static.csv", 1, 1e-3),
     ["curve.stress", "0.358 kPa", "24.09 N", 'curve.stress.unit = "kPa" in place of "Pa" would fit']),
    "radius for diameter": (toml('"9.5 mm"', '"4.75 mm"', 2),
     ["specimen.diameter", 'specimen.diameter = "9.5 mm" would fit: was the radius given?']),
    "g/cm^3": (toml("870 kg", "0.87 kg", 2), ['specimen.density = "870 kg/m^3" would fit']),
    "milliseconds of all as seconds": (both(MILLISECONDS, scaled("scope.csv", 0, 1e3)),
     ['frames.time.unit = "ms" in place of "s" would fit']),
    "milliseconds of the frames as seconds": (MILLISECONDS,
     ['frames.time.unit = "ms" in place of "s" would fit']),
    "milliseconds of the force as seconds": (scaled("scope.csv", 0, 1e3),
     ['Cure: force.time.unit = "ms" in place of "s" would fit']),
    "volts for millivolts": (toml('"0.0112 V/N"', '"0.0112 mV/N"'),
     ['Cure: force.sensitivity = "0.0112 V/N" would fit']),
    "micrometres for millimetres": (scaled("flyer.csv", 2, 1e3),
     ['Cure: flyer.displacement.unit = "um" in place of "mm" would fit']),
    "per cent for ratios": (scaled("quasi_static.csv", 0, 100.0),
     ['Then write curve.strain.unit = "%": the largest is 0.64']),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_input_is_refused_with_what_would_fit(name: str, shot: Path) -> None:
    change, wanted = WRONG[name]
    both(without_units, change)(shot)
    with pytest.raises(InputError) as caught:
        load_shot(shot)
    for text in wanted:
        assert text in str(caught.value)
    for wrong in ("clock_offset", "swapped", "refine"):
        assert wrong not in str(caught.value)


TARGET = """
[pictures]
camera_0 = { file = "a.tif", crop_offset = [0, 0] }
camera_1 = { file = "b.tif", crop_offset = [0, 0] }
[calibration]
camera_0 = "cal/a_*.png"
camera_1 = "cal/b_*.png"
distortion = "k1"
[calibration.target]
kind = "fiducial_dots"
columns = 14
rows = 10
diameter = "0.6 mm"
hollow = [[2, 2], [11, 2], [2, 7]]
[dic]
flyer_side = "up"
strip_half_width = "0.6 mm"
"""


def test_a_dot_target_without_pitch_is_found_before_the_pictures(shot: Path) -> None:
    toml = shot / "shot.toml"
    toml.write_text(toml.read_text() + TARGET)
    for name in ("a.tif", "b.tif"):
        (shot / name).touch()
    with pytest.raises(InputError) as caught:
        check_shot(shot)
    assert 'calibration.target.pitch is missing; the target "fiducial_dots" needs it.' in str(caught.value)
    assert 'e.g. pitch = "4 mm"' in str(caught.value)


def test_the_gate_refuses_and_warns() -> None:
    with pytest.raises(InputError, match=r"specimen\.density"):
        gate(known(("1000 kg", "0.9 kg")))
    (line,) = gate(known(declared=Declared(length=1.99e-4)))
    assert "specimen.length" in line
    assert "specimen.diameter" in line

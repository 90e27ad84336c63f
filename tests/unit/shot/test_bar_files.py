"""Recorder files of a shot between bars: layouts, units and clocks."""

import re
from dataclasses import replace

import numpy as np
import pytest
from barshots import INTERVAL, ONE, STRESS, bar_shot, gauge, strains, write_scope, write_toml
from shot_folders import ROOT

from kolsky.bars.reduction.varied_test import station_of
from kolsky.bars.signals.stations import LARGEST_STRAIN, check_elastic
from kolsky.base.apparatus import Bar
from kolsky.base.errors import InputError
from kolsky.schema.material import chosen_baseline
from kolsky.schema.shot_file import BarDrivenShotFile, parsed
from kolsky.shot.bars import check_bars, load_waves
from kolsky.shot.curve import read_curve
from kolsky.shot.waves import waves

# Recorder files of a shot between bars: opposed gauges in two files, layouts of every CSV.

BAR_01 = ROOT / "runs" / "bar-01"
TWO = """[recorders.left]
file = "left.csv"
clock_offset = "0 us"
[recorders.right]
file = "right.csv"
clock_offset = "{offset} us"
[recorders.behind]
file = "behind.csv"
clock_offset = "0 us"
"""
OPPOSED = """recorder = ["left", "right"]
channels = ["CH1 (V)", "CH1 (V)"]
compression = {sign}
strain_per_volt = "0.001 1/V"
"""
POSITIVE = OPPOSED.format(sign='"positive"')
BEHIND = 'recorder = "behind"\nchannels = [2]\ncompression = "positive"\nstrain_per_volt = "0.001 1/V"'


def two_files(folder, *, shift: float, bending: float = 2e-4, sign: float = 1.0, every: int = 1):
    """Opposed gauges, each in its own file; the second recorder's clock runs `shift` behind."""
    folder.mkdir()
    t, first, second = strains(noise=0.0)
    rng = np.random.default_rng(3)
    bent = bending * np.sin(2.0 * np.pi * 3e3 * t) * (t > 200e-6)
    left, right = (1e3 * (first + s * bent) + 1e-3 * rng.standard_normal(t.size) for s in (1.0, -1.0))
    write_scope(folder / "left.csv", ["t (s)", "CH1 (V)"], [t, left])
    # The same instants on another clock, some samples missing at the beginning.
    rows = slice(137, None, every)
    write_scope(folder / "right.csv", ["t (s)", "CH1 (V)"], [t[rows] - shift, sign * right[rows]])
    write_scope(
        folder / "behind.csv", ["t (s)", "CH1 (V)"], [t, 1e3 * second + 1e-3 * rng.standard_normal(t.size)]
    )
    return folder


def test_opposed_gauges_in_separate_files_are_averaged(tmp_path):
    """The bending of 200 um/m is gone from the mean, though the files begin at other times."""
    folder = two_files(tmp_path / "shot", shift=33e-6)
    write_toml(
        folder,
        recorders=TWO.format(offset=33),
        incident=POSITIVE,
        transmission=BEHIND,
        corrections="punching = false",
    )
    given = load_waves(folder)
    assert {"left.csv", "right.csv", "behind.csv"} < set(given.inputs)
    result = waves(folder)
    strain = result.incident.strain
    _, first, _ = strains(noise=0.0)
    truth = np.interp(strain.time, strains()[0], first)
    # Noise of 1/sqrt(2) um/m in 8000 samples, and the zero's.
    assert np.abs(strain.value - truth).max() < 6e-6
    assert result.incident.bending is not None
    assert np.abs(result.incident.bending).max() == pytest.approx(2e-4, rel=0.03)
    assert result.budget.results["peak stress"][0] == pytest.approx(STRESS, rel=0.03)  # noise, dispersion
    log = {c.key: c for c in result.corrections}
    assert log["bending"].applied


def test_a_fraction_of_a_sample_between_the_recorders_is_taken_out(tmp_path):
    folder = two_files(tmp_path / "shot", shift=33.04e-6, bending=0.0)
    write_toml(folder, recorders=TWO.format(offset=33.04), incident=POSITIVE, transmission=BEHIND)
    one, other = load_waves(folder).stations["incident"].recordings
    np.testing.assert_array_equal(one.time, other.time)
    # Five sigmas of sqrt(2) mV; 0.04 us of a flank are 3 mV.
    assert np.abs(one.value - other.value).max() < 8e-3


def test_gauges_wired_the_other_way_round_have_signs_of_their_own(tmp_path):
    folder = two_files(tmp_path / "shot", shift=0.0, sign=-1.0)
    parts = {"recorders": TWO.format(offset=0), "transmission": BEHIND}
    write_toml(folder, incident=POSITIVE, **parts)
    with pytest.raises(InputError, match=r'compression = \["positive", "negative"\]'):
        waves(folder)
    write_toml(folder, incident=OPPOSED.format(sign='["positive", "negative"]'), **parts)
    assert waves(folder).incident.strain.value.max() == pytest.approx(1.5e-3, rel=5e-3)


@pytest.mark.parametrize(
    ("incident", "named"),
    [(POSITIVE.replace('["left", "right"]', '["left", "wrong"]'), "recorders.wrong"),
     (POSITIVE.replace('["CH1 (V)", "CH1 (V)"]', '["CH1 (V)"]'), "has 2 entries")],
)  # fmt: skip
def test_recorders_and_channels_go_together(tmp_path, incident, named):
    folder = two_files(tmp_path / "shot", shift=0.0)
    write_toml(folder, recorders=TWO.format(offset=0), incident=incident, transmission=BEHIND)
    with pytest.raises(InputError) as error:
        load_waves(folder)
    assert named in str(error.value)


def test_recorders_of_two_rates_are_refused(tmp_path):
    folder = two_files(tmp_path / "shot", shift=0.0, every=2)
    write_toml(folder, recorders=TWO.format(offset=0), incident=POSITIVE, transmission=BEHIND)
    with pytest.raises(InputError, match="sampled every 1e-07 s and every 2e-07 s"):
        load_waves(folder)


def test_records_without_a_common_time_are_refused(tmp_path):
    folder = two_files(tmp_path / "shot", shift=0.0)
    write_toml(folder, recorders=TWO.format(offset=5000), incident=POSITIVE, transmission=BEHIND)
    with pytest.raises(InputError, match="0 samples in common"):
        load_waves(folder)


GERMAN = """[recorders.scope]
file = "scope.csv"
clock_offset = "0 us"
unit = "mV"
{layout}
"""


@pytest.mark.parametrize("layout", ["", 'delimiter = ";"\ndecimal = ","\nheader_line = 3\n'])
def test_semicolons_and_decimal_commas_of_a_bar_shot(tmp_path, layout):
    """A scope's preamble, names with units on a line of their own, mV."""
    folder = bar_shot(tmp_path / "shot")
    t, first, second = strains()
    rows = [
        f"{1e6 * a:.1f};{1e6 * b:.5f};{1e6 * c:.5f}".replace(".", ",")
        for a, b, c in zip(t, first, second, strict=True)
    ]
    head = ["Gerät;Modell 7;", "Abtastung;10 MS/s;", "Zeit [µs];Kanal 1 [mV];Kanal 2 [mV]"]
    (folder / "scope.csv").write_text("\n".join([*head, *rows]), encoding="cp1252")
    gauge = 'recorder = "scope"\nchannels = ["Kanal {n} [mV]"]\ncompression = "positive"\n'
    write_toml(
        folder,
        recorders=GERMAN.format(layout=layout),
        incident=gauge.format(n=1) + 'strain_per_volt = "0.001 1/V"',
        transmission=gauge.format(n=2) + 'strain_per_volt = "0.001 1/V"',
        corrections="punching = false",
    )
    result = waves(folder)
    assert result.budget.results["peak stress"][0] == pytest.approx(STRESS, rel=0.03)


def test_the_curve_of_a_bar_shot_takes_a_layout(tmp_path):
    """[curve] of a shot that identifies from bars alone: semicolons and decimal commas."""
    rows = ["Dehnung;Spannung", *(f"-{0.01 * k:.2f};-{10.0 * k:.1f}".replace(".", ",") for k in range(1, 12))]
    (tmp_path / "curve.csv").write_text("\n".join(rows))
    (tmp_path / "shot.toml").write_text(CURVE)
    declared = parsed(tmp_path).validated(BarDrivenShotFile)
    curve, _ = read_curve(tmp_path, chosen_baseline(declared.curve, declared.law))
    assert curve.stress.min() == pytest.approx(-110e3)
    assert curve.stretch.min() == pytest.approx(0.89)


CURVE = """format = 1
[specimen]
diameter = "10 mm"
length = "5 mm"
density = "1200 kg/m^3"
[interface]
faces = "rough"
side = "rough"
[curve]
file = "curve.csv"
layout = { delimiter = ";", decimal = "," }
strain = { column = "Dehnung", unit = "1" }
stress = { column = "Spannung", unit = "kPa" }
convention = "tension positive"
branch = "compression"
relative_sigma = "0.2 %"
sigma_floor = "1 Pa"
[model]
poisson = 0.49
damping = "1 us"
damping_kind = "deviatoric"
"""


def cut_pulses(folder, *, reflected: str) -> None:
    """The record of bar-01 in three columns whose times begin at 0: from -15, 390 and 290 us, 210 us each."""
    folder.mkdir()
    rows = np.loadtxt(BAR_01 / "tek0017.csv", delimiter=",", skiprows=5)
    starts = [round((at + 200e-6) / 0.2e-6) for at in (-15e-6, 390e-6, 290e-6)]
    columns = [rows[row : row + 1050, 1 + channel] for row, channel in zip(starts, (0, 0, 1), strict=True)]
    write_scope(
        folder / "pulses.csv",
        ["t (s)", "in (mV)", "re (mV)", "tr (mV)"],
        [0.2e-6 * np.arange(1050), *columns],
    )
    toml = re.sub(r"\n+", "\n", re.sub(r" *#.*", "", (BAR_01 / "shot.toml").read_text()))
    cut = 'file = "pulses.csv"\nclock_offset = '
    for old, new in (
        ('file = "tek0017.csv"\nclock_offset = "0 us"', f'{cut}"-15 us"\n[recorders.late]\n{cut}"290 us"'),
        ('channels = ["CH1 (mV)"]', f'channels = ["in (mV)"]\n{reflected}'),
        ('channels = ["CH2 (mV)"]', 'channels = ["tr (mV)"]'),
    ):
        assert toml.count(old) == 1
        toml = toml.replace(old, new)
    head, tail = toml.split("[gauges.transmission]")
    head = head.replace('["-190 us", "-20 us"]', '["-15 us", "-5 us"]')
    tail = tail.replace('["-190 us", "-20 us"]', '["291 us", "301 us"]').replace('"scope"', '"late"')
    (folder / "shot.toml").write_text(f"{head}[gauges.transmission]{tail}")


def test_pulses_that_were_cut_apart_are_put_together(tmp_path):
    """Both pulses stand where the whole record has them, and the gauge is at rest between them."""
    cut_pulses(tmp_path / "cut", reflected='reflected = { channel = "re (mV)", start = "405 us" }')
    given = load_waves(tmp_path / "cut")
    (record,) = given.stations["incident"].recordings
    whole = load_waves(BAR_01).stations["incident"].recordings[0]
    row = 925  # of -15 us in the whole record, which begins at -200 us
    assert record.value.size == 2025 + 1050  # the reflected pulse begins 405 us after the first sample
    np.testing.assert_array_equal(record.value[:1050], whole.value[row : row + 1050])
    np.testing.assert_array_equal(record.value[2025:], whole.value[row + 2025 : row + 3075])
    rest = whole.value[row : row + 51].mean()  # -15 to -5 us
    np.testing.assert_allclose(record.value[1050:2025], rest, rtol=1e-12)
    np.testing.assert_allclose(record.time, 0.2e-6 * np.arange(3075), atol=1e-12)
    assert any("assembled from separate pulses" in note for note in given.notes)
    found, right = check_bars(tmp_path / "cut"), check_bars(BAR_01)
    np.testing.assert_allclose(found.arrival.time, right.arrival.time, atol=0.2e-6)


@pytest.mark.parametrize(
    ("reflected", "said"),
    [
        ('reflected = { channel = "re (mV)" }', 'write start = "400 us", twice the gauge'),
        (
            'reflected = { channel = "re (mV)", start = "209 us" }',
            "at 209 us, on the incident pulse, whose column ends at 209.8 us; it must be at least 210 us",
        ),
    ],
)
def test_a_cut_pulse_without_its_place_is_refused(tmp_path, reflected, said):
    cut_pulses(tmp_path / "cut", reflected=reflected)
    with pytest.raises(InputError) as caught:
        load_waves(tmp_path / "cut")
    assert "gauges.incident.reflected.start" in str(caught.value)
    assert said in str(caught.value)


# Units and clocks of bar recordings as in public files: accepted, contradicted with a message, or

STRAIN = 'recorder = "scope"\nchannels = ["{name}"]\ncompression = "positive"\nstrain = true'


def folder_of(path, names, factor, *, gauges=gauge, **parts):
    """A shot of a CSV whose two columns are the strains times a factor."""
    incident, transmission = map(gauges, names)
    return bar_shot(path, names=names, factor=factor, incident=incident, transmission=transmission, **parts)


def largest(given):
    """Largest strain of the incident bar, and the notes."""
    return float(station_of(given, "incident").signal.strain.value.max()), given.notes


def as_strain(name):
    return STRAIN.format(name=name)


@pytest.mark.parametrize(
    ("unit", "factor"), [("V", 1e3), ("mV", 1e6), ("Volts", 1e3), ("millivolts", 1e6), ("uV", 1e9)]
)
def test_volts_of_a_file_are_what_its_heading_says(tmp_path, unit, factor):
    """1.5e-3 of strain at 1e-3 a volt are 1.5 V; CH1 (mV) was read as volts, a thousand times too much."""
    given = load_waves(folder_of(tmp_path / "a", [f"inc ({unit})", f"tra ({unit})"], factor))
    assert largest(given) == (pytest.approx(1.5e-3, rel=0.005), ())


@pytest.mark.parametrize("unit", ["microstrain", "µε", "με", "ue", "µm/m", "ustrain", "uStrain"])
def test_microstrain_of_a_file_is_microstrain(tmp_path, unit):
    given = load_waves(folder_of(tmp_path / "a", [f"inc ({unit})", f"tra ({unit})"], 1e6, gauges=as_strain))
    assert largest(given) == (pytest.approx(1.5e-3, rel=0.005), ())


def test_a_file_without_units_is_refused_until_one_is_declared(tmp_path):
    folder = folder_of(tmp_path / "a", ["inc", "tra"], 1e6)
    with pytest.raises(InputError, match=r"does not state the unit of channel 'inc'") as error:
        load_waves(folder)
    assert 'unit = "V"' in error.value.cure
    folder = folder_of(tmp_path / "b", ["inc", "tra"], 1e6, recorders=ONE + 'unit = "mV"\n')
    assert largest(load_waves(folder)) == (pytest.approx(1.5e-3, rel=0.005), ())


def test_a_declared_unit_that_contradicts_the_file_is_said(tmp_path):
    folder = folder_of(tmp_path / "a", ["inc (mV)", "tra (mV)"], 1e3, recorders=ONE + 'unit = "V"\n')
    strain, notes = largest(load_waves(folder))
    assert strain == pytest.approx(1.5e-3, rel=0.005)
    assert len(notes) == 2
    assert "'inc (mV)' of scope.csv is in 'mV' by the file and in 'V' by recorders.scope.unit" in notes[0]
    agrees = folder_of(tmp_path / "b", ["inc (mV)", "tra (mV)"], 1e6, recorders=ONE + 'unit = "millivolts"\n')
    assert load_waves(agrees).notes == ()


def test_strain_where_volts_are_needed_is_refused(tmp_path):
    folder = folder_of(tmp_path / "a", ["inc (µε)", "tra (µε)"], 1e6)
    with pytest.raises(InputError, match=r"needs a signal in 'V', channel 'inc .*' is in '1'"):
        load_waves(folder)


def test_a_thousandfold_strain_is_refused_with_its_stress(tmp_path):
    """What a wrong unit makes of 1.5 V: 1500 V, a strain of 1.5."""
    folder = folder_of(tmp_path / "a", ["inc", "tra"], 1e6, recorders=ONE + 'unit = "V"\n')
    with pytest.raises(ValueError, match=r"the largest strain of the bar is 1\.5.*2 %.*Cure: check the unit"):
        station_of(load_waves(folder), "incident")


METAL = Bar(diameter=20e-3, length=2.0, youngs_modulus=200e9, density=8000.0)
POLYMER = replace(METAL, youngs_modulus=19e9)


@pytest.mark.parametrize(
    ("bar", "limit"),
    [
        (METAL, 0.02),
        (replace(METAL, youngs_modulus=20e9), 0.02),
        (POLYMER, 0.1),
        (replace(METAL, yield_strength=900e6), 0.0045),
        (replace(POLYMER, yield_strength=76e6), 0.004),
    ],
)
def test_a_bar_bears_its_elastic_limit_and_no_more(bar, limit):
    assert LARGEST_STRAIN == {"metal": 0.02, "polymer": 0.1}
    ones = np.ones(100)
    for sign in (1.0, -1.0):
        check_elastic(0.999 * sign * limit * ones, bar, 1e-6, "gauge")
        with pytest.raises(ValueError, match="it must be below"):
            check_elastic(1.001 * sign * limit * ones, bar, 1e-6, "gauge")
    spike = np.zeros(100)
    spike[50] = 3.9 * limit  # a wave crosses the bar in four samples
    check_elastic(spike, replace(bar, density=bar.youngs_modulus / 5000.0**2), 1e-6, "gauge")


def test_a_yield_strength_is_declared_in_the_shot(tmp_path):
    folder = bar_shot(tmp_path / "a")
    path = folder / "shot.toml"
    text = path.read_text().replace(
        'wave_speed = "5000 m/s"', 'wave_speed = "5000 m/s"\nyield_strength = "290 MPa"'
    )
    path.write_text(text)
    with pytest.raises(ValueError, match=r"of its yield strength of 290 MPa"):  # 1.5e-3 of 200 GPa are 300
        station_of(load_waves(folder), "incident")
    path.write_text(text.replace("290 MPa", "310 MPa"))
    station_of(load_waves(folder), "incident")


def test_a_stated_full_scale_decides_on_clipping(tmp_path):
    t, first, second = strains()
    top = 0.9 * first.max()
    folder = bar_shot(tmp_path / "a", columns=(t, np.minimum(first, top), second))
    with pytest.raises(InputError, match=r"is clipped: .* or, if the signal is truly flat, state full_scale"):
        load_waves(folder)
    path = folder / "shot.toml"
    text = path.read_text().replace("[gauges.incident]", '[gauges.incident]\nfull_scale = "5 V"')
    path.write_text(text)
    read = station_of(load_waves(folder), "incident").signal.strain.value
    assert read.max() == pytest.approx(top, rel=1e-3)  # noise of 1e-6


def jittered(share, seed=1):
    """Times whose steps vary evenly within a share, and the strains at those times."""
    t, *_ = strains()
    steps = INTERVAL * (1.0 + share * np.random.default_rng(seed).uniform(-1.0, 1.0, t.size - 1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def test_steps_that_vary_by_two_per_cent_are_interpolated_with_a_note(tmp_path):
    time = jittered(0.02)
    t, first, second = strains(noise=0.0)
    rng = np.random.default_rng(3)
    columns = (np.interp(time, t, s) + 1e-6 * rng.standard_normal(t.size) for s in (first, second))
    folder = bar_shot(tmp_path / "a", columns=(time, *columns))
    given = load_waves(folder)
    assert len(given.notes) == 2
    assert "sampling steps of channel 'inc (V)' vary by up to 2 %" in given.notes[0]
    signal = station_of(given, "incident").signal.strain
    # Interpolated, not shifted: noise of 1e-6, its zero, and a corner of the ramp, 0.02 of a step of 7.5e-6.
    inside = signal.time < time[-1] - 1e-6
    np.testing.assert_allclose(signal.value[inside], np.interp(signal.time[inside], t, first), atol=7e-6)
    assert signal.interval == pytest.approx(time[-1] / (t.size - 1), rel=1e-9)


def test_larger_steps_are_gaps(tmp_path):
    with pytest.raises(InputError, match="where the others are"):
        load_waves(bar_shot(tmp_path / "a", columns=(jittered(0.08), *strains()[1:])))

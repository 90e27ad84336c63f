"""`kolsky waves` from files to files, on a test with an answer in closed form."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from kolsky_command import json_of, run_kolsky

INTERVAL, E, RHO = 1e-7, 200e9, 8000.0
C0 = 5000.0  # sqrt(E / rho): 0.5 mm a sample
DIAMETER, LENGTH = 20e-3, 5e-3
TOML = """
format = 1
name = {name}

[specimen]
diameter = "10 mm"
length = "5 mm"
density = "1200 kg/m^3"

[bars.incident]
diameter = "20 mm"
length = "2000 mm"
density = "8000 kg/m^3"
youngs_modulus = "200 GPa"
poisson = 0.0

[bars.transmission]
diameter = "20 mm"
length = "2000 mm"
density = "8000 kg/m^3"
wave_speed = "5000 m/s"
poisson = 0.0

[recorders.scope]
file = "scope.csv"
time = "t (s)"
time_unit = "s"
clock_offset = "10 us"

[gauges.incident]
recorder = "scope"
channels = ["inc (V)"]
distance = "1000 mm"
compression = "{sign}"
strain_per_volt = "0.001 1/V"
baseline = ["20 us", "100 us"]

[gauges.transmission]
recorder = "scope"
channels = ["tra (V)"]
distance = "500 mm"
compression = "{sign}"
bridge = {{ kind = "half, opposed", gauge_factor = 2.0, excitation = "5 V", gain = 100 }}
baseline = ["20 us", "100 us"]

[waves]
load = "{load}"
corrections = {{ punching = false }}
{waves}
[uncertainty]
specimen_diameter = "1 %"
"""
RATE_TOP, STRESS = 1000.0, 250e6
"""The specimen's plateau: rate before it carries force, and its stress."""


def _truth(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Incident and transmitted strain at the specimen from time 0, and the specimen's strain rate."""
    t = INTERVAL * np.arange(n)
    ramp = np.clip(t / 20e-6, 0.0, 1.0) * np.clip((150e-6 - t) / 20e-6, 0.0, 1.0)
    incident = 1.5e-3 * ramp
    force = STRESS * np.pi / 4 * 0.01**2 * ramp
    transmitted = force / (E * np.pi / 4 * DIAMETER**2)
    return incident, transmitted, 2.0 * C0 * (incident - transmitted) / LENGTH


def shot(
    folder: Path, *, load: str = "compression", waves: str = "", name: str = '"made"', seed: int = 7
) -> Path:
    """A shot folder with the record of that test: noise 1 um/m, gauges 1 and 0.5 m from the specimen."""
    n = 8000
    incident, transmitted, _ = _truth(2000)
    at_incident, at_transmission = np.zeros(n), np.zeros(n)
    arrival = 2000  # at the incident gauge, sample number; 1000 mm are 2000 samples
    at_incident[arrival : arrival + 2000] += incident
    at_incident[arrival + 4000 : arrival + 6000] += transmitted - incident
    at_transmission[arrival + 3000 : arrival + 5000] += transmitted
    noise = np.random.default_rng(seed).normal(0.0, 1e-6, (2, n))
    sign = 1.0 if load == "compression" else -1.0
    volts = sign * (at_incident + noise[0]) / 1e-3
    bridge = sign * (at_transmission + noise[1])
    # A half bridge with opposed gauges: V = Vexc gain GF e / 2 up to its nonlinearity, which cancels.
    other = -bridge  # compression positive in the file means tension makes it fall
    x = 2.0 * other
    ratio = (1.0 + x) / (2.0 + x) - 1.0 / (2.0 + x)
    volts2 = -100.0 * 5.0 * ratio
    time = INTERVAL * np.arange(n)
    rows = np.column_stack([time, volts, volts2])
    folder.mkdir(exist_ok=True)
    np.savetxt(
        folder / "scope.csv", rows, delimiter=",", header="t (s),inc (V),tra (V)", comments="", fmt="%.9e"
    )
    (folder / "shot.toml").write_text(
        TOML.format(sign="positive", load=load, waves=waves, name=name), encoding="utf-8"
    )
    return folder


@pytest.fixture(scope="module", params=["compression", "tension"])
def reduced(request, tmp_path_factory) -> tuple[Path, dict]:
    folder = shot(tmp_path_factory.mktemp("waves") / "shot", load=request.param)
    return folder / "results", json_of("waves", folder, "--figures", "svg")


def test_rate_stress_and_strain_are_those_that_were_planted(reduced):
    folder, said = reduced
    with h5py.File(folder / "waves.h5") as file:
        part = file["entry/reduction/three_waves"]
        time, rate, stress = part["time"][()], part["rate"][()], part["stress"][()]
        strain, sigma = part["strain"][()], part["stress_sigma"][()]
    _, _, truth = _truth(2000)
    t = INTERVAL * np.arange(2000)
    inside = (time > 30e-6) & (time < 120e-6)
    # The arrival is known to a fraction of a sample, on the plateau it does not matter; noise of the mean of
    # 900 samples of 1 um/m is 0.03 um/m of 1500: 5e-4 holds it and the zero's error (800 samples).
    assert np.mean(rate[inside]) == pytest.approx(truth[400], rel=5e-4)
    assert np.mean(stress[inside]) == pytest.approx(STRESS, rel=5e-4)
    # 0.3 us of arrival error (three samples) at 2000 / s are 6e-4 of strain.
    assert strain.max() == pytest.approx(np.trapezoid(truth, t), abs=6e-4)
    # 1 % of the diameter is 2 % of the stress; noise adds to it in quadrature.
    at = np.argmin(np.abs(time - 75e-6))
    assert sigma[at] == pytest.approx(0.02 * STRESS, rel=0.1)
    assert said["windows"]["source"] == "travel times"


def test_forces_balance_and_files_hold_the_same_numbers(reduced):
    folder, said = reduced
    assert said["balanced"] is not None
    first, last = said["balanced"]
    assert last - first > 100e-6  # of a pulse of 150 us whose forces are equal throughout
    answer = said["results"]["peak stress"]
    with h5py.File(folder / "waves.h5") as file:
        stored = file["entry/budget/results/peak_stress"]
        assert stored["value"][()] == answer["value"]
        assert stored["interval"][()].tolist() == answer["interval"]
        shares = stored["share_of_variance"][()]
        names = [name.decode() for name in file["entry/budget/name"][()]]
    assert sum(shares) == pytest.approx(1.0)
    assert shares[names.index("specimen, diameter")] > 0.9
    header = (folder / "waves.csv").read_text().splitlines()[0]
    assert "stress, three waves (Pa)" in header
    assert "sigma of stress, three waves (Pa)" in header
    assert (folder / "figures" / "waves.svg").stat().st_size > 10_000


def test_every_correction_is_in_the_log_applied_or_not(reduced):
    folder, said = reduced
    log = {entry["name"]: entry for entry in said["corrections"]}
    punching = log["punching of the bars' faces"]
    assert not punching["applied"]
    assert punching["size"] > 0.0
    assert {"dispersion, incident wave", "dispersion, transmitted wave"} <= set(log)
    # Without Poisson's ratio the first mode travels at c0 up to about 200 kHz, where it meets the next one:
    # the corners of the trapezoid, 1.5e-3 high, change by 2 %, and noise above that, but nothing else does.
    assert log["dispersion, incident wave"]["size"] < 5e-5
    assert log["dispersion, incident wave"]["rms"] < 5e-6
    text = (folder / "waves_corrections.csv").read_text()
    assert "punching of the bars' faces,punching,no" in text


def test_windows_from_the_shot_file_are_taken(tmp_path):
    declared = (
        'incident = ["205 us", "400 us"]\nreflected = ["605 us", "800 us"]\n'
        'transmitted = ["505 us", "700 us"]\n'
    )
    folder = shot(tmp_path / "shot", waves=declared)
    assert json_of("waves", folder)["windows"] == {
        "incident": [205e-6, 400e-6],
        "reflected": [605e-6, 800e-6],
        "transmitted": [505e-6, 700e-6],
        "source": "shot file",
    }


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('wave_speed = "5000 m/s"', "", "bars.transmission.wave_speed"),
        ('diameter = "10 mm"', 'diameter = "30 mm"', "is wider than the bar"),
        ('distance = "1000 mm"', 'distance = "3000 mm"', "gauges.incident.distance"),
        ('recorder = "scope"\nchannels = ["tra', 'recorder = "skope"\nchannels = ["tra', "names no recorder"),
        ('file = "scope.csv"', 'file = "gone.csv"', "recorders.scope.file"),
        ("punching = false", "punshing = false", "did you mean 'punching'"),
        ('channels = ["inc (V)"]', 'channels = ["ink (V)"]', "ink (V)"),
        ('baseline = ["20 us", "100 us"]', 'baseline = ["20 us", "20.2 us"]', "baseline"),
        ('strain_per_volt = "0.001 1/V"', 'strain_per_volt = "0.001 V"', "strain per volt"),
    ],
)
def test_a_bad_declaration_is_one_line_with_its_cure(tmp_path, old, new, named):
    folder = shot(tmp_path / "shot")
    text = (folder / "shot.toml").read_text()
    assert old in text
    (folder / "shot.toml").write_text(text.replace(old, new))
    err = run_kolsky("waves", folder, code=2).stderr
    assert named in err
    assert "Traceback" not in err
    assert not (folder / "results").exists()


def test_no_pulse_is_said_with_the_gauge(tmp_path):
    folder = shot(tmp_path / "shot")
    text = (folder / "shot.toml").read_text()
    (folder / "shot.toml").write_text(text.replace('load = "compression"', 'load = "tension"'))
    err = run_kolsky("waves", folder, code=2).stderr
    assert "incident gauge" in err


def test_a_hostile_name_is_escaped_and_stays_in_its_folder(tmp_path):
    folder = shot(tmp_path / "shot", name='"<script>alert(1)</script>../../x"')
    run_kolsky("waves", folder)
    page = (folder / "results" / "waves.html").read_text(encoding="utf-8")
    assert "<script>" not in page
    assert "&lt;script&gt;" in page
    assert sorted(path.name for path in tmp_path.iterdir()) == ["shot"]


def test_repeats_give_a_mean_with_a_band_that_covers(tmp_path):
    folders = [shot(tmp_path / name, name=f'"{name}"', seed=seed) for seed, name in enumerate("abc")]
    arguments = ["repeats", *map(str, folders), "--out", str(tmp_path / "mean"), "--figures", "svg", "--json"]
    result = run_kolsky(*arguments)
    said = json.loads(result.stdout)
    assert said["tests"] == ["a", "b", "c"]
    low, high = said["largest_mean_stress"]["band"]
    # The largest of a noisy plateau lies above it by some of its noise, 1e-6 of strain or 0.8 MPa a sample.
    assert low < STRESS + 2e6
    assert high > STRESS
    # What is shared, 2 % from the declared diameter, is not lowered by repeating.
    assert 0.5 * (high - low) > 1.9 * 0.02 * STRESS
    table = np.genfromtxt(tmp_path / "mean" / "repeats.csv", delimiter=",", skip_header=1)
    middle = (table[:, 0] > 0.08) & (table[:, 0] < 0.22)  # of 0.31 in all; the ramps are outside
    assert np.mean(table[middle, 1]) == pytest.approx(STRESS, rel=1e-3)
    assert (tmp_path / "mean" / "figures" / "repeats.svg").exists()


def test_one_shot_is_no_repeat(tmp_path):
    result = run_kolsky("repeats", shot(tmp_path / "a"), "--out", tmp_path / "mean", code=2)
    assert "2 or more" in result.stderr


SHUNT = 'gain = 100, shunt = {{ resistance = "100 kohm", step = "{step} V" }}'
STEP = 100.0 * 5.0 * (120.0 / 100120.0) / (2.0 * (2.0 - 120.0 / 100120.0))
"""100 kohm across one arm of 120 ohm, times gain and excitation, in a bridge of equal arms."""


@pytest.mark.parametrize(
    ("step", "named"), [(-STEP, "correct the sign"), (2.0 * STEP, "ratio of 2"), (0.0, "not 0 V")]
)
def test_a_shunt_that_contradicts_is_refused(tmp_path, step, named):
    folder = shot(tmp_path / "shot")
    text = (folder / "shot.toml").read_text()
    (folder / "shot.toml").write_text(text.replace("gain = 100", SHUNT.format(step=step)))
    err = run_kolsky("waves", folder, code=2).stderr
    assert named in err
    assert "gauges.transmission.bridge" in err


def test_a_shunt_gives_the_gain(tmp_path):
    """A step 1 % larger than stated gain and excitation make it lowers every strain by 1 %."""
    stresses = []
    for scale in (1.0, 1.01):
        folder = shot(tmp_path / f"shot{scale}")
        text = (folder / "shot.toml").read_text()
        (folder / "shot.toml").write_text(text.replace("gain = 100", SHUNT.format(step=scale * STEP)))
        run_kolsky("waves", folder, "--json")
        with h5py.File(folder / "results" / "waves.h5") as file:
            stresses.append(file["entry/reduction/one_wave/stress"][()].max())
    assert stresses[0] / stresses[1] == pytest.approx(
        1.01, rel=1e-5
    )  # a half bridge bends by its strain, 3e-4

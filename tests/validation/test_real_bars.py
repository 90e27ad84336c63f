"""Bar signals of other laboratories, epoxy (Yao) and OFE copper (Los Alamos), and their sources."""

import gzip
from dataclasses import dataclass
from functools import cache
from math import erf, exp, log, pi, sqrt
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from kolsky.bars.guides.waveguide import ElasticWaveguide
from kolsky.bars.records import BarSignal, History, Signal
from kolsky.bars.reduction.separation import face_waves
from kolsky.bars.reduction.stress_strain import (
    cauchy_stress,
    correct_punching,
    hencky_strain,
    integrated,
    reduce,
)
from kolsky.bars.reduction.summary import summarise
from kolsky.bars.reduction.windows import check_windows, find_windows, incident_arrival
from kolsky.bars.signals.arrival import find_arrival
from kolsky.bars.signals.bridge import Linear
from kolsky.bars.signals.stations import bar_signal
from kolsky.base.apparatus import Bar, Specimen
from kolsky.readers.layout import Layout
from kolsky.readers.recordings import read_contents, read_recordings

BARS = Path(__file__).resolve().parent.parent.parent.parent / "shared" / "data" / "bars"
SIDES = ("incident", "transmission")
SHEET = {"one wave": "2w", "three waves": "3w"}
"""What the authors of the epoxy data call an analysis: their "2w" has the reflected and transmitted wave."""


Reduced = SimpleNamespace


def reduced(signals: tuple[BarSignal, BarSignal], specimen: Specimen, *, dispersion: bool) -> Reduced:
    """Find the pulses, carry them to the faces, reduce."""
    bars = tuple(signal.bar for signal in signals)
    guides = (ElasticWaveguide(bars[0]), ElasticWaveguide(bars[1])) if dispersion else None
    arrival = incident_arrival(signals[0])
    faces = face_waves(*signals, find_windows(*signals), guides=guides, arrival=arrival.time)
    reduction = reduce(faces, specimen, guides=guides)
    return Reduced(
        signals=signals,
        specimen=specimen,
        arrival=arrival,
        seen=check_windows(*signals),
        faces=faces,
        reduction=reduction,
        summary=summarise(reduction, faces, specimen),
        balanced=reduction.balanced,
        punching=correct_punching(reduction, specimen, *bars, apply=False)[1],
    )


def plateau_of(test: Reduced) -> tuple[float, float]:
    """The plateau's span [s]."""
    span = test.summary.plateau.span
    return span.first, span.last


EPOXY = Specimen(diameter=0.010, length=0.004, density=1200.0)
"""experiment_details.txt; the density, not given, is an epoxy's and is not used."""
EPOXY_BARS = (Bar(0.020, 2.1, 210e9, 7800.0), Bar(0.020, 1.8, 210e9, 7800.0))
EPOXY_GAUGES = (1.018, 0.741)


@cache
def epoxy(sample: int, *, dispersion: bool) -> Reduced:
    """Sample 1 or 2 of the epoxy data; strain = volts x 0.000501, raw compression negative."""
    folder = BARS / "yao_epoxy"
    # Sample 1: the time column is rounded to 1 us, the recorder's interval is 80.006 ns.
    layout = Layout(interval=80.006e-9, start=-198e-6, unit="V") if sample == 1 else Layout(unit="V")
    path = folder / ("sample_01_raw_voltage.csv" if sample == 1 else "sample_02_raw_voltage.xlsx")
    names = [f"{side}_bar_signal/voltage" for side in SIDES]
    recordings = read_recordings(path, names, layout=layout)
    signals = tuple(
        bar_signal(
            [recordings[name]], Linear(0.000501), bar, x, side,
            baseline=(-197e-6, -25e-6), clock_offset=0.0, compression=-1,
        ).signal
        for name, bar, x, side in zip(names, EPOXY_BARS, EPOXY_GAUGES, SIDES, strict=True)
    )  # fmt: skip
    return reduced(signals, EPOXY, dispersion=dispersion)


@cache
def by_hand(sample: int) -> dict[str, np.ndarray]:
    """The authors' columns, with "time" from the arrival of their own incident column."""
    with gzip.open(BARS / "yao_epoxy" / f"sample_{sample:02d}_hand_processed.csv.gz", "rt") as file:
        table = np.genfromtxt(file, delimiter=",", names=True)
    columns = {name: np.asarray(table[name], dtype=np.float64) for name in table.dtype.names}
    step = float(columns["t_s"][1])
    pulse = Signal(0.0, step, columns["eps_i"], float(columns["eps_i"][1:150].std()), "1", "sheet")
    found = find_arrival(pulse, sign=1, average=0.020 / EPOXY_BARS[0].wave_speed)
    return columns | {"time": columns["t_s"] - found.time}


@dataclass(frozen=True)
class Against:
    """A number of this package beside the authors'."""

    ours: float
    theirs: float

    @property
    def off(self) -> float:
        """Relative difference [-]."""
        return self.ours / self.theirs - 1.0


@cache
def compared(sample: int, *, dispersion: bool = False) -> dict[tuple[str, str], Against]:
    """(analysis, quantity) -> both numbers; mean stresses over the same stretch of time after the arrival."""
    test, sheet = epoxy(sample, dispersion=dispersion), by_hand(sample)
    found = {}
    for analysis, name in SHEET.items():
        strain, stress = test.reduction.strain[analysis], test.reduction.stress[analysis]
        theirs = sheet[f"stress_{name}_MPa"] * 1e6
        found[analysis, "largest strain"] = Against(strain.value.max(), sheet[f"strain_{name}"].max())
        end = min(test.reduction.time[-1], sheet["time"][-1])
        for words, span in (
            ("mean stress, whole test", (0.0, end)),
            ("mean stress, plateau", plateau_of(test)),
        ):
            inside = (sheet["time"] >= span[0]) & (sheet["time"] <= span[1])
            own = (test.reduction.time >= span[0]) & (test.reduction.time <= span[1])
            ours = float(stress.value[own].mean())
            found[analysis, words] = Against(ours, float(theirs[inside].mean()))
    return found


COPPER = Specimen(diameter=6.34e-3, length=3.204e-3, density=8940.0)
COPPER_LENGTH = 0.762
"""Bars' length [m], not in the file: twice the gauge's distance, for the gauges sit in the middle."""


@cache
def copper_facts() -> dict[str, float]:
    """What the file of the copper shot says of bars and gauges, SI."""
    metadata = read_contents(_copper_file()).metadata
    said = {key.split("(")[0].strip(): value for key, value in metadata.items()}
    return {
        "modulus": 1e9 * float(said["Incident Bar Young's Modulus"]),
        "density": 1e3 * float(said["Incident Bar Density"]),  # it says kg/m^3 and means g/cm^3
        "poisson": float(said["Incident Bar Poisson Ratio"]),
        "speed": float(said["Incident Bar Rod Sound Speed"]),
        "diameter": 1e-3 * float(said["Incident Bar Diameter"]),
        "gauge": 1e-3 * float(said["Incident Bar Strain Gage Location"]),
        "reflected time": 1e-6 * float(said["Incident Bar Calibrated Reflected Time"]),
        "incident factor": float(said["Incident Bar Calibrated Gage Factor"]),
        "transmission factor": float(said["Transmitted Bar Calibrated Gage Factor"]),
        "gain": float(said["Incident/Reflected Bar Gain"]),
        "excitation": float(said["Incident Bar Excitation Voltage"]),
    }


def _copper_file() -> Path:
    return BARS / "lanl_cu" / "20061201_1148HE_CuOFE_273K.raw"


@cache
def copper(*, dispersion: bool, calibrated: bool = True) -> Reduced:
    """The copper shot, its incident gauge where the calibrated reflected time puts it, or as said.

    The way there and back took 156.6 us in the laboratory's calibration; 2 x 381 mm at their rod speed take
    153.2 us.
    """
    said = copper_facts()
    bar = Bar(said["diameter"], COPPER_LENGTH, said["modulus"], said["density"], said["poisson"])
    places = {"incident": 0.5 * said["speed"] * said["reflected time"] if calibrated else said["gauge"]}
    names = ("Incident/Reflected Waveform", "Transmitted Waveform")
    recordings = read_recordings(_copper_file(), names)
    signals = tuple(
        bar_signal(
            [recordings[name]],
            Linear(2.0 / (said[f"{side} factor"] * said["gain"] * said["excitation"])),
            bar, places.get(side, said["gauge"]), side,
            baseline=(-50e-6, -10e-6), clock_offset=0.0, compression=1,
        ).signal
        for name, side in zip(names, SIDES, strict=True)
    )  # fmt: skip
    return reduced(signals, COPPER, dispersion=dispersion)


def imbalance_left(test: Reduced) -> float:
    """Root mean square of R from 10 us to 50 us after the arrival [-]."""
    r = test.reduction
    inside = (r.time > 10e-6) & (r.time < 50e-6)
    return float(np.sqrt(np.mean(r.imbalance[inside] ** 2)))


def johnson_cook(strain: float, rate: float) -> float:
    """Flow stress of OFHC copper at room temperature, isothermal [Pa] (Johnson and Cook 1983)."""
    return (90e6 + 292e6 * strain**0.31) * (1.0 + 0.025 * log(rate))


def preston_tonks_wallace(strain: float, rate: float) -> float:
    """Flow stress of annealed copper at 300 K, isothermal [Pa] (Preston, Tonks and Wallace 2003).

    Their Voce hardening at thermally activated rates, with their parameters of copper; the yield stress of
    the annealed metal does not depend on rate there.
    """
    theta, p, s0, s_inf, y0, kappa, gamma = 0.025, 2.0, 0.0085, 0.00055, 0.0001, 0.11, 1e-5
    warmth = 300.0 / 1357.0  # of melting
    shear, density, atom = 51.8e9 * (1.0 - 0.2 * warmth), 8930.0, 63.546 * 1.66054e-27
    fastest = 0.5 * (4.0 * pi * density / (3.0 * atom)) ** (1 / 3) * sqrt(shear / density)
    saturated = s0 - (s0 - s_inf) * erf(kappa * warmth * log(gamma * fastest / rate))
    rise = p * (saturated - y0) / (s0 - y0)
    passed = exp(-p * theta * strain / ((s0 - y0) * (exp(rise) - 1.0)))
    return 2.0 * shear * (saturated + (s0 - y0) / p * log(1.0 - (1.0 - exp(-rise)) * passed))


def flow_stress(test: Reduced, strain: float, *, analysis: str = "one wave") -> tuple[float, float]:
    """True stress [Pa] and true rate [1/s] at a true strain, averaged over 4 us about it."""
    r = test.reduction
    e, s = hencky_strain(r.strain[analysis]), cauchy_stress(r.stress[analysis], r.strain[analysis])
    at = float(r.time[np.argmax(e.value >= strain)])
    inside = np.abs(r.time - at) <= 2e-6
    rate = r.rate[analysis].value[inside] / (1.0 - r.strain[analysis].value[inside])
    return float(s.value[inside].mean()), float(rate.mean())


pytestmark = pytest.mark.skipif(
    not BARS.is_dir(), reason="no folder 'shared' beside the repository: its data are not shipped"
)


@pytest.mark.parametrize("dispersion", [False, True], ids=["shifted", "dispersed"])
@pytest.mark.parametrize("sample", [1, 2])
def test_epoxy_meets_the_hand_processing(sample, dispersion):
    """Largest strain within 0.5 %, mean stress within 1 %, by both analyses; no window is the sheet's."""
    for (_, quantity), pair in compared(sample, dispersion=dispersion).items():
        # Issue's targets; the baseline alone makes 0.2 % and 0.7 % (sample 1, see the page).
        assert abs(pair.off) < (0.005 if quantity == "largest strain" else 0.01), (quantity, pair)


@pytest.mark.parametrize("sample", [1, 2])
def test_the_sheets_columns_are_what_the_page_says(sample):
    """Their "2w" is one wave, their "3w" three, of their aligned waves; their strain a rectangular sum."""
    sheet, step = by_hand(sample), 8.000643e-8
    i, r, t = (sheet[f"eps_{name}"] for name in "irt")
    stiffness, area, c0, length = 210e9 * np.pi * 0.01**2, np.pi * 0.005**2, 5188.0, 0.004
    rates = {"2w": -2 * c0 / length * r, "3w": c0 / length * (i - r - t)}
    stresses = {"2w": stiffness * t / area, "3w": stiffness * (i + r + t) / (2 * area)}
    for name in rates:  # eight digits are written
        np.testing.assert_allclose(sheet[f"rate_{name}"], rates[name], rtol=1e-6, atol=1e-3)
        np.testing.assert_allclose(sheet[f"stress_{name}_MPa"], 1e-6 * stresses[name], rtol=1e-6, atol=1e-5)
        np.testing.assert_allclose(sheet[f"strain_{name}"], np.cumsum(rates[name]) * step, atol=1e-7)


@pytest.mark.parametrize("sample", [1, 2])
def test_epoxy_is_in_equilibrium_and_conserves_energy(sample):
    test = epoxy(sample, dispersion=False)
    first, last = test.balanced
    assert 40e-6 < first < 80e-6  # after the transmitted pulse's rise, which ends at 60 to 90 us
    assert last - first > 75e-6
    energy = test.summary.energy
    # What the faces do and what deforms differ by the work of the imbalance, a few per cent of it.
    assert energy.deformation == pytest.approx(energy.absorbed, rel=0.02)
    assert test.summary.modulus is None


@pytest.mark.parametrize("sample", [1, 2])
def test_reflected_pulses_arrive_when_predicted(sample):
    reflected, transmitted = epoxy(sample, dispersion=False).seen
    assert abs(reflected.delay) < 1.5e-6  # 392 us of way at a wave speed of 0.3 %
    assert 5e-6 < transmitted.delay < 30e-6  # soft specimens are slow to load


@pytest.mark.parametrize("sample", [1, 2])
def test_sigma_of_a_strain_is_that_of_real_noise(sample):
    """Integrals over 20 stretches of rest against the sigma, with the noise's memory in it."""
    for signal in epoxy(sample, dispersion=False).signals:
        strain = signal.strain
        rest = strain.value[:2000].reshape(20, 100)
        white = strain.sigma * np.sqrt(strain.memory)
        history = [History(part, np.full(100, strain.sigma), "1") for part in rest - rest.mean()]
        ends = [integrated(part, 1.0, sigma=white) for part in history]
        # A standard deviation of 20 has 16 % scatter, a memory from 2000 samples about as much, and the drift
        # of the baseline comes on top: a correction of its own.
        said = float(ends[0].sigma[-1])
        assert 0.6 * said < np.std([part.value[-1] for part in ends]) < 1.7 * said


def test_the_copper_file_says_all_that_is_needed():
    said = copper_facts()
    assert said["speed"] == pytest.approx(np.sqrt(said["modulus"] / said["density"]), rel=1e-5)
    assert (said["gain"], said["excitation"], said["gauge"]) == (200.0, 8.0, 0.381)


def test_the_copper_record_confirms_the_calibrated_reflected_time():
    """Seen in the record within 0.1 us of the laboratory's 156.6 us, which the distance misses by 3.4 us."""
    said = copper_facts()
    as_said = copper(dispersion=False, calibrated=False).seen[0]
    way = 2 * said["gauge"] / said["speed"]
    # A pulse that starts as steep as the reference; 0.1 us is one sample.
    assert way + as_said.delay == pytest.approx(said["reflected time"], abs=0.1e-6)
    assert abs(copper(dispersion=False).seen[0].delay) < 0.1e-6


def test_dispersion_and_place_bring_the_copper_into_balance():
    left = {
        (dispersion, calibrated): imbalance_left(copper(dispersion=dispersion, calibrated=calibrated))
        for dispersion in (False, True)
        for calibrated in (False, True)
    }
    both = left.pop((True, True))
    assert both < 0.8 * min(left.values())
    span = copper(dispersion=True).balanced
    assert span[1] - span[0] > 20e-6  # of a pulse of 60 us


def test_copper_flows_as_copper():
    """Within 15 % of Preston, Tonks and Wallace at strains 0.05 to 0.15; Johnson and Cook lie above."""
    test = copper(dispersion=True)
    for strain in (0.05, 0.10, 0.15):
        stress, rate = flow_stress(test, strain)
        assert 2000.0 < rate < 5000.0
        assert stress == pytest.approx(preston_tonks_wallace(strain, rate), rel=0.15)
        assert stress < johnson_cook(strain, rate)

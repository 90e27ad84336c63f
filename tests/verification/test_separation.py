"""Separation of overlapping waves by gauges on one bar, steel and polymer, with and without noise."""

from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from bar_pulses import Pulse, carried, exact_wavenumber
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scene import FloatArray

from kolsky.bars.guides.waveguide import ElasticWaveguide, PronyModulus, ViscoelasticWaveguide, Waveguide
from kolsky.bars.records import BarSignal, Signal
from kolsky.bars.reduction.separation import SeparatedWaves, separate
from kolsky.base.apparatus import Bar

FIGURE_SIZE = (6.7, 5.6)
STEEL = Bar(0.02, 1.5, 210e9, 7800.0, 0.29)
NYLON = Bar(0.02, 1.5, 5e9, 1190.0, 0.35)
MODULUS = PronyModulus(5.0e9, (0.5e9,), (12e-6,))
NOISE = 2e-3  # standard deviation of a sample over the pulse's plateau
REPEATS = 20  # records with noise of their own
PLACES = {"two gauges": (0.9, 0.3), "three gauges": (0.9, 0.55, 0.3)}  # distances from the specimen [m]
TARGET = 2e-3  # allowed error of a separated wave over the plateau [-]: what the correction of a test needs
SCATTER_TOLERANCE = 0.1
"""Allowed distance of scatter over sigma from 1: 20 records, whole waves at a time, tell it to 2 %, and sigma
leaves out what noise before the record would add."""


@dataclass(frozen=True)
class Scene:
    """A bar with a known wave in either direction."""

    guide: Waveguide
    bar: Bar  # its properties
    toward: Pulse  # wave toward the specimen, a clean pulse at the bar's far end
    away: Pulse  # wave from the specimen, a clean pulse at its face
    share: float  # height of the latter
    omega: FloatArray  # frequencies of the Fourier integrals [rad/s]
    wavenumber: NDArray[np.complex128]  # wavenumbers there [rad/m]
    time: FloatArray  # times of the records [s]

    def waves(self, x: float, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Both waves at a distance from the specimen [m]."""
        turn = np.exp(-1j * self.wavenumber * (self.bar.length - x))
        back = np.exp(-1j * self.wavenumber * x)
        return (
            carried(self.toward, time, self.omega, turn),
            self.share * carried(self.away, time, self.omega, back),
        )

    def gauge(self, x: float, noise: FloatArray | float = 0.0, sigma: float = 0.0) -> BarSignal:
        """The strain at a distance from the specimen [m]."""
        value = sum(self.waves(x, self.time)) + noise
        step = float(self.time[1] - self.time[0])
        return BarSignal(Signal(float(self.time[0]), step, value, sigma, "1"), self.bar, x, "incident")


@cache
def scene(name: str) -> Scene:
    """Steel with a rise of 5 µs, or a polymer, whose high frequencies fade, with one of 40 µs."""
    if name == "steel":
        toward, away = Pulse(60e-6, duration=150e-6), Pulse(340e-6, duration=120e-6, rise=10e-6, ripple=0.03)
        omega = toward.frequencies(2e-3)
        k = exact_wavenumber(omega, radius=0.01, speed=STEEL.wave_speed, poisson=STEEL.poisson)
        time = 2e-7 * np.arange(5000)
        return Scene(ElasticWaveguide(STEEL), STEEL, toward, away, -0.6, omega, k.astype(complex), time)
    guide = ViscoelasticWaveguide(NYLON, MODULUS)
    toward, away = (
        Pulse(100e-6, duration=300e-6, rise=40e-6, ripple=0.0),
        Pulse(850e-6, duration=250e-6, rise=60e-6, ripple=0.0),
    )
    omega = toward.frequencies(6e-3)
    return Scene(guide, NYLON, toward, away, -0.6, omega, guide.wavenumber(omega), 1e-6 * np.arange(3000))


Result = SimpleNamespace


def _noisy(places: tuple[float, ...], seed: int, gain: float = 1.0) -> SeparatedWaves:
    steel = scene("steel")
    rng = np.random.default_rng(seed)
    noise = NOISE * rng.standard_normal((len(places), steel.time.size))
    gauges = [steel.gauge(x, n, NOISE) for x, n in zip(places, noise, strict=True)]
    if gain != 1.0:
        middle = gauges[1]
        strain = middle.strain
        scaled = Signal(strain.start, strain.interval, gain * strain.value, NOISE, "1")
        gauges[1] = BarSignal(scaled, middle.bar, middle.position, middle.side)
    return separate(gauges, steel.guide)


@cache
def case() -> Result:
    """Both bars without noise, steel with it."""
    clean, exact, errors, overlap = {}, {}, {}, {}
    for name in ("steel", "polymer"):
        bar = scene(name)
        found = separate([bar.gauge(x) for x in PLACES["two gauges"]], bar.guide)
        waves = bar.waves(0.0, found.time)
        clean[name], exact[name] = found, waves
        errors[name] = (
            float(np.abs(found.toward.value - waves[0]).max()),
            float(np.abs(found.away.value - waves[1]).max()),
        )
        near = np.abs(bar.waves(PLACES["two gauges"][1], bar.time))
        overlap[name] = float((near > 0.1).all(axis=0).sum() * (bar.time[1] - bar.time[0]))
    scatter, sigma, ratio = {}, {}, {}
    for name, places in PLACES.items():
        runs = [_noisy(places, seed) for seed in range(REPEATS)]
        true = scene("steel").waves(0.0, runs[0].time)
        away = np.array([run.away.value for run in runs]) - true[1]
        toward = np.array([run.toward.value for run in runs]) - true[0]
        sigma[name], scatter[name] = runs[0].away.sigma, np.sqrt(np.mean(away**2, axis=0))
        squares = [
            (error / run)[:, run > 0.5 * run.max()] ** 2
            for error, run in ((away, runs[0].away.sigma), (toward, runs[0].toward.sigma))
        ]
        ratio[name] = float(np.sqrt(np.mean(np.concatenate([part.ravel() for part in squares]))))
    return Result(
        clean=clean,  # separated waves without noise, by the bar
        exact=exact,  # the waves at the face at the same times
        errors=errors,  # largest error of the waves toward and away [-], by the bar
        overlap=overlap,  # Time for which both waves exceed a tenth of the plateau at the nearer gauge [s].
        # Standard deviation of `away` over the records with noise [-], by the gauges, shape [n].
        scatter=scatter,
        sigma=sigma,  # stated sigma of `away` [-], shape [n]
        # Root mean square of error over sigma [-], both waves, where sigma is half its largest or more.
        ratio=ratio,
        misfit=_noisy(PLACES["three gauges"], 0).misfit,  # misfits of three gauges in one of the records [-]
        wrong=_noisy(PLACES["three gauges"], 0, 1.02).misfit,  # the same with the middle gauge 2 % too high
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the figure of the page."""
    axes = figure.subplots(3, 2, height_ratios=(1.0, 1.2, 0.9))
    for column, name in enumerate(("steel", "polymer")):
        bar, found, exact = scene(name), result.clean[name], result.exact[name]
        top, middle = axes[0, column], axes[1, column]
        for x in PLACES["two gauges"]:
            top.plot(1e6 * bar.time, bar.gauge(x).strain.value, label=f"gauge at {x:g} m")
        top.legend(loc="lower left" if column == 0 else "upper right")
        top.tick_params(labelbottom=False)
        for wave, label, true in ((found.toward, "toward", exact[0]), (found.away, "away", exact[1])):
            (line,) = middle.plot(1e6 * found.time, wave.value, label=label)
            every = slice(None, None, max(1, found.time.size // 60))
            middle.plot(
                1e6 * found.time[every], true[every], "o", color=line.get_color(), markersize=2.2,
                fillstyle="none",
            )  # fmt: skip
        middle.legend(loc="lower left" if column == 0 else "upper right")
        for panel in (top, middle):
            panel.set_xlim(0.0, 1e6 * bar.time[-1])
        middle.set_xlabel("time [µs]")
    axes[0, 0].set_ylabel("strain over plateau [-]")
    axes[1, 0].set_ylabel("strain at the face\nover plateau [-]")
    steel = result.clean["steel"].time
    for column, name in enumerate(PLACES):
        panel = axes[2, column]
        n = result.sigma[name].size
        panel.plot(
            1e6 * steel[:n], 1e3 * result.scatter[name], color="#56B4E9", linewidth=0.4, label="scatter"
        )
        panel.plot(1e6 * steel[:n], 1e3 * result.sigma[name], "k-", label=f"sigma, {name}")
        panel.set(xlabel="time [µs]", xlim=(0.0, 1e6 * scene("steel").time[-1]), ylim=(0.0, 9.0))
        panel.legend(loc="upper left")
    axes[2, 0].set_ylabel("of plateau [‰]")


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    clean = [
        [name, f"{1e6 * result.overlap[name]:.0f}", *(f"{100 * error:.1e}" for error in result.errors[name])]
        for name in result.errors
    ]
    noisy = [
        [
            name,
            ", ".join(f"{x:g}" for x in places),
            f"{1e3 * result.sigma[name].max():.1f}",
            f"{result.ratio[name]:.3f}",
        ]
        for name, places in PLACES.items()
    ]
    misfit = ", ".join(f"{value:.2f}" for value in result.misfit)
    wrong = ", ".join(f"{value:.2f}" for value in result.wrong)
    far, near = PLACES["two gauges"]
    ratios = list(result.ratio.values())
    return locals()


pytestmark = pytest.mark.slow  # forty separations


def test_overlapping_waves_are_told_apart() -> None:
    result = case()
    for name, errors in result.errors.items():
        assert max(errors) < TARGET, name
        assert result.overlap[name] > 50e-6


def test_sigma_is_the_scatter() -> None:
    for name, ratio in case().ratio.items():
        assert ratio == pytest.approx(1.0, abs=SCATTER_TOLERANCE), name


def test_a_third_gauge_lowers_the_noise_and_shows_a_wrong_gain() -> None:
    result = case()
    assert result.sigma["three gauges"].max() < result.sigma["two gauges"].max()
    assert max(result.misfit) < 1.1  # three gauges, two waves: each misfit is between 0 and 1
    assert max(result.wrong) > 2.0

"""Shots of known stiffness at several flyer velocities, through `identify`, to a mean and a slope."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from kolsky_command import run_kolsky
from module_files import module_at
from scipy.stats import chi2
from shot_evidence import ShotEvidence

from kolsky.identification import identify
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics, Settings
from kolsky.material.relaxation.rate_fit import required_branches
from kolsky.results.hdf5 import write_identification
from kolsky.shot.load import load_shot
from kolsky.studies.rates.comparison import compare
from kolsky.studies.rates.rate import RESULT_FILE, collected_shot
from kolsky.studies.rates.records import GroupRates, RatedShot, ShapeAtStrain
from kolsky.studies.rates.scatter import SlopeVerdict

SCRIPT = Path(__file__).resolve().parents[2] / "runs" / "rate_shots.py"
COARSE = Settings(
    free={"stiffness_factor": (0.9, 1.4)},
    numerics=Numerics(mesh=(16, 22)),
    refined_mesh=(24, 32),
    replicates=2,
)
SPEEDS = (0.7, 0.8, 1.6, 4.0, 4.6)
LENGTH = 6.5e-3
TILT = 0.15  # change of the true stiffness factor per decade in the second set


@pytest.fixture(scope="module")
def maker() -> ModuleType:
    return module_at(SCRIPT)


def truth(speed: float, tilt: float) -> float:
    """The stiffness factor of a shot."""
    return 1.12 + tilt * float(np.log10(speed / 1.6))


def scatter(shapes: list[ShapeAtStrain]) -> tuple[float, float]:
    """Standard deviation between shots of radius and residual [m], rms over 41 common relative heights."""
    heights = [shape.y / (LENGTH * (1.0 - shape.at)) for shape in shapes]
    grid = np.linspace(max(h[0] for h in heights), min(h[-1] for h in heights), 41)
    rows = []
    for height, shape in zip(heights, shapes, strict=True):
        seen = np.isfinite(shape.model)
        left = np.interp(grid, height[seen], (shape.Z - shape.model)[seen], left=np.nan, right=np.nan)
        rows.append((np.interp(grid, height, shape.Z), left))
    radius, residual = np.var(rows, axis=0, ddof=1)
    return float(np.sqrt(radius.mean())), float(np.sqrt(np.nanmean(residual)))


@pytest.fixture(scope="module")
def made(maker: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Callable[[int, float], Path]:
    """The folder of the shot of a speed's number and a true stiffness factor, made once."""

    @cache
    def folder(number: int, m: float) -> Path:
        place = tmp_path_factory.mktemp("rates") / f"shot-{number}"
        # Answers are corrected to an infinitely fine mesh: the truth's is twice as fine, and graded.
        numerics = Numerics(mesh=(48, 64), grading=5.0)
        maker.make(place, SPEEDS[number], m, seed=number, numerics=numerics)
        return place

    return folder


@pytest.fixture(scope="module")
def collected(made: Callable[[int, float], Path]) -> Callable[[int, float], RatedShot]:
    """That shot, identified once."""

    @cache
    def found(number: int, m: float) -> RatedShot:
        place = made(number, m)
        (place / "results").mkdir()
        write_identification(place / "results" / RESULT_FILE, identify(load_shot(place), COARSE))
        return collected_shot(place, group="gel")

    return found


def compared(collected: Callable[[int, float], RatedShot], tilt: float) -> GroupRates:
    # The speed at which both truths are one gives one and the same shot to both sets.
    shots = [collected(number, truth(speed, tilt)) for number, speed in enumerate(SPEEDS)]
    (group,) = compare(shots).groups
    assert len(group.counted) == len(SPEEDS)
    return group


@pytest.mark.long
@pytest.mark.parametrize("tilt", [0.0, TILT])
def test_the_slope_of_known_shots(collected, tilt):
    group = compared(collected, tilt)
    line, pooled, e = group.slope, group.pooled, group.equal_strain
    assert line is not None
    assert line.fit is not None
    assert pooled is not None
    assert e is not None
    errors = []
    for shot, speed in zip(group.shots, SPEEDS, strict=True):
        e_m = shot.found.estimates["stiffness_factor"]
        errors.append((e_m.value - truth(speed, tilt)) / e_m.sigma)
        # The flyer keeps nearly its speed; from 1 % strain on the drag takes up to 15 % of it.
        assert 0.85 < shot.history.nominal_rate / (speed / LENGTH) < 1.0
    # Five k = 2 intervals hold five truths in 79 % of tests; what right ones stay below jointly in 95.45 %.
    assert np.square(errors).sum() < chi2.ppf(0.9545, len(errors)), errors
    low, high = line.fit.interval(1)
    assert low < tilt < high
    assert high - low < 0.05  # five shots of half a percent over 0.8 decade
    assert line.verdict is (SlopeVerdict.SENSITIVE if tilt else SlopeVerdict.NONE_SEEN)
    if not tilt:
        assert pooled.interval[0] < 1.12 < pooled.interval[1]
    # The paper's observation (Fig. 13): outlines at equal strain scatter by a tenth of a millimetre, and the
    # simulations explain nearly all of it. Noise of 4 um is what is left here.
    at = [[shape for shape in e.shapes if shape.strain == strain] for strain in e.strains]
    outlines, residuals = zip(*map(scatter, at), strict=True)
    assert 30e-6 < outlines[0] < 300e-6
    assert max(residuals) < 8e-6


@pytest.mark.long
def test_the_five_together_by_the_command(made: Callable[[int, float], Path], tmp_path: Path) -> None:
    folders = [str(made(number, truth(speed, 0.0))) for number, speed in enumerate(SPEEDS)]
    meshes = ["--mesh", "16x22", "--refined-mesh", "24x32", "--free", "stiffness_factor=0.9:1.4"]
    run_kolsky("identify", *folders, *meshes, "--out", tmp_path / "j", "--json")
    found = json.loads((tmp_path / "j" / "joint.json").read_text("utf-8"))
    estimate, scatter = found["estimates"]["stiffness_factor"], found["scatter_between_shots"]
    low, high = estimate["interval_95"]
    assert low < 1.12 < high
    assert high - low < 0.02  # five shots of half a percent each, Student's t with four degrees of freedom
    # The shots are made with one m: what they scatter by is what the mesh does at different speeds.
    assert scatter["value"] < 0.005
    assert scatter["value"] * estimate["value"] < 2.0 * estimate["sigma"]


OPEN_01 = Path(__file__).resolve().parents[2] / "runs" / "open-01"


@pytest.mark.slow
def test_an_elastic_shot_does_not_ask_for_rate_dependence() -> None:
    prepared = prepare_shot(load_shot(OPEN_01))
    evidence = ShotEvidence.of(prepared, Numerics(mesh=(12, 16), threads=1))
    verdict = required_branches(prepared.forward.laws[0], [evidence], at_most=1, max_evaluations=12)
    assert verdict.branches == 0
    # 1.12 planted; the mesh is half as fine in each direction as that of an identification: 3 % (measured)
    assert verdict.fit.model.factor == pytest.approx(1.12, rel=0.05)

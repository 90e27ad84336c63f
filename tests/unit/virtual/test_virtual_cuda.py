"""The virtual laboratory on a GPU: the truths, pictures and budgets of a CPU, to stated errors."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import explicit
from kolsky.inverse.settings import Numerics, Settings
from kolsky.studies.budget.realisation import Realisations, factors_of
from kolsky.virtual.make import make
from kolsky.virtual.pictures import expose_series, rig_of, scene_of
from kolsky.virtual.schema import Specification
from kolsky.virtual.specification import read_specification
from kolsky.virtual.truth import SurfaceHistory, Truth, simulate_truths

TINY = {"truth": {"mesh": [8, 11]}, "motion": {"compression": "12 %"}, "frames": {"rate": "60 kHz"}}
APART = 1e-6
"""Sums are made in another order: round-off, 1e-16, amplified by some thousand steps and contacts."""


def specification(**tables: dict[str, Any]) -> Specification:
    merged = {key: {**TINY.get(key, {}), **tables.get(key, {})} for key in {**TINY, **tables}}
    return Specification.model_validate(merged)


OTHERS = (
    {"specimen": {"diameter": "11 mm"}},
    {"material": {"law": "neo_hookean", "parameters": {"mu": 1.0}}},
    {"specimen": {"length": "5 mm"}, "imperfections": {"tilt": "0.4 deg"}},
    {"truth": {"mesh": [16, 22]}},
)


def alike(a: Truth, b: Truth) -> float:
    """Largest difference of two truths over the largest value, of force and outline."""
    force = np.abs(a.transmitted - b.transmitted).max() / np.abs(a.transmitted).max()
    return float(max(force, np.abs(a.surface.r - b.surface.r).max() / a.surface.r.max()))


def test_truths_side_by_side_are_those_of_each_alone(cuda: str) -> None:
    """The same bits as alone on the GPU; a CPU's but for round-off."""
    many = [specification(**tables) for tables in OTHERS]
    together = simulate_truths(many, device=cuda)
    for one, found in zip(many, together, strict=True):
        (alone,) = simulate_truths([one], device=cuda)
        assert np.array_equal(alone.transmitted, found.transmitted)
        assert np.array_equal(alone.surface.r, found.surface.r)
        (here,) = simulate_truths([one])
        assert alike(here, found) < APART


def test_a_failure_leaves_its_neighbours_alone(cuda: str) -> None:
    """Of two models side by side one collapses: its outcome says so, the other is what it is alone."""
    times = np.linspace(1e-6, 2e-4, 40)
    motion = explicit.PlatenMotion.sampled(lambda t: 5e4 * t**2, lambda t: 1e5 * t, start=0.0, end=times[-1])
    from explicit.materials import neo_hookean

    mesh = explicit.cylinder(4.75e-3, 6.5e-3, n_radial=6, n_axial=8, grading=2.0)
    model = explicit.Model(mesh, 870.0, (neo_hookean(27e3),), (motion,))
    right = explicit.Problem(model, explicit.Samples.of(damping=2.5e-5), explicit.Sampling(times, times))
    wrong = replace(right, stepping=explicit.Stepping(max_steps=10))
    both = explicit.run_side_by_side([wrong, right], device=cuda)
    assert both[0].outcomes[0] is explicit.Outcome.STEP_LIMIT
    alone = explicit.run(model, right.samples, right.sampling, device=cuda)
    assert np.array_equal(both[1].force_flyer, alone.force_flyer)


@pytest.mark.parametrize("side", ["up", "left"])
def test_pictures_are_the_same_but_for_a_grey_value_now_and_then(cuda: str, side: str) -> None:
    """Without noise a grey value is that of the other device but where it lies between two whole ones, or
    where a ray meets an edge: one pixel in a thousand."""
    q = Specification.model_validate(
        {
            "cameras": {"write": True, "picture": [96, 64], "sensor": [160, 160], "flyer_side": side},
            "optics": {"haze": 0.05, "highlight": 0.1, "aperture": "5 mm", "defocus": "1 mm"}
            | {"full_well": 1e7, "read_noise": 0.0, "exposure": "10 us"},
        }
    )
    time = (np.arange(4) - 1.0) / 120e3
    d = 2.6 * np.maximum(time, 0.0)
    share = np.linspace(0.0, 1.0, 33)
    y = share * (6.5e-3 - d[:, None])
    r = 4.75e-3 * np.sqrt(6.5e-3 / (6.5e-3 - d[:, None])) * (1.0 + 0.1 * share * (1.0 - share))
    surface = SurfaceHistory(time, r, y, d, 1e-3 * np.arange(4.0))
    scene, rig = scene_of(q, surface, shot=0), rig_of(q, shot=0)
    for k in (0, 1):
        here, there = (
            np.stack(list(expose_series(q, scene, rig.camera(k), k, 0, device, 1))).astype(float)
            for device in ("cpu", cuda)
        )
        far = np.abs(here - there) > 1.0 + 4.0 * np.sqrt(4095.0**2 / 1e7)
        assert far.mean() < 1e-3
        assert abs((here - there).mean()) < 0.05


def test_a_population_is_made(cuda: str, tmp_path: Path) -> None:
    """Truths on the GPU, folders by two processes: the forces of a CPU's shots but for a code."""
    (tmp_path / "SPEC.toml").write_text(
        'format = 1\n[truth]\nmesh = [8, 11]\n[motion]\ncompression = "12 %"\n[population]\nshots = 3\n'
        '[population.draw]\n"specimen.diameter" = { low = "8 mm", high = "12 mm" }\n'
    )
    series = read_specification(tmp_path)
    make(series, tmp_path / "there", device=cuda, workers=2)
    make(series, tmp_path / "here")
    for number in (1, 2, 3):
        volts = [
            np.loadtxt(tmp_path / where / f"virtual-{number}" / "scope.csv", delimiter=",", skiprows=1)
            for where in ("here", "there")
        ]
        apart = np.abs(volts[0] - volts[1])
        assert apart.max() < 1.5 * 2.0 / 4096
        assert (apart > 1e-9).mean() < 0.01


def test_a_budget_of_a_realisation(cuda: str) -> None:
    """The re-fit of one error is the CPU's within its own measure of rest."""
    test = specification(motion={"compression": "15 %"})
    factors = factors_of({"imperfections.length": "0.5 %"})
    found = []
    for device in ("cpu", cuda):
        numerics = Numerics(mesh=(6, 8), device=device)
        settings = Settings(
            free={"stiffness_factor": None}, numerics=numerics, refined_mesh=(8, 11), replicates=0
        )
        realise = Realisations(test, Path(), factors, settings, {"stiffness_factor": 1.0})
        found.append(realise(np.array([[0.0, 1.0, 0.0]]))[0])
    assert found[0].outcome == found[1].outcome
    assert found[1].results[0] == pytest.approx(found[0].results[0], rel=1e-3)

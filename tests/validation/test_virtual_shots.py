"""A virtual shot, from its files to m: the truth is another element on a finer mesh."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kolsky.inverse.forward import Numerics
from kolsky.inverse.problem import Settings
from kolsky.shot.load import load_shot
from kolsky.studies.budget.factors import factors_of
from kolsky.studies.budget.realisation import (
    RealisationOutcome,
    Realisations,
    refit,
    same_valley,
    whole_search,
)
from kolsky.virtual.make import make
from kolsky.virtual.schema import Specification
from kolsky.virtual.specification import read_specification

ALONE = {"stiffness_factor": None}


@pytest.mark.slow
@pytest.mark.parametrize(
    "material",
    [
        'law = "gent"\nparameters = { mu = 1.0, Jm = 30.0 }\nstiffness_factor = 1.2',
        'law = "arruda_boyce"\nparameters = { mu = 1.0, lambda_m = 3.0 }\nstiffness_factor = 0.95',
    ],
)
def test_right_shot_gives_its_stiffness(tmp_path: Path, material: str) -> None:
    path = tmp_path / "SPEC.toml"
    path.write_text(
        f'[material]\n{material}\n[quasi_static]\nlargest_strain = "72 %"\n[motion]\ncompression = "40 %"\n'
        "[truth]\nmesh = [48, 64]\n"
    )
    series = read_specification(path)
    make(series, tmp_path / "shot")
    meshes = {"numerics": Numerics(mesh=(16, 22)), "refined_mesh": (32, 44)}
    settings = Settings(free=ALONE, replicates=0, **meshes)
    shot = load_shot(tmp_path / "shot")
    found = whole_search(shot, settings)
    # 32 x 44 elements leave 0.4 % of a mesh's error at most, noise 0.2 %.
    assert found.values["stiffness_factor"] == pytest.approx(
        series.declared.material.stiffness_factor, rel=0.01
    )
    # Least squares on the refined mesh find the same valley again from 2 % away.
    near = refit(shot, settings, {"stiffness_factor": 1.02 * found.values["stiffness_factor"]})
    assert near.outcome is RealisationOutcome.REFITTED
    assert same_valley(near, found)


def test_realisations_of_a_budget() -> None:
    """A point without errors is answered; one that no shot file can declare is refused with its reason."""
    test = Specification.model_validate(
        {"truth": {"mesh": [8, 11]}, "motion": {"compression": "15 %"}, "frames": {"rate": "60 kHz"}}
    )
    factors = factors_of({"imperfections.poisson": 0.001})
    settings = Settings(free=ALONE, numerics=Numerics(mesh=(6, 8)), refined_mesh=(8, 11), replicates=0)
    realise = Realisations(test, Path(), factors, settings)
    right, wrong = realise(np.array([[0.0, 0.0, 1.0], [0.0, 2.0, 0.0]]))
    assert right.completed
    near, whole = right.results
    assert np.isnan(near)
    assert whole == pytest.approx(1.0, rel=0.1)  # the coarsest meshes that are
    later = replace(realise, start={"stiffness_factor": float(whole)})
    again, both = later(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert again.outcome == "re-fitted"
    # The same weights, but slopes of the refined mesh; 2e-3 are less than one standard deviation, 0.0023.
    assert again.results[0] == pytest.approx(whole, rel=2e-3)
    assert np.isnan(again.results[1])
    assert both.outcome == "same valley"
    assert both.results.tolist() == [again.results[0], whole]
    assert later.model_hash() == realise.model_hash()
    assert not wrong.completed
    assert "declared poisson = 0.501" in wrong.reason
    assert np.isnan(wrong.results).all()
    assert realise.model_hash() != Realisations(test, Path(), factors[:1], settings).model_hash()

"""A virtual shot, from its files to m: the truth is another element on a finer mesh."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from doe import Box, from_points
from kolsky.identification import identify
from kolsky.inverse.result import Identification
from kolsky.inverse.settings import Numerics, Settings
from kolsky.shot.load import load_shot
from kolsky.studies.budget import realisation
from kolsky.studies.sweep import sweep
from kolsky.virtual.make import make
from kolsky.virtual.schema import Specification
from kolsky.virtual.specification import read_specification

ALONE = {"stiffness_factor": None}


@pytest.mark.slow
@pytest.mark.parametrize(
    "material",
    [
        'law = "gent"\nparameters = { mu = 1.0, Jm = 30.0 }\nstiffness_factor = 1.2',
        pytest.param(
            'law = "arruda_boyce"\nparameters = { mu = 1.0, lambda_m = 3.0 }\nstiffness_factor = 0.95',
            marks=pytest.mark.long,  # 25 s of one core
        ),
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
    found = realisation.whole_search(shot, settings)
    # 32 x 44 elements leave 0.4 % of a mesh's error at most, noise 0.2 %.
    assert found.values["stiffness_factor"] == pytest.approx(
        series.declared.material.stiffness_factor, rel=0.01
    )
    # Least squares on the refined mesh find the same valley again from 2 % away.
    near = realisation.refit(shot, settings, {"stiffness_factor": 1.02 * found.values["stiffness_factor"]})
    assert near.outcome is realisation.RealisationOutcome.REFITTED
    assert realisation.same_valley(near, found)


def test_realisations_of_a_budget() -> None:
    """A point without errors is answered; one that no shot file can declare is refused with its reason."""
    test = Specification.model_validate(
        {"truth": {"mesh": [8, 11]}, "motion": {"compression": "15 %"}, "frames": {"rate": "60 kHz"}}
    )
    factors = realisation.factors_of({"imperfections.poisson": 0.001})
    settings = Settings(free=ALONE, numerics=Numerics(mesh=(6, 8)), refined_mesh=(8, 11), replicates=0)
    realise = realisation.Realisations(test, Path(), factors, settings)
    right, wrong = realise(np.array([[0.0, 0.0, 1.0], [0.0, 2.0, 0.0]]))
    assert right.completed
    near, whole = right.results
    assert np.isnan(near)
    assert whole == pytest.approx(1.0, rel=0.1)  # the coarsest meshes that are
    later = replace(realise, start={"stiffness_factor": float(whole)})
    again, both = later(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert again.outcome == "re-fitted"
    # The same weights, but slopes of the refined mesh, from which those of 6 x 8 elements, uniform beside
    # graded, lead three standard deviations of 0.0023 away.
    assert again.results[0] == pytest.approx(whole, rel=1e-2)
    assert np.isnan(again.results[1])
    assert both.outcome == "same valley"
    assert both.results.tolist() == [again.results[0], whole]
    assert later.model_hash() == realise.model_hash()
    assert not wrong.completed
    assert "declared poisson = 0.501" in wrong.reason
    assert np.isnan(wrong.results).all()
    assert realise.model_hash() != realisation.Realisations(test, Path(), factors[:1], settings).model_hash()


SHOT = Path(__file__).resolve().parents[2] / "runs" / "open-01"
COARSE = Numerics(mesh=(12, 16))


@cache
def held(**values: float) -> Identification:
    settings = Settings(
        free={"stiffness_factor": None}, held=values, numerics=COARSE, refined_mesh=(16, 22), replicates=0
    )
    return identify(load_shot(SHOT), settings)


def m(result: Identification) -> float:
    return result.estimates["stiffness_factor"].value


@pytest.mark.slow
def test_more_damping_lowers_the_identified_stiffness():
    change = m(held(damping=1e-4)) / m(held()) - 1.0
    # The paper's Tables 2 and 3: 1.05 -> 0.91, so -13 % for the same step of beta from 2.5e-5 to 1e-4 s.
    assert -0.20 < change < -0.06


@pytest.mark.slow
def test_compressibility_worsens_the_shape():
    soft, stiff = held(poisson=0.49).terms.phi_shape, held(poisson=0.499).terms.phi_shape
    # The paper's Fig. 7: Phi_S falls all the way to nu = 0.4999. The shot was made with 0.499.
    assert soft > 3.0 * stiff


def test_friction_hardly_matters_above_one_half():
    friction = np.array([0.0, 0.3, 0.5, 1.0, 2.0])
    design = from_points(
        Box.of({"friction": (0.0, 2.0), "stiffness_factor": (1.0, 1.3)}),
        np.column_stack([friction, np.full(len(friction), 1.12)]),
    )
    table = sweep(load_shot(SHOT), design, numerics=COARSE).table
    assert set(table.outcomes) == {"COMPLETED"}
    shape = dict(zip(friction, table.phi_shape, strict=True))
    force = dict(zip(friction, table.phi_force, strict=True))
    # The paper's Fig. 9: strong below 0.3 (force) and 0.5 (shape), flat above.
    assert shape[0.0] - shape[0.5] > 4.0 * abs(shape[0.5] - shape[2.0])
    assert force[0.0] - force[0.5] > 4.0 * abs(force[0.5] - force[2.0])


def test_an_unknown_parameter_is_refused_before_any_run():
    with pytest.raises(ValueError, match="there is no parameter 'stiffness'"):
        identify(load_shot(SHOT), Settings(free={"stiffness": None}))

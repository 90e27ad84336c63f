"""A shot as evidence: its force bins, many rate models at once, and runs that fail."""

from dataclasses import replace

import numpy as np
import pytest

from explicit import Model, PlatenMotion, Samples, Sampling, cylinder, run
from explicit.materials import neo_hookean
from explicit.relaxation import PronySeries
from kolsky.material.relaxation.evidence import RateModel
from kolsky.studies.shot_evidence import ShotEvidence

LAW, LENGTH, END = neo_hookean(20e3), 6.5e-3, 4e-4
EDGES = np.linspace(0.0, END, 9)
RELAXING = RateModel(1.2, PronySeries((0.5,), (1e-4,)))
ELASTIC = RateModel(0.8, PronySeries((), ()))


def shot(depth: float = 0.2) -> ShotEvidence:
    motion = PlatenMotion.sampled(
        lambda t: depth * LENGTH * (t / END) ** 2,
        lambda t: 2.0 * depth * LENGTH * t / END**2,
        start=0.0,
        end=END,
        n_knots=65,
    )
    model = Model(cylinder(4.75e-3, LENGTH, n_radial=2, n_axial=3), 870.0, (LAW,), (motion,))
    held = {"poisson": 0.49, "damping": 1e-5}
    return ShotEvidence(model, EDGES, np.zeros(8), np.ones(8), held=held, threads=1)


def test_every_model_of_a_batch_is_as_if_alone() -> None:
    evidence = shot()
    together = evidence.predict(LAW, [RELAXING, ELASTIC])
    alone = [evidence.predict(LAW, [one])[0] for one in (RELAXING, ELASTIC)]
    np.testing.assert_array_equal(together[0], alone[0])
    # an elastic model alone runs without branches, beside others with one of strength 0
    np.testing.assert_allclose(together[1], alone[1], rtol=1e-9, atol=1e-12)
    plain = run(
        evidence.model,
        Samples.of(stiffness_factor=0.8, poisson=0.49, damping=1e-5),
        Sampling(EDGES, EDGES[-1:]),
    )
    np.testing.assert_array_equal(alone[1], np.diff(plain.impulse_transmission[0]) / np.diff(EDGES))


def test_a_run_that_fails_is_no_number() -> None:
    crushed = shot(depth=3.0).predict(LAW, [RELAXING, ELASTIC])
    assert np.isnan(crushed).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"edges": EDGES[::-1].copy()}, "edges must ascend"),
        ({"force": np.zeros(3)}, "one value per bin, 8"),
        ({"sigma": np.zeros(8)}, "sigma > 0 N"),
        ({"held": {"stiffness_factor": 1.0}}, "leave stiffness_factor to the fit"),
    ],
)
def test_what_makes_no_sense_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(shot(), **change)  # type: ignore[arg-type]

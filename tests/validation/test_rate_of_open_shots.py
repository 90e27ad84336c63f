"""A known-answer shot, made by an independent program without relaxation: does its force ask for a branch?"""

from pathlib import Path

import pytest

from kolsky.forward import Numerics
from kolsky.prepare import prepare
from kolsky.quasistatic.rate_shots import ShotEvidence
from kolsky.quasistatic.viscoelastic import branches_asked_for
from kolsky.shots import load_shot

OPEN_01 = Path(__file__).resolve().parents[2] / "runs" / "open-01"


@pytest.mark.slow
def test_an_elastic_shot_does_not_ask_for_rate_dependence() -> None:
    prepared = prepare(load_shot(OPEN_01))
    evidence = ShotEvidence.of(prepared, Numerics(mesh=(12, 16), threads=1))
    verdict = branches_asked_for(prepared.forward.laws[0], [evidence], at_most=1, max_evaluations=12)
    assert verdict.branches == 0
    # 1.12 planted; the mesh is half as fine in each direction as that of an identification: 3 % (measured)
    assert verdict.fit.model.factor == pytest.approx(1.12, rel=0.05)

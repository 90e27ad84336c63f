"""A known-answer shot, made by an independent program without relaxation: does its force ask for a branch?"""

from pathlib import Path

import pytest
from shot_evidence import ShotEvidence

from kolsky.inverse.forward import Numerics
from kolsky.inverse.problem import prepare_shot
from kolsky.material.relaxation.rate_fit import required_branches
from kolsky.shot.load import load_shot

OPEN_01 = Path(__file__).resolve().parents[2] / "runs" / "open-01"


@pytest.mark.slow
def test_an_elastic_shot_does_not_ask_for_rate_dependence() -> None:
    prepared = prepare_shot(load_shot(OPEN_01))
    evidence = ShotEvidence.of(prepared, Numerics(mesh=(12, 16), threads=1))
    verdict = required_branches(prepared.forward.laws[0], [evidence], at_most=1, max_evaluations=12)
    assert verdict.branches == 0
    # 1.12 planted; the mesh is half as fine in each direction as that of an identification: 3 % (measured)
    assert verdict.fit.model.factor == pytest.approx(1.12, rel=0.05)

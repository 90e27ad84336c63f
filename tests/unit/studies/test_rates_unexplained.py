"""Rates: shots whose data the model does not explain are left out, and kept only if that is asked for."""

from dataclasses import replace

import numpy as np
import pytest
from ratedshots import rated

from kolsky.inverse.result import Verdict
from kolsky.studies.rates.comparison import compare

GOOD = [rated("a", 1.10, 300.0), rated("b", 1.12, 400.0)]


@pytest.mark.parametrize("verdict", [Verdict.UNEXPLAINED, Verdict.CONTRADICTED])
def test_an_unexplained_shot_is_left_out_and_named(verdict: Verdict) -> None:
    bad = rated("c", 1.50, 500.0, verdict=verdict)
    (group,) = compare([*GOOD, bad]).groups
    assert group.pooled is not None
    assert group.pooled.mean == pytest.approx(1.11, abs=1e-9)
    assert f"c is not counted: {verdict.value}" in group.remarks
    (kept,) = compare([*GOOD, replace(bad, keep_unexplained=True)]).groups
    assert [shot.name for shot in kept.counted] == ["a", "b", "c"]
    assert f"c is counted as asked for, though it is {verdict.value}" in kept.remarks


@pytest.mark.parametrize("verdict", [Verdict.AT_BOUND, Verdict.NOT_SEEN, Verdict.DISAGREEING])
def test_what_says_no_otherwise_is_never_kept(verdict: Verdict) -> None:
    assert not replace(rated("c", 1.5, 500.0, verdict=verdict), keep_unexplained=True).counted


def test_one_channel_alone_counts() -> None:
    assert rated("c", 1.1, 500.0, verdict=Verdict.OUTLINE_ALONE).counted


def test_an_older_result_is_named() -> None:
    old = replace(GOOD[0], found=replace(GOOD[0].found, fit=()))
    (group,) = compare([old, GOOD[1]]).groups
    assert any("not recorded of a: an older result" in remark for remark in group.remarks)
    assert np.isnan(old.excess("force"))
    assert GOOD[1].excess("force") == pytest.approx(1.0, rel=1e-12)

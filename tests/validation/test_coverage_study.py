"""The study of coverage, reduced: a dozen experiments with known answers, identified one by one."""

import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

ROOT = Path(__file__).resolve().parent.parent.parent
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the benchmarks are not installed

from benchmarks.coverage import Found, Study, run  # noqa: E402
from benchmarks.coverage_counts import joined, summary  # noqa: E402
from benchmarks.coverage_problem import FORCE_SIGMA, RANGES, draw, experiment, template  # noqa: E402

M = "stiffness_factor"


def _found(error: float, sigma: float) -> Found:
    one = {M: sigma}
    return Found({M: 1.1}, {M: 1.1 + error}, one, one, one, {M: {"mesh": sigma}}, one, {}, "identified", 0.0)


def _five() -> list[dict[str, Any]]:
    """Errors of 1, -1.9, 2.1 and 0 sigma, and no answer."""
    lost = replace(_found(0.0, 1.0), value={M: float("nan")}, sigma={M: float("nan")})
    return [asdict(one) for one in (*(_found(e * 0.01, 0.01) for e in (1.0, -1.9, 2.1, 0.0)), lost)]


def test_covered_is_counted_by_hand() -> None:
    """Three of five within two sigma."""
    said = summary(_five(), 2.0)
    assert said[M]["covered"] == pytest.approx(0.6)
    assert said[M]["answers"] == 4
    assert said[M]["mean error"] == pytest.approx(0.003)


def test_parts_of_a_study_are_joined() -> None:
    def part(*rows: int) -> dict[str, Any]:
        head = {"machine": {}, "workers": 1, "seconds": {"truths": 1.0}}
        study = asdict(Study((M,), 5, rows=(rows[0], rows[1])))
        return {**head, "study": study, "each": _five()[slice(*rows)]}

    whole = joined([part(0, 3), part(3, 5)])
    assert [one["value"][M] for one in whole["each"][:4]] == [one["value"][M] for one in _five()[:4]]
    assert whole[M]["covered"] == pytest.approx(0.6)
    assert whole["seconds"] == {"truths": 2.0}
    with pytest.raises(ValueError, match="overlap"):
        joined([part(0, 3), part(2, 5)])
    other = part(3, 5)
    other["study"]["seed"] = 2
    with pytest.raises(ValueError, match="not of one study"):
        joined([part(0, 3), other])


def test_experiments_are_what_they_say() -> None:
    draws = draw((M,), 1000, np.random.default_rng(1))
    low, high = RANGES[M]
    # The mean of a thousand draws is known to 1 / sqrt(12000) of the range.
    assert draws.values[M].mean() == pytest.approx(0.5 * (low + high), abs=4 * (high - low) / 12000**0.5)
    assert np.ptp(draws.values["damping"]) == 0.0
    seen = template()
    force, Z = 3.0 + 0.0 * seen.force.time, seen.centre_line.Z
    one, other = (experiment(0, force, Z, "bonded", np.random.default_rng([1, i])) for i in (1, 2))
    noise = one.force.history().force - 3.0
    assert noise.std() == pytest.approx(FORCE_SIGMA, rel=0.06)  # 2700 samples: 1.4 %, four times that
    assert not np.array_equal(noise, other.force.history().force - 3.0)


@pytest.mark.slow
def test_the_interval_covers_the_truth() -> None:
    study = Study((M,), experiments=12, seed=7)
    found, _ = run(study, workers=1)
    said = summary([asdict(one) for one in found], 2.0)[M]
    covered = round(said["covered"] * len(found))
    # An interval that holds the truth in 92 % of the tests holds fewer than this once in a thousand studies.
    assert covered >= binom.ppf(1e-3, len(found), 0.92)
    assert said["answers"] == len(found)
    # It must not hold it by being long: the scatter of twelve answers is known to 21 %, so within 1.9.
    assert said["mean sigma noise"] < 1.9 * said["scatter"]
    assert said["mean sigma"] < 0.006  # half a per cent

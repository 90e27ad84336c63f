"""The study of synthetic shots: counts by hand, truths of a seed, rejection of another study's folder."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import beta

from explicit.relaxation import PronySeries
from populations import branch_advice as advice
from populations.branch_advice import place_of
from populations.driver import hold, share
from populations.joint_coverage import NAMES, Study, relaxation_test, specified, summary, table, truth
from populations.joint_gains import counts as gain_counts
from populations.joint_gains import table as gain_table

TRUE = dict(zip(NAMES, (1.2, 0.4985, 25e-6, 0.4, 4e-4), strict=True))


def draw(number: int, errors: dict[str, float], asked: bool = True) -> dict[str, Any]:
    """An answer that is off by so many sigmas, whose intervals are two of them to either side."""
    estimates = {}
    for name, true in TRUE.items():
        sigma, value = 0.01 * true, true * (1.0 + 0.01 * errors.get(name, 0.0))
        estimates[name] = {
            "value": value,
            "sigma": sigma,
            "interval_95": [value - 2.0 * sigma, value + 2.0 * sigma],
            "outcome": "identified" if asked else "not seen by the data",
        }
    choice = {"aic": -3.0, "probability": 0.01, "asked_for": asked, "sentence": ""}
    found = {"estimates": estimates, "model_choice": choice, "scatter_between_shots": None}
    return {"number": number, "truth": TRUE, "found": found, "error": "", "seconds": 1.0}


EACH = [
    draw(0, {}),
    draw(1, {"prony_time_1": 1.9, "stiffness_factor": -2.1}),
    draw(2, {"prony_time_1": 2.1}, asked=False),
    {"number": 3, "truth": TRUE, "found": None, "error": "a run was lost", "seconds": 1.0},
]


def test_counts_by_hand() -> None:
    said = summary(EACH)
    assert (said["draws"], said["answered"], said["called identified"]) == (4, 3, 2)
    counts = {name: said[name]["held"]["count"] for name in NAMES}
    # A refused draw holds nothing.
    assert counts == {
        "stiffness_factor": 2, "poisson": 3, "damping": 3, "prony_strength_1": 3, "prony_time_1": 2,
    }  # fmt: skip
    assert said["prony_time_1"]["held"]["of"] == 4
    assert said["pairs within 2 sigma"]["count"] == 2
    assert said["relaxation asked for"]["count"] == 2
    assert said["stiffness_factor"]["misses, value too high and too low"] == [0, 1]
    assert said["prony_time_1"]["misses, value too high and too low"] == [1, 0]
    mean, rms = said["prony_time_1"]["error over sigma, mean and root mean square"]
    assert mean == pytest.approx((1.9 + 2.1) / 3.0)
    assert rms == pytest.approx(np.sqrt((1.9**2 + 2.1**2) / 3.0))
    assert said["poisson"]["median half width over the truth"] == pytest.approx(0.02)
    assert [one["number"] for one in said["each"]] == [0, 1, 2, 3]


def test_wrong_sensitivities_are_counted_by_case_and_by_the_named_shot() -> None:
    def one(case: str, error: float, verdict: str, *shots: str) -> dict[str, Any]:
        found = {"verdict": verdict, "agreement": {"shots": list(shots)}}
        return {"case": case, "error": error, "wrong": "1", "found": found}

    rows = [
        one("correct", 0.0, "explained"), one("more", 0.1, "withheld", "1"),
        one("more", 0.1, "withheld", "0"), one("more", 0.1, "withheld"),
        one("noticeable", -0.06, "explained"), {**one("noticeable", 0.3, "explained"), "found": None},
    ]  # fmt: skip
    found = gain_counts(rows)
    assert list(found) == ["correct", "more", "noticeable"]
    assert found["more"] == {"answers": 3, "withheld": 3, "shot named": 1, "error, median": 0.1}
    assert found["noticeable"]["answers"] == 1  # the other has no answer
    assert "| noticeable | 1 | 6 % | 0 | 0 |" in gain_table({"counts": found})


def test_a_share_has_the_exact_interval() -> None:
    found = share(47, 50)
    low, high = beta.ppf(0.025, 47, 4), beta.ppf(0.975, 48, 3)
    assert found["interval"] == pytest.approx([low, high])
    assert share(0, 50)["interval"] == pytest.approx([0.0, 1.0 - 0.025 ** (1.0 / 50.0)])
    assert share(50, 50)["interval"][1] == 1.0


def test_the_table_has_a_column_a_parameter_and_the_control_none_for_a_pair() -> None:
    study = {"seed": 5, "mesh": [24, 32], "refined_mesh": [64, 86], "truth_mesh": [96, 129],
             "truth_grading": 5.0, "elastic": False}  # fmt: skip
    said = summary(EACH) | {"study": study}
    lines = table(said).splitlines()
    assert lines[0].startswith("4 draws of seed 5 (meshes 24 × 32 → 64 × 86; truth 96 × 129, F-bar")
    assert "two standard uncertainties: 2 of 4 (7 to 93 %). Called identified: 2." in lines[0]
    assert lines[2] == "| | $m$ | $\\nu$ | $\\beta$ | strength | time |"
    assert lines[4].startswith("| 95 % intervals that hold the truth | 2 of 4 (7 to 93 %) | 3 of 4")
    assert lines[5] == "| misses: too high, too low | 0, 1 | 0, 0 | 0, 0 | 0, 0 | 1, 0 |"
    control = table(said | {"study": study | {"elastic": True}})
    assert "Relaxation asked for: 2 of 4 (7 to 93 %)." in control
    assert "two standard uncertainties" not in control
    lines = control.splitlines()
    assert lines[2] == "| | $m$ | $\\nu$ | $\\beta$ |"
    assert (
        lines[4]
        == "| 95 % intervals that hold the truth | "
        + " | ".join(["2 of 4 (7 to 93 %)", "3 of 4 (19 to 99 %)", "3 of 4 (19 to 99 %)"])
        + " |"
    )


def test_a_seed_draws_one_material_with_and_without_what_relaxes(tmp_path: Path) -> None:
    study = Study(seed=77)
    assert truth(study, 3) == truth(Study(seed=77, elastic=True), 3)
    assert truth(study, 3) != truth(study, 4)
    shots = specified(study, tmp_path, 3)
    assert len(shots) == 3
    assert len({shot.quantities.motion.speed for shot, _ in shots}) == 3
    for shot, _ in shots:
        q = shot.quantities
        assert q.truth.mesh == study.truth_mesh
        assert q.truth.grading == study.truth_grading
        assert q.material.stiffness_factor == pytest.approx(truth(study, 3)["stiffness_factor"])
        (series,) = q.relaxing
        assert isinstance(series, PronySeries)
        assert series.times[0] == pytest.approx(truth(study, 3)["prony_time_1"])
    elastic = specified(Study(seed=77, elastic=True), tmp_path / "elastic", 3)
    assert all(not shot.quantities.relaxing for shot, _ in elastic)


def test_the_relaxation_test_falls_from_all_to_the_long_term(tmp_path: Path) -> None:
    study = Study(seed=77)
    true = truth(study, 3)
    test, elastic = relaxation_test(study, true, 3), relaxation_test(Study(seed=77, elastic=True), true, 3)
    seen = np.isfinite(test.sigma)
    assert seen.sum() == 40
    more = test.stress[seen] / elastic.stress[seen] - 1.0  # the same noise, half a percent
    assert np.abs(more[-10:].mean()) < 0.005  # all is relaxed
    # Reached in 50 us and held to 100 us: c exp(-t / tau) with t between 50 and 100 us.
    first, strength, tau = more[0], true["prony_strength_1"], true["prony_time_1"]
    assert strength * np.exp(-1e-4 / tau) - 0.01 < first < strength * np.exp(-0.5e-4 / tau) + 0.01


def test_a_folder_of_another_study_is_refused(tmp_path: Path) -> None:
    hold(Study(seed=1), tmp_path)
    hold(Study(seed=1, device="cuda", truth_device="cuda"), tmp_path)  # where it runs is no part of the study
    with pytest.raises(ValueError, match="is of another study"):
        hold(Study(seed=2), tmp_path)


def shot(kind: str, number: int, *, advised: bool, verdict: str = "identified", **branch: float) -> Any:
    return {"kind": kind, "number": number, "advised": advised, "verdicts": {"poisson": verdict},
            "branch": branch, "error": ""}  # fmt: skip


UNEXPLAINED = "not explained by the model"
ADVISED = [
    shot("relaxing", 0, advised=True, verdict=UNEXPLAINED, branch_probability=0.002),
    shot("relaxing", 1, advised=True, verdict=UNEXPLAINED, branch_probability=0.2, branch_share=0.9),
    shot("relaxing", 2, advised=True, verdict=UNEXPLAINED, branch_share=0.9),
    shot("relaxing", 3, advised=False, verdict=UNEXPLAINED, branch_probability=0.2, branch_share=0.1),
    shot("relaxing", 4, advised=False),
    shot("elastic", 0, advised=False),
    {**shot("elastic", 1, advised=False), "verdicts": {}, "error": "no run completed"},
]


def test_recommendations_are_counted_by_hand() -> None:
    kinds = advice.summary(ADVISED)["kinds"]
    counts = {
        kind: {name: one["count"] for name, one in found.items() if name != "shots"}
        for kind, found in kinds.items()
    }
    assert counts["relaxing"] == {
        "advised": 3, "by the linear test": 1, "by the search": 2, "called identified": 1, "withheld": 1,
        "refused": 0,
    }  # fmt: skip
    assert counts["elastic"] == {
        "advised": 0, "by the linear test": 0, "by the search": 0, "called identified": 1, "withheld": 0,
        "refused": 1,
    }  # fmt: skip
    assert (kinds["relaxing"]["shots"], kinds["elastic"]["shots"]) == (5, 2)
    study = {
        "seed": 5, "mesh": [24, 32], "refined_mesh": [64, 86], "truth_mesh": [96, 129], "truth_grading": 5,
    }  # fmt: skip
    lines = advice.table({**advice.summary(ADVISED), "study": study}).splitlines()
    assert lines[0].startswith("5 relaxing, 2 elastic shots of seed 5 (meshes 24 × 32 → 64 × 86")
    assert lines[4] == "| recommended to try a branch | 3 of 5 (15 to 95 %) | 0 of 2 (0 to 84 %) |"


def test_twins_differ_in_the_branch_alone(tmp_path: Path) -> None:
    study = Study(seed=77)
    (relaxing, one), (elastic, other) = (place_of(study, tmp_path, k, 3) for k in ("relaxing", "elastic"))
    assert one != other
    assert relaxing.quantities.motion == elastic.quantities.motion
    assert relaxing.quantities.material == elastic.quantities.material
    (series,) = relaxing.quantities.relaxing
    assert series.instantaneous == pytest.approx(1.0 + truth(study, 3)["prony_strength_1"])
    assert not elastic.quantities.relaxing

"""A plan and a rate report as tables, JSON and lines: they quote twice the standard uncertainty."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ratedshots import rated

from kolsky.studies.local_sensitivity import LocalSensitivity, ObservationGrid
from kolsky.studies.planning.information import Expected, Instruments
from kolsky.studies.planning.plan import Choice, Plan, Rate, rows, to_json
from kolsky.studies.rates.comparison import compare
from kolsky.studies.rates.output import summary, tables


def expected(m: float, damping: float) -> Expected:
    sigma = np.array([m, damping])
    return Expected(deviations=sigma, alone=0.5 * sigma, correlation=np.array([[1.0, -0.4], [-0.4, 1.0]]))


def rate(factor: float, m: float, damping: float, cost: float) -> Rate:
    return Rate(factor, 70.0, 400.0, (0.1, 1e-6), expected(m, damping), {"D": cost, "A": -cost})


def plan() -> Plan:
    grid = ObservationGrid(np.array([0.0, 1e-3]), np.array([5e-4]), np.array([3e-3]))
    slopes = LocalSensitivity(
        names=("stiffness_factor", "damping"),
        point=np.array([1.2, 2e-5]),
        scale=np.array([0.1, 1e-5]),
        reach=0.1,
        grid=grid,
        force=np.array([50.0]),
        radius=np.array([[5e-3]]),
        force_slope=np.zeros((2, 1)),
        radius_slope=np.zeros((2, 1, 1)),
        force_left=np.zeros((2, 1)),
        radius_left=np.zeros((2, 1, 1)),
    )
    information: Any = SimpleNamespace(sensitivity=slopes)
    return Plan(
        shot="made-up",
        instruments=Instruments((0.0, 1e-3), 1e-5, 0.5, 8e-6, 1e4, 4e-6),
        discrepancy=(0.1, 1e-6),
        information=information,
        expected={"all": expected(0.02, 1e-6), "force": expected(0.03, 2e-6)},
        force_scale=np.array([0.005, 0.0]),
        end_times=np.array([1e-3]),
        by_end=(expected(0.02, 1e-6),),
        windows={0.5: (Choice("D", np.array([2e-4, 7e-4]), np.array([0.04, 3e-6])),)},
        heights={},
        rates=(rate(1.0, 0.02, 1e-6, 3.0), rate(2.0, 0.01, 4e-6, 2.0)),
        provenance={},
    )


def test_a_plan_in_json() -> None:
    said = to_json(plan())
    stiffness = said["parameters"]["stiffness_factor"]
    assert stiffness["interval"] == pytest.approx([1.2 - 0.04, 1.2 + 0.04], rel=1e-14)
    assert (stiffness["sigma"], stiffness["sigma_others_known"]) == (0.02, 0.01)
    assert stiffness["sigma_force"] == 0.03
    assert stiffness["shift_by_force_scale"] == 0.005
    assert said["correlations"] == {"stiffness_factor, damping": -0.4}
    assert said["best_rate"] == {"D": 2.0, "A": 1.0}
    assert said["camera_windows"][0]["places"] == [2e-4, 7e-4]


def test_a_plan_in_lines() -> None:
    said = rows(plan())
    text = " | ".join(f"{name}: {value}" for name, value in said.items())
    assert "m: 1.200 ± 0.040 (k = 2, expected); 0.02 if the others were known" in text
    assert "beta: 20.0 ± 2.0 us (k = 2, expected); 1 if the others were known" in text
    assert "m, from one kind of data: force 0.06" in text
    assert "m, apart: ± 0.01 by the force's scale" in text
    assert "50 % of frames, D-optimal: 0.20 to 0.70 ms: m ± 0.08" in text
    assert "speed x 2: 400/s: m ± 0.02" in text
    assert said["best speed"].startswith("D-optimal x 2, A-optimal x 1, for m x 2, for ")
    assert said["best speed"].endswith(" x 1")  # damping is known best at the shot's own speed


def test_a_rate_report_in_tables() -> None:
    m = (1.0, 1.1, 1.3)
    report = compare([rated(f"shot {i}", value, 300.0, own=0.01) for i, value in enumerate(m)])
    made = tables(report)
    assert made["rate_shots"]["u(m) (1)"] == pytest.approx([0.01] * 3, rel=1e-12)
    assert made["rate_shots"]["U(m) k=2 (1)"] == pytest.approx([0.02] * 3, rel=1e-12)
    deviation = np.std(m, ddof=1)
    groups = made["rate_groups"]
    assert groups["standard deviation s (1)"] == pytest.approx([deviation])
    assert groups["U = 2s (1)"] == pytest.approx([2.0 * deviation])
    assert groups["mean m (1)"] == pytest.approx([np.mean(m)])  # equal weights
    assert groups["degrees of freedom"] == [2.0]
    mean = summary(report)["groups"][0]["mean"]
    assert mean["two_standard_deviations"] == pytest.approx(2.0 * deviation)
    assert mean["interval_95"] == pytest.approx(
        [groups["95 % low (1)"][0], groups["95 % high (1)"][0]], rel=1e-14
    )

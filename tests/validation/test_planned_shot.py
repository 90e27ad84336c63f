"""The paper's test from the striker to its answer: `predict`, `virtual make`, `identify`."""

import json
from pathlib import Path

import pytest
from kolsky_command import run_kolsky

from kolsky.identification import identify

ROOT = Path(__file__).resolve().parents[2]
NAMES = {"stiffness_factor": "m", "poisson": "nu", "damping": "beta_s"}


@pytest.mark.long  # four minutes of one core
def test_a_shot_compressed_by_60_percent_holds_its_truths(tmp_path: Path) -> None:
    """Its force rings 17 times, and the outline of a coarse mesh is wrong by many times its noise: least
    squares that count every point of it end two oscillations off, sixteen half widths of nu."""
    run_kolsky("predict", ROOT / "runs" / "predict" / "paper.toml", "--out", tmp_path / "planned")
    run_kolsky("virtual", "make", tmp_path / "planned" / "virtual.toml", "--out", tmp_path / "shot")
    right = json.loads((tmp_path / "shot" / "truth.json").read_text("utf-8"))
    found = identify(tmp_path / "shot")
    for key, e in found.estimates.items():
        assert abs(e.value - right[NAMES[key]]) <= 2.0 * e.sigma, (key, e.value, e.sigma)
    # A neighbouring valley is 0.00012 away: the interval tells it from this one.
    assert 2.0 * found.estimates["poisson"].sigma < 6e-5

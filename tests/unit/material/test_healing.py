"""The page of healing efficiencies: its arithmetic by hand, and that it is the generator's."""

import sys
from pathlib import Path

import pytest

from kolsky.material.fits.properties import healing

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tests" / "validation"))

import healing_page as page  # noqa: E402


def test_the_page_is_what_its_numbers_make():
    assert (ROOT / "docs" / "validation" / "healing.md").read_text(encoding="utf-8") == page.page()


def test_numbers_of_the_page_by_hand():
    # 0.2555 / 0.0195 squared and 0.2565 / 0.0185 squared.
    assert page.points(0.256, 0.019) == pytest.approx((171.68, 192.23), abs=0.01)
    # mu = 0.218, K = 2 / 1.15 = 1.7391: (5.2174 - 0.436) / (10.4348 + 0.436).
    assert page.ratio_at_rest(0.109, 1.15) == pytest.approx(0.43984, abs=1e-5)
    # Small strains: E = 2 mu (1 + nu) = 0.62777 MPa.
    assert page.nominal(0.109, 1.15, 1e-5) == pytest.approx(0.62777e-5, rel=1e-4)
    side = page.narrowing(0.109, 1.15, 1e-4)
    assert (1.0 - side) / 1e-4 == pytest.approx(0.43984, rel=1e-3)


def test_no_specimen_no_efficiency():
    with pytest.raises(ValueError, match="needs undamaged and healed specimens"):
        healing([], [])

"""The code tour names existing files and functions."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
TOUR = (ROOT / "docs" / "tour.md").read_text("utf-8")


@pytest.mark.parametrize(
    "place", sorted(set(re.findall(r"`((?:kolsky|dic|explicit|doe|tests)/[\w/.]*)`", TOUR)))
)
def test_a_place_of_the_tour_is_there(place: str) -> None:
    assert (ROOT / place).exists()

"""The check that README's picture and numbers are those of a result: it detects differences."""

import pytest

from tests.readme_figures import PICTURE, ROOT, numbers_differ, picture_differs

README = (ROOT / "README.md").read_text("utf-8")
SHOWN = {
    "stiffness_factor": (1.120 - 0.053, 1.120 + 0.053),
    "poisson": (0.499003 - 0.000029, 0.499003 + 0.000029),
    "damping": (23.5e-6, 26.5e-6),
}


def test_a_picture_is_itself_and_no_other() -> None:
    svg = PICTURE.read_text("utf-8")
    assert picture_differs(svg, svg) == ""
    x = svg[(place := svg.index("\nL ", len(svg) // 2) + 3) :].split()[0]
    for shift, seen in ((0.3, False), (0.8, True)):  # a line is 1 pt wide
        other = svg[:place] + f"{float(x) + shift:.6f}" + svg[place + len(x) :]
        assert bool(picture_differs(svg, other)) is seen
    assert "other curves" in picture_differs(svg, svg[:place] + svg[place + len(x) :])


@pytest.mark.parametrize(
    ("name", "shift"), [("stiffness_factor", 0.003), ("poisson", 3e-6), ("damping", 4e-7)]
)
def test_a_stale_number_is_named(name: str, shift: float) -> None:
    assert numbers_differ(README, SHOWN) == ""
    low, high = SHOWN[name]
    assert numbers_differ(README, SHOWN | {name: (low + shift, high + shift)}).startswith(name)
    assert numbers_differ(README, SHOWN | {name: (low - shift, high + shift)}).startswith(name)

"""[uncertainty] of shot.toml: entries that `kolsky identify` uses, and entries for `kolsky waves` only."""

import shutil
from pathlib import Path

import pytest

from kolsky.base.errors import InputError
from kolsky.schema.apparatus import IDENTIFY_KEYS, UncertaintySection
from kolsky.shot.load import load_shot

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


def shot_with(tmp_path: Path, table: str) -> Path:
    """A copy of open-01 with another table at its end."""
    folder = tmp_path / "shot"
    shutil.copytree(OPEN_01, folder, ignore=shutil.ignore_patterns("results"))
    with (folder / "shot.toml").open("a") as file:
        file.write(table)
    return folder


def test_declared_uncertainties_reach_the_shot_in_si(tmp_path: Path) -> None:
    table = """
[uncertainty]
poisson = 0.0005
damping = "2 us"
curve_scale = "1 %"
specimen_diameter = "0.2 %"
clock_offset = "0.5 us"
Z_offset = "5 um"
mass = "0.5 %"
friction = 0.0
"""
    assert load_shot(shot_with(tmp_path, table)).uncertainty == {
        "poisson": 5e-4,
        "damping": pytest.approx(2e-6, rel=1e-12),
        "friction": 0.0,
        "curve_scale": pytest.approx(0.01, rel=1e-12),
        "specimen_diameter": pytest.approx(0.002, rel=1e-12),
        "clock_offset": pytest.approx(5e-7, rel=1e-12),
        "Z_offset": pytest.approx(5e-6, rel=1e-12),
    }


def test_what_is_absent_was_not_declared(tmp_path: Path) -> None:
    assert load_shot(shot_with(tmp_path, "")).uncertainty == {}


def test_waves_do_not_see_what_only_the_model_has() -> None:
    section = UncertaintySection(poisson=0.01, sensitivity="1 %", curve_scale="1 %")
    said = section.for_waves()
    assert said["sensitivity"] == pytest.approx(0.01)
    assert not {"poisson", "curve_scale", "damping", "friction", "Z_offset"} & set(said)
    assert set(section.for_identify()) <= set(IDENTIFY_KEYS)


@pytest.mark.parametrize(
    ("line", "key", "words"),
    [
        ('poisson = "0.01"', "uncertainty.poisson", "number"),
        ('damping = "-1 us"', "uncertainty.damping", ">= 0"),
        ('clock_offset = "1 mm"', "uncertainty.clock_offset", "time"),
        ("friction = -0.1", "uncertainty.friction", ">= 0"),
        ('specimen_densty = "1 %"', "uncertainty.specimen_densty", "specimen_density"),
    ],
)
def test_nonsense_is_refused_with_its_line(tmp_path: Path, line: str, key: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        load_shot(shot_with(tmp_path, f"\n[uncertainty]\n{line}\n"))
    message = str(caught.value)
    assert key in message
    assert words in message
    assert "shot.toml" in message

"""Random specifications: ranges, streams, and error messages."""

from pathlib import Path

import numpy as np
import pytest

from kolsky.base.errors import InputError
from kolsky.studies.budget.realisation import factors_of
from kolsky.virtual.specification import Draw, Series, read_specification, stream
from kolsky.virtual.truth import Job

HEAD = "format = 1\n[population]\nshots = {n}\n[population.draw]\n"
DRAWS = (
    '"specimen.diameter" = { low = "8 mm", high = "12 mm" }',
    '"material.stiffness_factor" = { low = 0.5, high = 2.0, spread = "log" }',
    '"scope.bits" = { low = 10, high = 14 }',
    '"imperfections.length" = { mean = "1 %", sigma = "0.5 %", spread = "normal" }',
    '"material" = { choose = [{ law = "neo_hookean", parameters = { mu = 1.0 } }, { poisson = 0.498 }] }',
)


def series(folder: Path, *draws: str, n: int = 400) -> Series:
    path = folder / "SPEC.toml"
    path.write_text(HEAD.format(n=n) + "\n".join(draws), encoding="utf-8")
    return read_specification(path)


def test_drawn_values_fill_their_ranges(tmp_path: Path) -> None:
    shots = [shot.quantities for shot in series(tmp_path, *DRAWS)]
    diameter = np.array([q.specimen.diameter for q in shots])
    factor = np.array([q.material.stiffness_factor for q in shots])
    length = np.array([q.imperfections.length for q in shots])
    assert 8e-3 <= diameter.min() < 8.1e-3
    assert 11.9e-3 < diameter.max() <= 12e-3
    # Of 400 draws a mean is known to sigma / 20; four of these.
    assert diameter.mean() == pytest.approx(10e-3, abs=4 * 4e-3 / np.sqrt(12) / 20)
    assert np.log(factor).mean() == pytest.approx(0.0, abs=4 * np.log(4.0) / np.sqrt(12) / 20)
    assert np.log(factor).std() == pytest.approx(np.log(4.0) / np.sqrt(12), rel=0.15)
    assert length.mean() == pytest.approx(0.01, abs=4 * 0.005 / 20)
    assert length.std() == pytest.approx(0.005, rel=0.15)
    assert {q.scope.bits for q in shots} == {10, 11, 12, 13, 14}
    assert {(q.material.law, q.material.poisson) for q in shots} == {("neo_hookean", 0.499), ("yeoh", 0.498)}


def test_a_shot_is_the_same_whatever_else_is_drawn(tmp_path: Path) -> None:
    few, many = series(tmp_path, DRAWS[0], n=3), series(tmp_path, *DRAWS, n=300)
    assert few.shot(2).quantities.specimen == many.shot(2).quantities.specimen
    assert few.shot(2).quantities.specimen != few.shot(3).quantities.specimen
    assert few.shot(2).name == "virtual-2"
    assert many.shot(2).name == "virtual-002"
    a, b = stream(1, 2, "noise", "flyer"), stream(1, 2, "noise", "outline")
    assert a.random() != b.random()
    assert stream(1, 2, "noise", "flyer").random() != stream(2, 2, "noise", "flyer").random()


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        ('"specimen.diameter" = { low = "8 mm", high = 12.0 }', "unit at one end only"),
        ('"specimen.diameter" = { low = "8 mm", high = "1.2 cm" }', "must be written alike"),
        ('"specimen.diameter" = { low = "12 mm", high = "8 mm" }', "not below low"),
        ('"scope.bits" = { low = 0, high = 3, spread = "log" }', "above 0"),
        ('"scope.bits" = { mean = 12 }', "is not a distribution"),
        ('"specimen.height" = { low = "8 mm", high = "9 mm" }', "is not a known key"),
        ('"name.first" = { low = 1, high = 2 }', "is not a table"),
        ('"material.poisson" = { low = 0.6, high = 0.7 }', r"\[0, 0.49999\]"),
    ],
)
def test_what_cannot_be_drawn_is_refused(tmp_path: Path, draw: str, message: str) -> None:
    text = '"name.first"' in draw
    with pytest.raises(InputError, match=message):
        series(tmp_path, draw) if not text else series_with_name(tmp_path, draw)


def series_with_name(folder: Path, draw: str) -> Series:
    path = folder / "SPEC.toml"
    path.write_text('name = "a"\n' + HEAD.format(n=2) + draw, encoding="utf-8")
    return read_specification(path)


def test_no_shot_beyond_the_population(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"has no shot 4; it must be in \[1, 3\]"):
        series(tmp_path, DRAWS[0], n=3).shot(4)


def test_a_draw_is_written_as_a_person_would() -> None:
    value = Draw(low="8 mm", high="12 mm").value(np.random.default_rng(1))
    number, unit = value.split(" ")
    assert unit == "mm"
    assert 8.0 <= float(number) <= 12.0
    assert len(number) <= 10


@pytest.mark.parametrize("name", ["forty", "small", "paper"])
def test_committed_specifications_are_valid(name: str) -> None:
    """Every shot of the committed populations can be asked for: what is drawn is allowed, its motion ends."""
    found = read_specification(Path(__file__).parents[3] / "runs" / "virtual" / f"{name}.toml")
    for shot in found:
        assert Job.of(shot.quantities, shot.folder).end > 0.0
    assert bool(found.declared.budget) == (name == "paper")  # the one that a budget is made of
    if found.declared.budget:  # and the noise, which every budget has
        assert len(factors_of(found.declared.budget)) == 1 + len(found.declared.budget)

"""What holding the other free parameters would give, in one line; kept in the file."""

from dataclasses import replace
from pathlib import Path

from synthetic import synthetic

from kolsky.inverse.result import HeldAnswer
from kolsky.results import printed
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.results.identification_rows import held_line
from kolsky.results.tables import to_json

HELD = HeldAnswer(
    name="stiffness_factor",
    held={"poisson": 0.499, "damping": 25e-6},
    value=1.07889,
    sigma=0.00503,
    chi2_force=5752.8,
    chi2_shape=4.283,
    free_chi2_force=7.896,
    free_chi2_shape=1.071,
)


def test_the_line_has_the_answer_what_was_held_and_both_misfits() -> None:
    assert held_line(HELD) == (
        "1.079 ± 0.010 with nu = 0.499, beta = 25 µs; chi2/n force 5.75e+03, outline 4.28 "
        "(free: force 7.9, outline 1.07)"
    )
    alone = replace(HELD, chi2_shape=float("nan"), free_chi2_shape=float("nan"))
    assert held_line(alone, written=True).endswith(
        "ν = 0.499, β = 25 µs; chi2/n force 5.75e+03 (free: force 7.9)"
    )


def test_it_is_printed_and_survives_the_file(tmp_path: Path) -> None:
    found = replace(synthetic(), held_answer=HELD)
    rows = printed.details(found)
    assert rows["m, others held"].startswith("1.079 ± 0.010 with nu = 0.499, beta = 25 us")
    write_identification(tmp_path / "identification.h5", found)
    again = read_identification(tmp_path / "identification.h5")
    assert again.held_answer == HELD
    assert to_json(again)["held_answer"]["held"] == {"poisson": 0.499, "damping": 25e-6}
    assert read_identification(_without(tmp_path)).held_answer is None


def _without(folder: Path) -> Path:
    write_identification(folder / "alone.h5", synthetic())
    return folder / "alone.h5"

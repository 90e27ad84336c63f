"""Sentences on what would narrow an interval, the analyst's choices, words for parameters."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import synthetic

from kolsky.report.pages.uncertainty import changes, choices, parts
from kolsky.results import numbers
from kolsky.results.display import in_display_units
from kolsky.results.nomenclature import in_words, short


def test_changes_are_the_parts_of_the_interval() -> None:
    made = in_display_units(synthetic())
    e = made.estimates["stiffness_factor"]
    named = parts(made, e)
    assert np.hypot.reduce(list(named.values())) == pytest.approx(e.sigma)  # nothing twice, nothing left out
    first, *_ = changes(made)
    words, sigma = next(iter(named.items()))
    assert sigma == max(named.values())
    half = 2.0 * np.sqrt(
        e.sigma**2 - sigma**2 + (0.5 * sigma) ** 2
    )  # the part itself halved, the others kept
    assert first.startswith(f"Halving {words} would bring U of m from {2.0 * e.sigma:.4f} to {half:.4f} ")


def test_nothing_is_advised_from_parts_that_do_not_add_up() -> None:
    made = synthetic()
    e = replace(made.estimates["stiffness_factor"], noise_parts={"force and shape": 0.5})
    assert not [x for x in changes(replace(made, estimates={"stiffness_factor": e})) if "Halving" in x]


def test_what_was_not_varied_is_said() -> None:
    rows = {row["words"]: row for row in choices(in_display_units(synthetic()))}
    assert rows["end of the window"]["shifts"] == [numbers.NOTHING]
    assert "not varied" in rows["end of the window"]["done"]
    assert rows["Poisson’s ratio ν"]["done"] == "not varied"
    # 0.9 and -1.6 standard uncertainties of 0.0019 from the joint optimum, as the made-up routes are
    assert rows["misfit: force χ² only"]["shifts"] == ["0.00171"]
    assert rows["misfit: outline χ² only"]["shifts"] == ["−0.00304"]


def test_parameters_in_sentences_have_their_words() -> None:
    text = "stiffness_factor is identified, friction is not seen"
    assert in_words(text, ["stiffness_factor", "friction"]) == (
        "stiffness factor m is identified, Coulomb friction f is not seen"
    )
    assert in_words("with friction as a parameter; mass_damping") == (
        "with friction as a parameter; mass-proportional damping α"
    )
    assert short("poisson") == "Poisson’s ratio ν"

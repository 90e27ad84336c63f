"""A result in a page: the misfit of other parameters, causes applied in a copy, the cut."""

from __future__ import annotations

import base64
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from laboratory_files import OPEN_05
from memory_pictures import Memory
from nicegui import ui
from nicegui.testing import User
from simulated import walk
from synthetic import fit, synthetic

from kolsky.app.copies import changed_value, copy_with, original_of
from kolsky.app.frame import source_of
from kolsky.app.look import PICTURE_WIDTH, answer_words, misfit_words
from kolsky.app.what_if import Misfit, WhatIf
from kolsky.base.errors import InputError
from kolsky.inverse.result import CauseFinding
from kolsky.results.hdf5 import write_identification
from kolsky.shot.inputs import INPUTS
from kolsky.shot.load import load_shot


@pytest.fixture(scope="module")
def what_if() -> WhatIf:
    """open-05 on a tiny mesh, with made-up estimates."""
    found = synthetic()
    return WhatIf(load_shot(OPEN_05), replace(found, mesh=(4, 6), fit=fit(tuple(found.estimates))))


def test_the_misfit_is_the_residual_over_what_a_right_model_leaves(what_if: WhatIf) -> None:
    seen = what_if.prepared.observations
    expected = {one.channel: one.expected for one in what_if.found.fit}
    n = len(seen.centre_line.Z)
    prediction = SimpleNamespace(
        force_bins=np.array([seen.force_mean + 2.0 * expected["force"]]),
        Z=np.array([np.where(np.arange(n) % 2, 1.0, -1.0) * 3.0 * expected["outline"] + seen.centre_line.Z]),
        inside=np.ones((1, n), dtype=bool),
    )
    prediction.inside[0, 0], prediction.Z[0, 0] = False, 9.0  # a point outside the model does not count
    misfit = what_if.misfit(prediction, 0)
    assert misfit.force == pytest.approx(2.0, rel=1e-12)
    assert misfit.outline == pytest.approx(3.0, rel=1e-9)


def test_one_simulation_and_a_softer_one(what_if: WhatIf) -> None:
    start = what_if.start
    assert set(start) == {"stiffness_factor", "poisson", "damping"}  # bonded: no friction
    for name, value in start.items():
        low, high = what_if.bounds(name)
        assert low < value < high
    answer = what_if.run(start)
    softer = what_if.run({**start, "stiffness_factor": what_if.bounds("stiffness_factor")[0]})
    assert softer.misfit.force != answer.misfit.force
    with pytest.raises(ValueError, match="poisson"):
        what_if.run({**start, "poisson": 0.6})


def cause(key: str, value: float) -> CauseFinding:
    return CauseFinding(key, "a change", "1", 1.0, value, 0.1, 0.5, 9.0, 0.01, {}, {}, True)


@pytest.mark.parametrize(
    ("key", "value", "of"),
    [
        ("specimen.length", 1.02, "specimen_length"),
        ("specimen.diameter", 0.98, "specimen_diameter"),
        ("specimen.density", 1.1, "specimen_density"),
        ("force.sensitivity", 1.25, "sensitivity"),
        ("force.clock_offset", 4e-6, "clock_offset"),
        ("centre_line.y_offset", 5e-5, "y_offset"),
        ("centre_line.Z_offset", -2e-5, "Z_offset"),
    ],
)
def test_a_copy_says_what_the_diagnosis_applied(key: str, value: float, of: str, tmp_path: Path) -> None:
    """The copy's file gives the shot that the input's own rule makes."""
    folder = tmp_path / "one"
    shutil.copytree(OPEN_05, folder, ignore=shutil.ignore_patterns("results"))
    apply = INPUTS[of].applied
    assert apply is not None
    right, made = apply(load_shot(folder), value), load_shot(copy_with(folder, cause(key, value)))
    for name in ("diameter", "length", "density"):
        assert getattr(made.specimen, name) == pytest.approx(getattr(right.specimen, name), rel=1e-8)
    assert made.force.transducer.sensitivity == pytest.approx(right.force.transducer.sensitivity, rel=1e-8)
    assert made.force.clock_offset == pytest.approx(right.force.clock_offset, abs=1e-15)
    np.testing.assert_allclose(made.centre_line.y, right.centre_line.y, rtol=0, atol=1e-12)
    np.testing.assert_allclose(made.centre_line.Z, right.centre_line.Z, rtol=0, atol=1e-12)
    with pytest.raises(InputError, match="is there already"):
        copy_with(folder, cause(key, value))


def test_a_copy_names_its_original(tmp_path: Path) -> None:
    for name in ("one", "one, specimen.length changed", "two, specimen.length changed"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "shot.toml").write_text("format = 1\n", encoding="utf-8")
    assert original_of(tmp_path / "one, specimen.length changed") == tmp_path / "one"
    assert original_of(tmp_path / "one") is None
    assert original_of(tmp_path / "two, specimen.length changed") is None  # two is gone


def test_the_change_of_the_misfit_in_words() -> None:
    words = misfit_words(Misfit(3.0, 0.9), Misfit(2.0, 1.0))
    assert words == "force 3.00, at the answer 2.00 (+50 %); outline 0.90, at the answer 1.00 (-10 %)"
    assert misfit_words(Misfit(1.0, float("nan")), Misfit(1.0, float("nan"))) == (
        "force 1.00, at the answer 1.00 (+0 %)"
    )


def test_an_estimate_has_greek_letters_in_a_page() -> None:
    damping = synthetic(("stiffness_factor", "damping")).estimates["damping"]
    assert answer_words(damping).startswith("β = ")
    assert " µs (k = 2)" in answer_words(damping)


def test_a_picture_beside_the_plots_is_as_wide_as_it_is_shown() -> None:
    wide = np.random.default_rng(0).integers(0, 255, (64, 1280), dtype=np.uint8)
    source = source_of(Memory([wide, None]), 0, PICTURE_WIDTH)
    png = base64.b64decode(source.removeprefix("data:image/png;base64,"))
    assert cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE).shape == (32, 640)
    assert source_of(Memory([wide, None]), 1, PICTURE_WIDTH) == ""  # it cannot be read


def test_values_of_the_model_take_the_place_of_the_declared_ones(tmp_path: Path) -> None:
    shutil.copytree(OPEN_05, tmp_path / "one")
    assert load_shot(copy_with(tmp_path / "one", cause("model.poisson", 0.4985))).model.poisson == 0.4985
    made = load_shot(copy_with(tmp_path / "one", cause("model.damping", 3.2e-5)))
    assert made.model.damping == pytest.approx(3.2e-5, rel=1e-9)
    assert changed_value(cause("interface.faces", 0.3), {}) is None
    with pytest.raises(InputError, match="not a single value"):
        copy_with(tmp_path / "one", cause("interface.faces", 0.3))


def test_the_page(tmp_path: Path) -> None:
    folder = tmp_path / "root" / "one"
    shutil.copytree(OPEN_05, folder, ignore=shutil.ignore_patterns("results"))
    (folder / "results").mkdir()
    found = synthetic()
    write_identification(
        folder / "results" / "identification.h5",
        replace(found, mesh=(4, 6), fit=fit(tuple(found.estimates)), warnings=("it is made up",)),
    )

    async def steps(user: User) -> None:
        await user.open("/look?shot=one")
        await user.should_see("1 warning", retries=100)
        await user.should_see("it is made up")
        await user.should_see(marker="what-if-damping")
        (slider,) = user.find(marker="what-if-stiffness_factor").elements
        assert isinstance(slider, ui.slider)
        user.find(marker="what-if-stiffness_factor").trigger("change")
        await user.should_see(", at the answer ", retries=100)
        force = next(one for one in user.find(ui.echart).elements if "Transmitted force" in str(one.props))
        curves = {one["name"]: one["data"] for one in force.options["series"]}
        assert curves["model"][0][1] == pytest.approx(found.comparison.force_model[0], rel=1e-5)
        assert len(curves["tried"]) > 10
        user.find("Back to the answer").click()
        assert [len(one["data"]) for one in force.options["series"][-2:]] == [len(curves["model"]), 0]

    walk(tmp_path / "root", tmp_path / "main.py", steps)

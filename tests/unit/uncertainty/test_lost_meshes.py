"""A graded run that an identification loses: said by the result, and the older formula stands in for it."""

from dataclasses import replace
from pathlib import Path

import pytest

from explicit import Outcome, Response
from kolsky.identification import identify
from kolsky.inverse.forward import GRADING
from kolsky.inverse.settings import Numerics, Settings
from kolsky.inverse.work import Launch, run_side_by_side
from kolsky.results.tables import to_json
from kolsky.shot.load import load_shot
from kolsky.uncertainty import mesh_error

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"
SETTINGS = Settings(
    free={"stiffness_factor": None},
    numerics=Numerics(mesh=(6, 8)),
    refined_mesh=(12, 16),
    replicates=2,
)


def test_an_identification_says_which_graded_run_it_has_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    def losing(launches: list[Launch]) -> list[Response]:
        return [
            replace(response, outcomes=(Outcome.INVERTED,))
            if launch.numerics.grading == GRADING and launch.numerics.mesh == (12, 16)
            else response
            for launch, response in zip(launches, run_side_by_side(launches), strict=True)
        ]

    shot = load_shot(OPEN_01)
    first, last = shot.window
    short = replace(shot, window=(first, first + 0.4 * (last - first)))
    whole = identify(short, SETTINGS)
    assert "lost_mesh_runs" not in whole.surrogate
    assert "graded mesh" not in " ".join(whole.warnings)
    monkeypatch.setattr(mesh_error, "run_side_by_side", losing)
    found = identify(short, SETTINGS)
    (said,) = [text for text in found.warnings if "graded mesh" in text]
    assert said.startswith(
        "the run at the answer on the graded mesh of 12 x 16 elements was lost (INVERTED at "
    )
    assert "come from the coarser mesh of 6 x 8 elements" in said
    assert said in to_json(found)["warnings"]
    assert found.surrogate["lost_mesh_runs"] == 1.0
    # The run on the refined mesh is the same, what the mesh is said to do is not.
    e, was = found.estimates["stiffness_factor"], whole.estimates["stiffness_factor"]
    assert e.on_mesh == was.on_mesh
    assert e.mesh_correction != was.mesh_correction
    assert e.numerical_parts["mesh"] != was.numerical_parts["mesh"]

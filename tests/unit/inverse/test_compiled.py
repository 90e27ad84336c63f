"""What an identification has compiled at its start: single runs, a design's packs, the other element."""

from types import SimpleNamespace
from typing import Any

import pytest

import explicit
from doe import Box
from kolsky.inverse.problem import Freed, InverseProblem
from kolsky.inverse.runner import RUNS_OF_A_DESIGN, compile_for
from kolsky.inverse.settings import Settings
from kolsky.inverse.work import Work


def test_it_asks_for_what_it_will_run(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {}
    stages_told: list[tuple[str, int, int]] = []

    class Numerics(SimpleNamespace):
        def with_other_element(self) -> "Numerics":
            return Numerics(**{**vars(self), "element": "fbar"})

    numerics = Numerics(device="cpu", threads=2, element="one_point")

    def problem(points: dict[str, Any], numerics: Numerics) -> tuple[Any, ...]:
        return numerics.element, {name: value.tolist() for name, value in points.items()}

    def compiled(problems: Any, *, also: Any, device: str, threads: int, progress: Any) -> int:
        asked.update(problems=problems, also=[make() for make in also], device=device, threads=threads)
        progress(1, 3)
        return 3

    monkeypatch.setattr(explicit, "compile_time_loops", compiled)
    prepared: Any = SimpleNamespace(forward=SimpleNamespace(problem=problem))
    freed = Freed(Settings(numerics=numerics, held={"damping": 2e-5}), by_default=False, reasons={})
    made = InverseProblem(prepared, freed, Box.of({"stiffness_factor": (0.5, 2.0)}), None)
    compile_for(made, Work(lambda *at: stages_told.append(at)))
    one = {"damping": [2e-5], "stiffness_factor": [0.5]}
    many = {name: value * RUNS_OF_A_DESIGN for name, value in one.items()}
    assert asked["problems"] == [("one_point", one), ("one_point", many)]
    assert asked["also"] == [("fbar", one)]
    assert (asked["device"], asked["threads"]) == ("cpu", 2)
    assert stages_told == [("compile", 1, 3)]

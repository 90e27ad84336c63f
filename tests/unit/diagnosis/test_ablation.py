"""Counts of the study of mechanisms by hand; every switch replaces an existing object."""

import importlib
import json
from pathlib import Path
from typing import Any

import pytest

from populations import ablation_studies
from populations.ablation import SWITCHES, diagnosis_table, table


@pytest.mark.parametrize("name", [name for name, switch in SWITCHES.items() if switch.target])
def test_a_switch_replaces_what_the_program_uses_and_puts_it_back(name: str) -> None:
    def now(target: str) -> Any:
        parts = target.split(".")
        for k in range(len(parts) - 1, 0, -1):
            try:
                found: Any = importlib.import_module(".".join(parts[:k]))
            except ModuleNotFoundError:
                continue
            for part in parts[k:-1]:
                found = getattr(found, part)
            return vars(found)[parts[-1]]
        raise AssertionError(target)

    switch = SWITCHES[name]
    before = now(switch.target)
    with switch.off():
        assert now(switch.target) is switch.value
        assert before is not switch.value
    assert now(switch.target) == before


def right(shot: str, switch: str, m: float, identified: bool = True) -> dict[str, Any]:
    """An answer whose truth is 1 and whose standard uncertainty is 0.01."""
    said = {"stiffness_factor": {"value": m, "sigma": 0.01, "truth": 1.0, "outcome": "identified"}}
    return {
        "shot": shot, "switch": switch, "updates": 2.0, "said": said, "identified": identified, "causes": [],
    }  # fmt: skip


def test_right_shots_without_a_mechanism_by_hand() -> None:
    """Errors 1, -1.9 and 2.1 % against 0.5, -1.9 and 1 %: both that differ are larger, by chance 1/4."""
    rows = [right("a", "all", 1.005), right("b", "all", 0.981), right("c", "all", 1.01, False)]
    rows += [right("a", "halfway", 1.01), right("b", "halfway", 0.981), right("c", "halfway", 1.021)]
    rows += [{"shot": "a", "switch": "held", "broke": "no run"}]
    first, second = table(rows).splitlines()[2:]
    assert first.endswith("| 0 of 0 (-) | 3 | 2 |")
    # Root mean square of 1, 1.9 and 2.1: 1.734; the third is beyond k = 2.
    assert "| 3 | 2.0 | 1.73 | 1.734 % | 2.000 % | 2 of 2 (0.25) | 2 | 2 |" in second


def test_wrong_inputs_without_a_mechanism_by_hand() -> None:
    ends = {
        "nothing_of_diagnosis": ["first", "refused", "second", "harmless", "none"],
        "leading": ["second", "refused", "first", "harmless", "confident"],
    }
    rows = [
        {"switch": name, "row": str(k), "shot": "a", "updates": 3.0, "end": end}
        for name, each in ends.items()
        for k, end in enumerate(each)
    ]
    first, second = diagnosis_table(rows).splitlines()[2:]
    assert first.endswith("| 5 | 3.0 | 2 of 4 | 3 | 0 | 0, 0 |")
    assert second.endswith("| 5 | 3.0 | 2 of 4 | 3 | 1 | 1, 1 |")


def test_rows_of_a_study_of_single_shots(tmp_path: Path) -> None:
    """Of two answers one is missing; the file of the study is no answer."""
    truth = {"stiffness_factor": 1.0, "friction": 0.3}
    one = {
        "number": 0, "truth": truth, "updates": 4.0, "outcome": "identified",
        "value": {"stiffness_factor": 1.01, "friction": 0.32},
        "sigma": {"stiffness_factor": 0.01, "friction": 0.01},
    }  # fmt: skip
    lost = {"number": 1, "truth": truth, "outcome": "no run completes"}
    (tmp_path / "study.json").write_text(json.dumps({"off": "balanced"}))
    (tmp_path / "answer-0000.json").write_text(json.dumps(one))
    (tmp_path / "answer-0001.json").write_text(json.dumps(lost))
    first, second = ablation_studies.rows_of(tmp_path)
    assert first["said"]["friction"] == {"value": 0.32, "sigma": 0.01, "truth": 0.3}
    assert first["identified"]
    assert second == {"shot": "1", "switch": "balanced", "broke": "no run completes"}
    assert "| 2 | 4.0 | 1.00, 2.00 | 1.000 % | 2.000 % |" in table([first, second]).splitlines()[2]


def test_rows_of_a_study_of_several_shots() -> None:
    estimate = {"value": 0.4, "sigma": 0.1, "outcome": "identified"}
    at_bound = estimate | {"outcome": "only if the parameter at its bound is right"}
    truth = {"prony_strength_1": 0.5}
    found = {"found": {"estimates": {"prony_strength_1": estimate}}, "truth": truth, "updates": 9.0}
    row = ablation_studies.joint(found)
    assert row == {
        "updates": 9.0,
        "said": {"prony_strength_1": {"value": 0.4, "sigma": 0.1, "truth": 0.5}},
        "identified": True,
    }
    found["found"] = {"estimates": {"prony_strength_1": at_bound}}
    assert not ablation_studies.joint(found)["identified"]
    assert ablation_studies.joint({"found": None, "error": "no run"}) == {"broke": "no run"}


def test_studies_with_other_settings_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seed in (("all", 1), ("balanced", 2)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "study.json").write_text(json.dumps({"off": name, "seed": seed}))
    monkeypatch.setattr("sys.argv", ["", str(tmp_path / "all"), str(tmp_path / "balanced")])
    with pytest.raises(SystemExit, match="different studies"):
        ablation_studies.main()

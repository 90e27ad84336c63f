"""Counts of the study of mechanisms by hand; every switch replaces an existing object."""

import importlib
from typing import Any

import pytest

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

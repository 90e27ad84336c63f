"""The order of causes that are not named: by evidence, assumptions first where it cannot tell."""

from kolsky.diagnosis.causes import ALIKE, by_evidence

KEYS = ["specimen.length", "model.damping", "force.sensitivity", "model.mass_damping", "specimen.diameter"]


def order(*evidences: float) -> list[str]:
    return [KEYS[i] for i in by_evidence(KEYS, evidences)]


def test_the_most_evidence_first() -> None:
    assert order(80.0, 50.0, 65.0, 20.0, 35.0) == [
        "specimen.length",
        "force.sensitivity",
        "model.damping",
        "specimen.diameter",
        "model.mass_damping",
    ]


def test_of_what_cannot_be_told_apart_what_nobody_measured() -> None:
    assert order(51.5, 50.0, 30.0, 12.0, 11.0) == [
        "model.damping",
        "specimen.length",
        "force.sensitivity",
        "model.mass_damping",
        "specimen.diameter",
    ]
    # Told apart from ALIKE on; a group is what is near to its first, not a chain.
    assert order(50.0, 50.0 - ALIKE, 0.0, 0.0, 0.0)[:2] == ["specimen.length", "model.damping"]
    assert order(60.0, 45.0, 52.0, 0.0, 0.0)[:3] == ["specimen.length", "force.sensitivity", "model.damping"]


def test_weak_evidence_is_not_regrouped() -> None:
    assert order(ALIKE, 9.0, 8.0, 7.0, 0.0)[:2] == ["specimen.length", "model.damping"]
    assert order(9.0, 1.0, 8.0, 7.0, 0.0) == [KEYS[0], KEYS[2], KEYS[3], KEYS[1], KEYS[4]]

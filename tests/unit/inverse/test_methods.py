"""Additional methods: distances, disagreement, messages to the user, and content of files."""

from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest
from synthetic import CHECKS, synthetic

from kolsky.base.apparatus import Interface
from kolsky.inverse.result import AGREEMENT, LEAST_SQUARES, PROFILE, Identification, Method, disagreements
from kolsky.report.pages.identification import render
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.results.numbers import NOTHING
from kolsky.results.printed import details
from kolsky.results.tables import to_json
from kolsky.uncertainty.warnings import collect_warnings


def method(name: str, value: float, *, half_width: float = 0.02) -> Method:
    return Method.compared(
        name, {"stiffness_factor": value}, answer={"stiffness_factor": 1.1},
        half_width={"stiffness_factor": half_width}, runs=42, ended="at rest",
    )  # fmt: skip


def test_distance_in_half_widths() -> None:
    assert method(LEAST_SQUARES, 1.115).distances["stiffness_factor"] == pytest.approx(0.75)
    assert method(LEAST_SQUARES, 1.09).distances["stiffness_factor"] == pytest.approx(-0.5)
    with pytest.raises(ValueError, match="values for"):
        Method.compared("x", {"a": 1.0}, answer={"b": 1.0}, half_width={"b": 1.0}, runs=1)


def test_who_disagrees() -> None:
    near, far = (
        method(LEAST_SQUARES, 1.1 + 0.9 * AGREEMENT * 0.02),
        method(PROFILE, 1.1 - 1.1 * AGREEMENT * 0.02),
    )
    assert [(m.name, p) for m, p, _ in disagreements([near, far])] == [(PROFILE, "stiffness_factor")]
    # What is not known agrees with nothing.
    assert len(list(disagreements([method(LEAST_SQUARES, 1.1, half_width=0.0)]))) == 1


def test_a_user_is_told() -> None:
    found = synthetic(nodes=False)
    name, e = next(iter(found.estimates.items()))
    values = {p: q.value for p, q in found.estimates.items()}
    answer, half = dict(values), {p: 2.0 * q.sigma for p, q in found.estimates.items()}
    off = {**values, name: e.value + e.sigma}
    own = Method.compared(LEAST_SQUARES, values, answer=answer, half_width=half, runs=17)
    other = Method.compared(
        PROFILE, off, answer=answer, half_width=half, runs=66, converged=False, ended="it is rough"
    )
    result = replace(found, methods=(own, other))
    said = collect_warnings(result, checks=CHECKS, interface=Interface(faces="bonded", side="bonded"))
    told = [text for text in said if "methods disagree" in text]
    assert len(told) == 1
    assert name in told[0]
    assert "0.5 of the k = 2 half width" in told[0]
    assert "it is rough" in told[0]
    saved = to_json(result)["methods"]
    assert [each["name"] for each in saved] == [LEAST_SQUARES, PROFILE]
    assert saved[1]["distances"][name] == pytest.approx(0.5)
    assert saved[1]["runs"] == 66
    assert any(PROFILE in row and "not at rest" in text for row, text in details(result).items())


def test_a_method_that_failed_is_said() -> None:
    found = synthetic(nodes=False)
    values = {p: q.value for p, q in found.estimates.items()}
    half = {p: 2.0 * q.sigma for p, q in found.estimates.items()}
    nothing = dict.fromkeys(values, float("nan"))
    unknown = Method.compared(
        PROFILE, nothing, answer=values, half_width=half, runs=0, converged=False, ended="no run"
    )
    result = replace(found, methods=(unknown, unknown))
    assert to_json(result)["methods"][0]["values"] == dict.fromkeys(values)
    row = next(line for line in page(result).splitlines() if "No run" in line)
    assert f"<td>{NOTHING} ({NOTHING})</td>" in row


def page(result: Identification) -> str:
    """The report without its figures, which take seconds."""
    with patch("kolsky.report.pages.identification.REGISTRY", {}):
        return render(result)


def test_the_report_lists_them() -> None:
    found = synthetic(nodes=False)
    one = (method(LEAST_SQUARES, 1.115), replace(method(PROFILE, 1.09), ended="it is rough"))
    text = page(replace(found, methods=one))
    assert "Optimum by method" in text
    assert "It is rough" in text
    assert "Optimum by method" not in page(replace(found, methods=one[:1]))  # one is no comparison


def test_the_result_file_keeps_them(tmp_path: Path) -> None:
    methods = (method(LEAST_SQUARES, 1.115), replace(method(PROFILE, 1.09), converged=False, shared_runs=3))
    write_identification(tmp_path / "identification.h5", replace(synthetic(), methods=methods))
    assert read_identification(tmp_path / "identification.h5").methods == methods

"""Random dialects: every read file is correct, and almost no file is rejected."""

from pathlib import Path

import pytest

from tests.fuzz.dialects import study

MOST_REFUSED = 0.01
"""Share of drawn files that may be refused: those whose remarks look like a line of samples or of names."""


@pytest.mark.parametrize("files", [150, pytest.param(1_000, marks=pytest.mark.slow)])
def test_no_dialect_is_read_wrongly_in_silence(files: int, tmp_path: Path) -> None:
    counts, wrong, reasons = study(files, 5, tmp_path)
    assert not wrong, wrong[:5]
    assert counts["refused"] <= 2 + MOST_REFUSED * files, reasons.most_common(5)

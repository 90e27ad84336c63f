"""The example of docs/theory/equilibrium.md runs."""

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).resolve().parents[3] / "docs" / "theory" / "equilibrium.md"


@pytest.mark.slow
def test_the_example_of_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    names: dict[str, object] = {}
    exec(block, names)
    assert capsys.readouterr().out.startswith("COMPLETED")
    slopes = names["direct"](names["found"]).reaction("right")[-1, :, 0]  # type: ignore[operator]
    constants = names["rubber"].parameters()  # type: ignore[attr-defined]
    # the law is linear in its constants: their products with the slopes add up to the force
    assert np.isclose(slopes @ constants, names["found"].reaction("right")[-1, 0], rtol=1e-6)  # type: ignore[attr-defined]

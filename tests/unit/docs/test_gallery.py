"""The gallery: ten examples, each once, as page, notebook and script. The documentation's build runs them."""

import ast
import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "docs" / "_ext"))
import gallery  # noqa: E402

PAGES = {p.stem: p.read_text("utf-8") for p in (ROOT / "docs" / "gallery").glob("*.md") if p.stem != "index"}
ASKED = {"signals", "dic_plane", "stereo", "identify", "rate", "relaxation", "specimen", "actuator"}


def test_the_ten_are_there_and_linked() -> None:
    assert set(PAGES) == ASKED | {"plan", "sweep"}
    index = (ROOT / "docs" / "gallery" / "index.md").read_text("utf-8")
    sidebar = (ROOT / "docs" / "index.md").read_text("utf-8")
    for name in PAGES:
        assert f"{{doc}}`{name}`" in index
        assert f"\ngallery/{name}\n" in sidebar


@pytest.mark.parametrize("name", PAGES)
def test_page_notebook_and_script_have_the_same_code(name: str) -> None:
    page = PAGES[name]
    cells = json.loads(gallery.notebook(page))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 2
    assert all(part in page for part in code)
    assert "{doc}" not in json.dumps(cells)
    script = gallery.script(page)
    ast.parse(script)
    assert "load_ext" not in script
    assert ".savefig(" in script
    text = " ".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    assert len(text.split()) < 60  # an example, no essay


def test_a_script_by_hand() -> None:
    page = (
        "---\nkernelspec: x\n---\n\n# Title\n\nSee {doc}`../howto/dic`.\n\n"
        "```{code-cell} ipython3\n:tags: [remove-cell]\n\n%load_ext laboratory\n```\n\n"
        "```{code-cell} ipython3\na = 1\na + 1\n```\n\n```{code-cell} ipython3\nfound.plot()\n```\n"
    )
    assert gallery.script(page) == (
        '# Title\n#\n# See `dic`.\n\na = 1\nprint(a + 1)\n\nfound.plot().savefig("figure-1.png")\n'
    )

"""The documentation's build runs the tutorials; these tests show that it can fail."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[3] / "docs"
PAGES = sorted((DOCS / "tutorials").glob("*.md"))


@pytest.fixture
def extensions(monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder of the documentation's extensions, to import from."""
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    for name in ("laboratory", "module_pages", "notebooks_ahead"):
        monkeypatch.delitem(sys.modules, name, raising=False)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_is_a_notebook_that_runs_its_commands(page):
    text = page.read_text(encoding="utf-8")
    front = text.split("---\n")[1]
    assert "format_name: myst" in front
    assert "kernelspec:" in front
    assert "%load_ext laboratory\n" in text
    assert "%%shell\n" in text


def test_every_tutorial_is_in_the_contents():
    contents = (DOCS / "index.md").read_text(encoding="utf-8").splitlines()
    assert {f"tutorials/{page.stem}" for page in PAGES} == {c for c in contents if c.startswith("tutorials/")}


@pytest.mark.parametrize("script", ["echo first; false; echo last\n", "false | cat\necho last\n"])
def test_a_shell_cell_stops_and_fails_where_its_script_does(script, extensions, capfd):
    from laboratory import shell

    with pytest.raises(subprocess.CalledProcessError):
        shell("", script)
    assert "last" not in capfd.readouterr().out


def test_a_shell_cell_shows_both_streams(extensions, capsys):
    from laboratory import shell

    shell("", "word() { echo $1; }\nword answer\nword warning >&2\n")
    assert capsys.readouterr() == ("answer\n", "warning\n")


def test_there_is_a_page_for_every_public_module_and_no_other(extensions, tmp_path):
    from module_pages import REFERENCE, ROOT, public, sources, without_page, write_pages

    import kolsky

    class App:
        srcdir = tmp_path

    stale = tmp_path / "api" / "generated" / "kolsky.no_more.rst"
    stale.parent.mkdir(parents=True)
    stale.write_text("gone", encoding="utf-8")
    write_pages(App)
    pages = {page.stem for page in stale.parent.iterdir()}
    modules = sources()
    files = [f.relative_to(ROOT) for name in ("kolsky", "dic") for f in (ROOT / name).rglob("*.py")]
    names = {".".join(f.with_suffix("").parts).removesuffix(".__init__") for f in files}
    assert {name for name in names if not name.endswith("__main__")} < set(modules)
    assert set(kolsky._HOME.values()) < pages  # what `import kolsky` offers
    assert {"kolsky.readers", "explicit", "dic.stereo"} < pages  # every package
    assert "kolsky.report.scene.scene_data" in pages  # howto/films.md refers to it
    assert "kolsky.cli.options" not in pages  # nobody does
    assert len(pages) < 0.6 * len(modules)  # the others hold what nobody refers to
    # a page documents its module, whatever names the package offers
    page = (stale.parent / "explicit.run_batch.rst").read_text(encoding="utf-8")
    assert ".. automodule:: explicit.run_batch\n" in page
    package = (stale.parent / "kolsky.report.scene.rst").read_text(encoding="utf-8")
    assert ":doc:`kolsky.report.scene.scene_data`\n   Scene of a film" in package
    # only names in modules without a page may be unknown to a reference
    hidden = re.compile(without_page(modules))
    assert hidden.fullmatch("kolsky.cli.options.sphere")
    assert not hidden.fullmatch("kolsky.report.scene.scene_data.Scene")
    assert not hidden.fullmatch("kolsky.report.scene.misspelt.Scene")
    assert hidden.fullmatch("WrittenName")  # a class of a module without a page, as a docstring names it
    assert not hidden.fullmatch("SceneDataMissing")
    # every way in which a page refers to one
    folder = tmp_path / "docs"
    folder.mkdir()
    for n, said in enumerate(
        (
            "{py:func}`~dic.files.replacing`",
            "{py:mod}`here <dic.basics>`",
            "{doc}`x </api/generated/dic.arrays>`",
        )
    ):
        assert REFERENCE.search(said), said
        (folder / f"{n}.md").write_text(f"see {said}.", encoding="utf-8")
    assert {"dic.files", "dic.basics"} < public(modules, folder)
    assert "kolsky.cli.options" not in public(modules, folder)


HEAD = "---\njupytext:\n  text_representation:\n    format_name: myst\nkernelspec:\n  name: python3\n---\n\n"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the kernel's own libraries
def test_notebooks_are_run_ahead_once_and_a_failing_one_is_named(extensions, tmp_path):
    pytest.importorskip("myst_nb")
    from myst_nb.core.config import NbParserConfig
    from myst_parser.config.main import MdParserConfig
    from notebooks_ahead import run_all
    from sphinx.errors import ExtensionError

    class Env:
        myst_config = MdParserConfig()
        mystnb_config = NbParserConfig(
            execution_mode="cache",
            execution_cache_path=str(tmp_path / "cache"),
            execution_in_temp=True,
            execution_raise_on_error=True,
        )

        def doc2path(self, name):
            return str(tmp_path / f"{name}.md")

    ran = tmp_path / "ran"
    cell = f"```{{code-cell}} ipython3\nwith open({str(ran)!r}, 'a') as f: f.write('NAME')\n```\n"
    (tmp_path / "plain.md").write_text("# No notebook\n", encoding="utf-8")
    for name in "ab":
        (tmp_path / f"{name}.md").write_text(HEAD + cell.replace("NAME", name), encoding="utf-8")
    run_all(None, Env(), ["a", "plain", "b"])
    assert sorted(ran.read_text("utf-8")) == ["a", "b"]
    run_all(None, Env(), ["a", "plain", "b"])
    assert sorted(ran.read_text("utf-8")) == ["a", "b"]  # from the cache
    (tmp_path / "c.md").write_text(HEAD + "```{code-cell} ipython3\n1 / 0\n```\n", encoding="utf-8")
    with pytest.raises(ExtensionError, match=r"c\.md: (.|\n)*ZeroDivisionError"):
        run_all(None, Env(), ["c"])


def test_a_process_writes_to_the_notebooks_cache_only_in_its_turn(extensions, monkeypatch):
    pytest.importorskip("jupyter_cache")
    from jupyter_cache.cache.main import JupyterCacheBase
    from notebooks_ahead import write_in_turn

    said = []

    class Turn:
        def __enter__(self):
            said.append("mine")

        def __exit__(self, *error):
            said.append("free")

    def write(cache, bundle, overwrite):
        said.append((cache, bundle, overwrite))
        return "record"

    monkeypatch.setattr(JupyterCacheBase, "cache_notebook_bundle", write)
    write_in_turn(Turn())
    assert JupyterCacheBase.cache_notebook_bundle("cache", "page", overwrite=True) == "record"
    assert said == ["mine", ("cache", "page", True), "free"]

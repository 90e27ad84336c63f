"""The public names of the packages: loaded at first use, the same for a type checker and at run time."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import dic
import doe
import explicit
import kolsky

ROOT = Path(__file__).resolve().parents[1]
RUNS = sorted((ROOT / "runs").glob("*.py"))


PACKAGES = (kolsky, dic, explicit, doe)
each = pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.__name__)


@each
def test_a_type_checker_and_the_interpreter_find_the_same(package: ModuleType) -> None:
    imports = {
        alias.name: node.module
        for node in ast.walk(ast.parse(Path(str(package.__file__)).read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith(package.__name__)
        for alias in node.names
        if alias.asname is None
    }
    assert imports == package._HOME
    assert sorted(package.__all__) == sorted(package._HOME)


@each
def test_every_public_name_is_there(package: ModuleType) -> None:
    for name in package.__all__:
        # A module of the same name would take its place once it is loaded.
        assert not (Path(str(package.__file__)).parent / f"{name}.py").exists()
        value = getattr(package, name)
        assert value is not None
        if package in (kolsky, dic):  # where it is defined, not where it passes through
            assert value.__module__ == package._HOME[name]


@pytest.mark.parametrize(
    ("package", "wrong", "right"),
    [(kolsky, "lode_shot", "load_shot"), (dic, "Rig", "StereoRig"), (explicit, "runn", "run"),
     (doe, "sobel", "sobol")],
    ids=lambda value: getattr(value, "__name__", value),
)  # fmt: skip
def test_an_unknown_name_lists_those_there_are(package: ModuleType, wrong: str, right: str) -> None:
    assert set(package.__all__) <= set(dir(package))
    with pytest.raises(AttributeError, match=rf"no attribute '{wrong}'; .*{right}"):
        getattr(package, wrong)


@pytest.mark.parametrize("package", PACKAGES[1:], ids=lambda package: package.__name__)
def test_the_package_alone_loads_nothing(package: ModuleType) -> None:
    name = package.__name__
    code = f"import {name}, sys; print([m for m in sys.modules if m == 'warp' or m.startswith('{name}.')])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert run.stdout.strip() == "[]"


@pytest.mark.parametrize("name", kolsky.__all__)
def test_every_public_name_loads_and_is_documented(name: str) -> None:
    value = getattr(kolsky, name)
    assert value.__name__ == name
    text = inspect.getdoc(value) or ""
    first = text.partition("\n\n")[0]
    assert first.endswith("."), first
    if inspect.isclass(value):
        fields = [field for field in getattr(value, "__dataclass_fields__", {})]
        assert fields or "Parameters\n------" in text
        return
    given = list(inspect.signature(value).parameters)
    if len(given) > 1:
        section = text.partition("Parameters\n----------\n")[2]
        assert section, f"{name} has no section Parameters"
        missing = [one for one in given if not one.startswith("_") and one not in section]
        assert not missing, f"{name}: {missing} stand in no line of Parameters"
    assert inspect.signature(value).return_annotation is not inspect.Signature.empty


COLD = """
import sys, time
before, began = set(sys.modules), time.process_time()
import kolsky
spent = time.process_time() - began
print(spent, *sorted({name.split(".")[0] for name in set(sys.modules) - before}))
"""


def test_the_import_is_quick_and_loads_nothing_heavy() -> None:
    seconds = []
    for _ in range(3):  # the best of three: the first may have to compile bytecode
        run = subprocess.run(
            [sys.executable, "-c", COLD], capture_output=True, text=True, cwd=ROOT, timeout=60, check=True
        )
        spent, *loaded = run.stdout.split()
        assert "kolsky" in loaded
        assert not {"numpy", "scipy", "warp", "matplotlib", "pydantic", "h5py", "typer"} & set(loaded)
        seconds.append(float(spent))
    assert min(seconds) < 0.1


def imported(source: str) -> set[str]:
    """Modules of the four packages that a source imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(str(node.module))
    return {name for name in found if name.split(".")[0] in ("kolsky", "dic", "explicit", "doe")}


@pytest.mark.parametrize("path", RUNS, ids=lambda path: path.name)
def test_a_script_needs_the_public_names_only(path: Path) -> None:
    source = path.read_text("utf-8")
    assert imported(source) <= {"kolsky", "doe", "explicit", "dic"}
    asked = {
        node.attr
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "kolsky"
    }
    assert asked <= set(kolsky.__all__)
    assert asked


def test_no_page_of_the_docs_imports_the_command_line() -> None:
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    lines = [line for page in pages for line in page.read_text("utf-8").splitlines()]
    assert len(lines) > 1000
    assert not [line for line in lines if line.strip().startswith(("from kolsky.cli", "import kolsky.cli"))]


def test_the_script_per_shot_is_ten_lines() -> None:
    lines = (ROOT / "runs" / "per_shot.py").read_text("utf-8").split('"""')[2].strip().splitlines()
    code = [line for line in lines if line and not line.startswith(("import", "print"))]
    assert len(code) <= 10


def test_every_result_with_figures_is_a_class_that_exists() -> None:
    from importlib import import_module

    from kolsky.report.figures import SHOWN_BY, figures_of

    for name in SHOWN_BY:
        module, _, kind = name.rpartition(".")
        shown = getattr(import_module(module), kind)
        assert inspect.isclass(shown)
        assert shown.__module__ == module  # where it is defined: its figures are looked up by that name
    with pytest.raises(TypeError, match=r"no figure shows a int; there are figures of .*Identification"):
        figures_of(3)

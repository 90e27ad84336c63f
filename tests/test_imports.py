"""Who may import whom: the arrows of docs/architecture.md, read from the source of every module."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("kolsky", "dic", "explicit", "doe")

MAY_IMPORT = {
    "kolsky": {"kolsky", "dic", "explicit", "doe"},
    "dic": {"dic"},
    "explicit": {"explicit"},
    "doe": {"doe"},
}
"""Which of the four packages each may import."""

READERS_MAY_IMPORT = ("kolsky.records", "kolsky.errors", "kolsky.units", "kolsky.readers")
"""A reader knows one instrument format and no physics."""

COMMAND_LINE = {"kolsky.commands": ("kolsky.commands", "kolsky.cli"), "kolsky.cli": ("kolsky.cli",)}
"""Rooms of the command line, each with those that may import it."""

PLOTTING = {"matplotlib", "pyvista", "vtk", "vtkmodules"}
HEAVY = sorted({"warp", "scipy", "cv2", *PLOTTING})

ALLOWED: dict[tuple[str, str], str] = {}
"""Exceptions: (importing module, imported module) -> the reason. Empty is the aim."""


class Import(NamedTuple):
    """One import of one module, wherever in the file it stands."""

    line: int
    target: str


def repository_modules() -> dict[str, Path]:
    """Dotted name -> file, of every module of the four packages."""
    modules = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return modules


MODULES = repository_modules()


def imports_of(source: str, module: str, *, is_package: bool = False) -> Iterator[Import]:
    """Every import in `source`: at the top, in functions, under TYPE_CHECKING, and by name at run time."""
    for node in ast.walk(ast.parse(source, filename=module)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(node.lineno, alias.name)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:  # one dot is the package itself: for a module that is one name up
                up = node.level - 1 if is_package else node.level
                parts = module.split(".")
                base = ".".join([*parts[: len(parts) - up], *([base] if base else [])])
            for alias in node.names:
                submodule = f"{base}.{alias.name}"
                yield Import(node.lineno, submodule if submodule in MODULES else base)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in (
            "import_module",
            "__import__",
        ):
            name = node.args[0] if node.args else None
            known = isinstance(name, ast.Constant) and isinstance(name.value, str)
            yield Import(node.lineno, name.value if known else "a name computed at run time")


def _inside(module: str, room: str) -> bool:
    return module == room or module.startswith(f"{room}.")


def violation(module: str, target: str) -> str | None:
    """The rule that `module` breaks by importing `target`, or None."""
    package, top = module.split(".")[0], target.split(".")[0]
    if target == "a name computed at run time":
        return "imports must be written out, so that they can be read"
    if top in PACKAGES and top not in MAY_IMPORT[package]:
        return f"{package} may import of the four packages only {sorted(MAY_IMPORT[package])}"
    in_readers = module == "kolsky.readers" or module.startswith("kolsky.readers.")
    free_to_readers = any(target == free or target.startswith(f"{free}.") for free in READERS_MAY_IMPORT)
    if in_readers and top in PACKAGES and not free_to_readers:
        return f"readers may import of the four packages only {list(READERS_MAY_IMPORT)}"
    if top == "warp":
        dic_kernel = package == "dic" and any("kernels" in part for part in module.split(".")[1:])
        if package != "explicit" and not dic_kernel:
            return "Warp belongs in explicit and in the kernels of dic"
    for room, users in COMMAND_LINE.items():
        if _inside(target, room) and not any(_inside(module, user) for user in users):
            return f"{room} is the command line's: what others need of it belongs elsewhere"
    in_report = module == "kolsky.report" or module.startswith("kolsky.report.")
    if top in PLOTTING and not in_report:
        return "Matplotlib and PyVista belong in kolsky.report"
    return None


def violations(source: str, module: str, *, is_package: bool = False) -> list[str]:
    """Every broken rule of one module as 'module:line imports target: rule'."""
    found = []
    for line, target in imports_of(source, module, is_package=is_package):
        rule = violation(module, target)
        if rule and (module, target) not in ALLOWED:
            found.append(f"{module}:{line} imports {target}: {rule}")
    return found


@pytest.mark.parametrize("module", sorted(MODULES))
def test_the_arrows_hold(module):
    path = MODULES[module]
    broken = violations(path.read_text("utf-8"), module, is_package=path.name == "__init__.py")
    assert not broken, "\n".join(broken)


def test_every_exception_has_a_reason_and_is_used():
    for (module, target), reason in ALLOWED.items():
        assert reason, f"no reason for {module} -> {target}"
        path = MODULES[module]
        source = path.read_text("utf-8")
        targets = {i.target for i in imports_of(source, module, is_package=path.name == "__init__.py")}
        assert target in targets, f"stale exception: {module} no longer imports {target}"


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("explicit.step", "import kolsky"),
        ("explicit.step", "from kolsky.records import ForceHistory"),
        ("dic.camera", "def f():\n    from explicit import Response"),
        ("doe.search", "if TYPE_CHECKING:\n    import dic.surface"),
        ("doe.search", "import importlib\nimportlib.import_module('kolsky.misfit')"),
        ("doe.search", "__import__('explicit')"),
        ("kolsky.readers", "from importlib import import_module\nimport_module(name)"),
        ("kolsky.misfit", "import warp as wp"),
        ("dic.surface", "from warp import sparse"),
        ("doe.designs", "import warp.optim"),
        ("kolsky.identify", "def draw():\n    import matplotlib.pyplot as plt"),
        ("explicit.mesh", "import pyvista"),
        ("kolsky.readers.scope", "from kolsky.misfit import phi_force"),
        ("kolsky.readers.scope", "from ..apparatus import Bar"),
        ("kolsky.readers.scope", "from .. import apparatus"),
        ("kolsky.readers.scope", "from kolsky import apparatus"),
        ("kolsky.readers.scope", "import explicit"),
        ("kolsky.readers.scope", "import kolsky"),
        ("kolsky.notebook", "from kolsky.commands import options"),
        ("kolsky.report.page", "import kolsky.commands.options"),
        ("kolsky.commands.sweep", "from kolsky.cli.shared import ShotPath"),
    ],
)
def test_the_checker_sees_a_violation(module, source):
    assert len(violations(source, module)) == 1


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("kolsky.forward", "import explicit\nfrom dic import surface\nfrom doe.designs import sobol"),
        ("explicit.kernels", "import warp as wp\nimport numpy as np\nfrom .mesh import Mesh"),
        ("dic.kernels.subset", "import warp as wp"),
        ("kolsky.report.figures.force", "import matplotlib.pyplot as plt\nfrom ... import misfit"),
        ("kolsky.readers.scope", "from kolsky.records import Recording\nfrom kolsky import records"),
        ("kolsky.cli.sweep", "from kolsky.commands.sweep import sweep\nfrom kolsky.cli import shared"),
        ("kolsky.readers.scope", "from . import text\nfrom ..records import Recording\nimport numpy"),
    ],
)
def test_the_checker_lets_the_allowed_pass(module, source):
    assert violations(source, module) == []


def test_the_checker_reads_the_repository():
    assert {"kolsky.records", "explicit", "dic.surface", "doe", "kolsky.readers"} <= set(MODULES)
    targets = {i.target for i in imports_of(MODULES["kolsky.identification"].read_text("utf-8"), "kolsky")}
    assert {"explicit", "kolsky.records", "numpy"} <= targets


def test_relative_imports_of_a_package_start_at_the_package():
    found = list(
        imports_of("from . import scope\nfrom ..records import Recording", "kolsky.readers", is_package=True)
    )
    assert [i.target for i in found] == ["kolsky.readers", "kolsky.records"]


HELP = """
import sys, time
sys.argv = ["kolsky", "--help"]
from kolsky.cli import main
try:
    main()
finally:
    loaded = sorted({name.split(".")[0] for name in sys.modules})
    print("loaded:", time.process_time(), *loaded, file=sys.stderr)
"""


def test_help_loads_nothing_heavy_and_is_quick():
    seconds = []
    for _ in range(3):  # the best of three: the first may have to compile bytecode
        run = subprocess.run(
            [sys.executable, "-c", HELP], capture_output=True, text=True, cwd=ROOT, timeout=60
        )
        assert run.returncode == 0, run.stderr
        assert "check" in run.stdout  # the commands are listed
        spent, *loaded = run.stderr.rpartition("loaded:")[2].split()
        assert "kolsky" in loaded
        assert not set(HEAVY) & set(loaded)
        seconds.append(float(spent))
    # processor time, start of Python included: waiting on a loaded machine is no fault of the command line
    assert min(seconds) < 0.3

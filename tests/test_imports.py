"""Allowed imports: the arrows of docs/architecture.md, compared with the source of every module."""

import ast
import tomllib
from collections.abc import Iterable, Iterator
from functools import cache
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

OF_EXPLICIT = ("explicit.materials", "explicit.arrays", "explicit.device", "explicit.precision")
"""What `kolsky.equilibrium` may import of `explicit`: its laws, and what both need of Warp and NumPy."""

TABLES = tomllib.loads((ROOT / "docs" / "rooms.toml").read_text("utf-8"))
ROOMS = {"kolsky": TABLES["room"], "dic": TABLES["dic"]}
"""The rooms of two packages, in the order in which they may import each other; some with rooms inside."""
ORDER = {package: [room["name"] for room in rooms] for package, rooms in ROOMS.items()}
INSIDE = {
    package: {room["name"]: room.get("inside", []) for room in rooms} for package, rooms in ROOMS.items()
}

PLOTTING = {"matplotlib", "pyvista", "vtk", "vtkmodules"}
HDF5 = ("kolsky.base.hdf5", "kolsky.base.hdf5_records", "kolsky.readers", "dic.images")
"""Who may use h5py: the codec of our own files, and the readers of the files of others."""

ALLOWED: dict[tuple[str, str], str] = {
    ("kolsky", "a name computed at run time"): "public names, loaded when first used",
    ("kolsky.report.figures", "a name computed at run time"): "files of this room, loaded with their page",
    (
        "kolsky.report.result_folder",
        "a name computed at run time",
    ): "tables of a result, loaded with its type",
    ("kolsky.bars.flyer.kernels", "warp"): "a recursion over frames, hundreds of times for each flyer",
    ("explicit", "a name computed at run time"): "public names, loaded when first used",
    ("dic", "a name computed at run time"): "public names, loaded when first used",
    ("doe", "a name computed at run time"): "public names, loaded when first used",
}
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
        elif isinstance(node, ast.Call) and (
            getattr(node.func, "attr", None) or getattr(node.func, "id", None)
        ) in ("import_module", "__import__"):
            name = node.args[0] if node.args else None
            known = isinstance(name, ast.Constant) and isinstance(name.value, str)
            yield Import(node.lineno, name.value if known else "a name computed at run time")


@cache
def imports_in(module: str) -> tuple[Import, ...]:
    """Every import of a module of the four packages."""
    path = MODULES[module]
    return tuple(imports_of(path.read_text("utf-8"), module, is_package=path.name == "__init__.py"))


def _inside(module: str, room: str) -> bool:
    return module == room or module.startswith(f"{room}.")


def room_violation(module: str, target: str) -> str | None:
    """The rule of the rooms that an import inside `kolsky` or `dic` breaks, or None.

    The package itself (its `__init__.py`) is the public API: it may name what every room offers, and no
    room may import it.
    """
    package = module.split(".")[0]
    if module == package:
        return None
    rooms_in_order = ORDER[package]
    here, there = module.split(".")[1:], target.split(".")[1:]
    if not there or there[0] not in rooms_in_order:
        return f"{target} is no room of docs/rooms.toml"
    if here[0] not in rooms_in_order:
        return f"{module} is in no room of docs/rooms.toml"
    if rooms_in_order.index(there[0]) > rooms_in_order.index(here[0]):
        return f"{there[0]} stands below {here[0]} in docs/rooms.toml"
    if here[0] == there[0]:
        order = INSIDE[package][here[0]]
        rooms = [path[1] if len(path) > 1 and path[1] in order else "" for path in (here, there)]
        if all(rooms) and order.index(rooms[1]) > order.index(rooms[0]):
            return f"{here[0]}/{rooms[1]} stands below {here[0]}/{rooms[0]} in docs/rooms.toml"
    return None


def violation(module: str, target: str) -> str | None:
    """The rule that `module` breaks by importing `target`, or None."""
    package, top = module.split(".")[0], target.split(".")[0]
    if target == "a name computed at run time":
        return "imports must be written out, so that they can be read"
    if top in PACKAGES and top not in MAY_IMPORT[package]:
        return f"{package} may import of the four packages only {sorted(MAY_IMPORT[package])}"
    equilibrium = _inside(module, "kolsky.equilibrium")
    if equilibrium and top == "explicit" and not any(_inside(target, x) for x in OF_EXPLICIT):
        return f"equilibria may import of explicit only {OF_EXPLICIT}"
    if package == top and package in ORDER:
        broken = room_violation(module, target)
        if broken:
            return broken
    if _inside(module, "kolsky.readers") and top in {"dic", "explicit", "doe"}:
        return "a reader knows one file format and no physics"
    if top == "warp":
        dic_kernel = package == "dic" and any("kernels" in part for part in module.split(".")[1:])
        if package != "explicit" and not equilibrium and not dic_kernel:
            return "Warp belongs in explicit, in kolsky.equilibrium and in the kernels of dic"
    if top == "h5py" and not any(_inside(module, place) for place in HDF5):
        return "files of results go through kolsky.base.hdf5"
    in_report = module == "kolsky.report" or module.startswith("kolsky.report.")
    if top in PLOTTING and not in_report:
        return "Matplotlib belongs in kolsky.report"
    return None


def violations(source: str, module: str, *, is_package: bool = False) -> list[str]:
    """Every broken rule of one source as 'module:line imports target: rule'."""
    return broken(module, imports_of(source, module, is_package=is_package))


def broken(module: str, imports: Iterable[Import]) -> list[str]:
    """Every rule that imports of a module break."""
    found = []
    for line, target in imports:
        rule = violation(module, target)
        if rule and (module, target) not in ALLOWED:
            found.append(f"{module}:{line} imports {target}: {rule}")
    return found


def test_the_arrows_hold():
    found = [one for module in sorted(MODULES) for one in broken(module, imports_in(module))]
    assert not found, "\n".join(found)


def test_no_imports_run_in_a_circle():
    arrows = {
        module: {one.target for one in imports_in(module) if one.target in MODULES and one.target != module}
        for module in MODULES
    }
    assert circles(arrows) == []


def circles(arrows: dict[str, set[str]]) -> list[list[str]]:
    """Modules in circles: what is left when modules that import nothing left are taken away again and again,
    and then those that nothing left imports."""
    left = {module: set(targets) for module, targets in arrows.items()}
    for _ in range(2):
        while free := [module for module, targets in left.items() if not targets & left.keys()]:
            for module in free:
                del left[module]
        turned: dict[str, set[str]] = {module: set() for module in left}
        for module, targets in left.items():
            for target in targets & left.keys():
                turned[target].add(module)
        left = turned
    return [sorted(left)] if left else []


def test_circles_are_seen():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": set(), "e": {"a", "d"}}) == [["b", "c"]]
    assert circles({"a": {"b"}, "b": {"c"}, "c": set()}) == []


@pytest.mark.parametrize("package", ORDER)
def test_every_room_is_in_the_table_and_the_other_way_round(package):
    folder = ROOT / package
    rooms = {path.name for path in folder.iterdir() if (path / "__init__.py").is_file()}
    rooms |= {path.stem for path in folder.glob("*.py")} - {"__init__"}
    assert rooms == set(ORDER[package])
    for room, inside in INSIDE[package].items():
        there = {path.parent.name for path in (folder / room).glob("*/__init__.py")}
        assert set(inside) <= there


def test_every_exception_has_a_reason_and_is_used():
    for (module, target), reason in ALLOWED.items():
        assert reason, f"no reason for {module} -> {target}"
        targets = {i.target for i in imports_in(module)}
        assert target in targets, f"stale exception: {module} no longer imports {target}"


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("explicit.step", "import kolsky"),
        ("explicit.step", "from kolsky.base.records import ForceHistory"),
        ("dic.camera", "def f():\n    from explicit import Response"),
        ("doe.search", "if TYPE_CHECKING:\n    import dic.surfaces.surface_history"),
        ("doe.search", "import importlib\nimportlib.import_module('kolsky.inverse.run_table')"),
        ("doe.search", "__import__('explicit')"),
        ("kolsky.readers", "from importlib import import_module\nimport_module(name)"),
        ("kolsky.inverse.run_table", "import warp as wp"),
        ("dic.surfaces.surface_history", "from warp import sparse"),
        ("doe.designs", "import warp.optim"),
        ("kolsky.identification", "def draw():\n    import matplotlib.pyplot as plt"),
        ("explicit.mesh", "import pyvista"),
        ("kolsky.equilibrium.solve", "import kolsky"),
        ("kolsky.equilibrium.solve", "from explicit.mesh import Mesh"),
        ("kolsky.results.hdf5", "def f():\n    import h5py"),
        ("kolsky.readers.measured_tables", "from kolsky.inverse.run_table import phi_force"),
        ("kolsky.readers.measured_tables", "from ..bars import records"),
        ("kolsky.readers.measured_tables", "from .. import identification"),
        ("kolsky.readers.measured_tables", "from kolsky import identification"),
        ("kolsky.readers.measured_tables", "import explicit"),
        ("kolsky.readers.measured_tables", "import kolsky"),
        ("kolsky.base.errors", "from kolsky.readers import table"),
        ("kolsky.inverse.result", "def show():\n    from kolsky.results.printed import answer"),
        ("kolsky.bars.signals.baseline", "from kolsky.bars.reduction import windows"),
        ("kolsky.bars.flyer.fit", "from kolsky.bars.reduction.separation import face_waves"),
        ("kolsky.results.hdf5", "from kolsky.studies.sweep import sweep"),
        ("kolsky.report.result_folder", "from kolsky.cli import terminal"),
        ("kolsky.cupboard", "import numpy\nfrom kolsky.base import errors"),
        ("dic.images.series", "from dic.tracking import frames"),
        ("dic.stereo.epipolar_search", "from dic.result import Body"),
        ("dic.surfaces.cylinder", "import dic"),
        ("kolsky.report.pages.identification", "from kolsky.cupboard import broom"),
    ],
)
def test_the_checker_sees_a_violation(module, source):
    assert len(violations(source, module)) == 1


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("kolsky.inverse.forward", "import explicit\nfrom dic import surface\nfrom doe.designs import sobol"),
        ("explicit.kernels", "import warp as wp\nimport numpy as np\nfrom .mesh import Mesh"),
        ("dic.kernels.subset", "import warp as wp"),
        ("kolsky.report.figures.comparison",
         "import matplotlib.pyplot as plt\nfrom ...inverse import misfit"),
        ("kolsky.readers.measured_tables",
         "from kolsky.base.records import Recording\nfrom kolsky.base import records"),
        ("kolsky.cli.sweep", "from kolsky.studies.sweep import sweep\nfrom kolsky.cli import options"),
        ("kolsky.bars.reduction.separation", "from kolsky.bars.budget import Budget"),
        ("kolsky.bars.flyer.path", "from kolsky.bars import records"),
        ("dic.chain", "from dic.camera import StereoRig\nfrom dic.chain import remarks"),
        ("kolsky", "from kolsky.cli import main\nfrom kolsky.shot.load import load_shot"),
        ("kolsky.readers.measured_tables",
         "from . import text\nfrom ..base.records import Recording\nimport numpy"),
    ],
)  # fmt: skip
def test_the_checker_lets_the_allowed_pass(module, source):
    assert violations(source, module) == []


def test_the_checker_reads_the_repository():
    known = {"kolsky.base.records", "explicit", "dic.surfaces.surface_history", "doe", "kolsky.readers"}
    assert known <= set(MODULES)
    targets = {i.target for i in imports_of(MODULES["kolsky.inverse.result"].read_text("utf-8"), "kolsky")}
    assert {"explicit", "kolsky.base.records", "numpy"} <= targets


def test_relative_imports_of_a_package_start_at_the_package():
    found = list(
        imports_of(
            "from . import scope\nfrom ..base.records import Recording", "kolsky.readers", is_package=True
        )
    )
    assert [i.target for i in found] == ["kolsky.readers", "kolsky.base.records"]

"""`kolsky doctor`: check of the installation: versions, devices, cache, writable folders."""

import platform
import shutil
import tempfile
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any

import typer

from dic.processes import cores
from kolsky.base.files import jsonable
from kolsky.cli.terminal import print_result


def doctor(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder of shots, checked for space and write access.")
    ] = Path(),
) -> None:
    """Check the installation: versions, devices, cache of compiled kernels, packages, writable folders.

    The exit code is 1 if something that is installed with this package is missing.
    """
    found = examine(folder)
    print_result(rows(found), jsonable(found, "doctor"), warnings=found["problems"])
    if found["problems"]:
        raise typer.Exit(1)


REQUIRED = (
    "warp-lang",
    "numpy",
    "scipy",
    "h5py",
    "matplotlib",
    "pydantic",
    "pint",
    "opencv-contrib-python-headless",
    "scikit-image",
    "pyvista",
    "npTDMS",
    "pandas",
    "xarray",
)
"""Distributions that are installed with this package, by pip and by conda."""
OPTIONAL = {
    "RigolWFM": ("RigolWFM", "binary files of oscilloscopes"),
    "emcee": ("kolsky[bayes]", "posterior by Markov chains"),
    "imageio-ffmpeg": ("kolsky[film]", "films of the deforming specimen"),
}
"""Optional distributions: name for pip, and purpose. Conda does not provide RigolWFM."""
_TWINS = {
    "opencv-contrib-python-headless": ("opencv-python-headless", "opencv-python", "opencv-contrib-python")
}
"""Alternative distributions with the same modules."""
LEAST_SPACE = 1e9
"""Free space below which a long study may fail [bytes]."""


def rows(found: Mapping[str, Any]) -> dict[str, str]:
    """The findings of `examine` as names and texts."""
    shown = {name: version or "missing" for name, version in found["versions"].items()}
    shown["devices"] = ", ".join(found["devices"]) or "none"
    shown["cores"] = str(found["cores"])
    shown["compiled kernels"] = str(found["cache"] or "nowhere")
    shown |= {
        name: found["extras"][name] or f"not installed ({what}): pip install '{source}'"
        for name, (source, what) in OPTIONAL.items()
    }
    free = found["free_bytes"]
    shown["results"] = f"{found['folder']}, " + ("not there" if free is None else f"{free / 1e9:.0f} GB free")
    return shown


def examine(folder: Path) -> dict[str, Any]:
    """Check the installation without leaving files.

    Returns: versions, None if missing, of this package, Python, the system, every required distribution and,
    as ``extras``, every optional one; devices of the solver, the CPU first; cores; compiled kernels' folder,
    None if the solver's library did not start; folder of the results and its free space [bytes]; problems,
    one sentence each with the remedy.
    """
    versions = {
        "kolsky": _version("kolsky"),
        "Python": platform.python_version(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        **{name: _version(name, *_TWINS.get(name, ())) for name in REQUIRED},
    }
    problems = [
        f"{name} is not installed: pip install kolsky, or pip install {name}"
        for name in REQUIRED
        if versions[name] is None
    ]
    devices, cache, failures = _devices()
    problems += failures
    problems += [why for place in (folder, cache) if place is not None and (why := _unwritable(place))]
    free = float(shutil.disk_usage(folder).free) if folder.is_dir() else None
    if free is not None and free < LEAST_SPACE:
        problems.append(f"{folder.resolve()} has {free / 1e6:.0f} MB left: make room, or give --out FOLDER")
    return {
        "versions": versions,
        "extras": {name: _version(name) for name in OPTIONAL},
        "devices": devices,
        "cores": cores(),
        "cache": cache,
        "folder": folder.resolve(),
        "free_bytes": free,
        "problems": problems,
    }


def _version(*names: str) -> str | None:
    """Version of the first of some distributions that is installed."""
    for name in names:
        try:
            return version(name)
        except PackageNotFoundError:
            continue
    return None


def _devices() -> tuple[tuple[str, ...], Path | None, list[str]]:
    """Devices, folder of compiled kernels, and the reasons if there are none."""
    try:
        from explicit.device import available, kernel_cache

        return available(), kernel_cache(), []
    except Exception as error:  # whatever keeps a library from starting is the finding
        cure = "pip install --force-reinstall warp-lang"
        return (), None, [f"warp does not start ({' '.join(str(error).split())}): {cure}"]


def _unwritable(folder: Path) -> str:
    """Reason why a folder is not writable. Empty if it is writable."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return f"{folder} cannot be written to ({error.strerror}): give another place with --out FOLDER"

"""Rate report of several shots: files, recordings and results are collected, grouped and compared."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ConfigDict

from kolsky.base.errors import InputError, refused
from kolsky.base.records import MaterialCurve
from kolsky.base.toml import TomlFile
from kolsky.inverse.result import Identification
from kolsky.results.hdf5 import read_identification
from kolsky.schema import fields as f
from kolsky.schema.fields import Section
from kolsky.schema.shot_file import Source, folder_of, parsed
from kolsky.shot.load import load_shot
from kolsky.shot.optical_data import measured
from kolsky.shot.records import OpticalData, Shot
from kolsky.studies.rates.comparison import STRAINS, compare
from kolsky.studies.rates.records import PARAMETER, QuasiStatic, RatedShot, RateReport, strain_history

RESULT_FILE = "identification.h5"
GROUP_KEYS = ("group", "material")
"""Default keys of a shot file for grouping. They are tried in this order."""
ALL = "all shots"
LOOSE = ConfigDict(extra="ignore", frozen=True, strict=True)


class RateCurveSection(Section):
    """The keys of [curve] or [law] for the rate of its tests."""

    model_config = LOOSE
    baseline: bool = True
    strain_rate: f.StrainRate | None = None


class RateShotFile(Section):
    """The keys of a shot.toml that a comparison of rates reads in addition to the recordings."""

    model_config = LOOSE
    material: f.Name | None = None
    group: f.Name | None = None
    rig: f.Name | None = None
    curve: RateCurveSection | None = None
    law: RateCurveSection | None = None

    @property
    def quasi_static_rate(self) -> float | None:
        """Rate of the reference of m [1/s]. It is that of [law] if [law] is the baseline, otherwise of
        [curve]."""
        said = self.law if self.law is not None and self.law.baseline else self.curve
        return None if said is None else said.strain_rate


def declarations(shot: Source) -> tuple[TomlFile, RateShotFile]:
    """Read material, group, rig and the reference curve's rate from a shot file.

    Raises InputError if there is no such file, or if one of these values cannot be used.
    """
    file = parsed(shot)
    declared = file.validated(RateShotFile)
    return file, declared


def group_key(files: list[TomlFile], wanted: str | None) -> str:
    """The key for grouping. "" if none is given and no default key is present."""
    if wanted:
        return wanted
    return next((key for key in GROUP_KEYS if any(key in file.content for file in files)), "")


def group_of(file: TomlFile, key: str) -> str:
    """The value of a dotted key in a shot file.

    Raises InputError if the shot file has no such key, or if the key is a table.
    """
    if not key:
        return ALL
    value = file.written(key)
    if value is None:
        raise InputError(
            file.path,
            f"has no {key!r} to group the shots by",
            cure=f'add e.g. {key} = "..." to every shot, or group by another key with --group KEY',
        )
    if isinstance(value, dict | list):
        raise InputError(
            file.path,
            "is a table or list, which cannot name a group",
            key=key,
            cure="name a text or a number to group by",
        )
    return str(value)


def result_of(shot: Path) -> Path:
    """Path of the result that `kolsky identify` writes for a shot."""
    return folder_of(shot) / "results" / RESULT_FILE


def collected_shot(
    shot: Source, *, group: str, measure: Callable[[Any], OpticalData] | None = None
) -> RatedShot:
    """One shot with its rate and its result.

    ``shot``: the shot's folder, its shot.toml, or the parsed shot.toml. ``measure``: as in
    `kolsky.shot.load.load_shot`. Raises InputError if the shot cannot be loaded or has no result. The same
    error is raised if its result belongs to other files or has no stiffness factor.
    """
    file, declared = declarations(shot)
    place = result_of(file.path)
    if not place.exists():
        raise InputError(
            place, "there is no result of this shot", cure=f"`kolsky identify {file.path.parent}` writes one"
        )
    loaded = load_shot(file, measure=measure)
    found = read_identification(place)
    _same_files(place, found, loaded, file.path.name)
    if PARAMETER not in found.estimates:
        raise InputError(
            place,
            f"has no {PARAMETER}: it was held, not identified",
            cure=f"identify it with --free {PARAMETER}",
        )
    with refused(loaded.folder, cure="identify the shot again"):
        history = strain_history(loaded)
    return RatedShot(
        name=loaded.name,
        group=group,
        rig=declared.rig or "the same rig",
        history=history,
        quasi_static=QuasiStatic(loaded.curve, digest(loaded.curve), declared.quasi_static_rate),
        found=found,
        specimen=(loaded.specimen.diameter, loaded.specimen.length),
        conditions=conditions(found),
    )


def digest(curve: MaterialCurve) -> str:
    """SHA-256 of a curve's numbers, hex. Shots with the same hash have the same curve errors, even from
    different files."""
    modes = np.zeros(0) if curve.modes is None else curve.modes
    made = hashlib.sha256()
    for array in (curve.stretch, curve.stress, curve.sigma, modes):
        made.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return made.hexdigest()


def conditions(found: Identification) -> dict[str, str]:
    """Simulation conditions of a result that affect its stiffness factor, in words."""
    settings = found.provenance.get("settings")
    numerics = settings.get("numerics") if isinstance(settings, dict) else None
    numerics = numerics if isinstance(numerics, dict) else {}
    interface = found.provenance.get("interface")
    laws = interface if isinstance(interface, dict) else {}
    words = {name: f"{value:.6g}" for name, value in sorted(found.fixed.items()) if name != PARAMETER}
    free = sorted(name for name in found.estimates if name != PARAMETER)
    return {
        **words,
        "freed parameters": ", ".join(free) or "none",
        "mesh": f"{found.refined_mesh[0]} x {found.refined_mesh[1]}",
        "element": str(numerics.get("element", "not stated")),
        "interface, end faces": str(laws.get("faces", "not stated")),
        "interface, side surface": str(laws.get("side", "not stated")),
        "support": str(found.provenance.get("support", "not stated")),
    }


def _same_files(place: Path, found: Identification, loaded: Shot, shot_file: str) -> None:
    """Reject a result of other recordings. A group or a rate may have been added to the shot file."""
    made_of = found.provenance.get("inputs")
    if not isinstance(made_of, dict):
        raise InputError(place, "does not name the files it was made of", cure="identify the shot again")
    changed = sorted(
        name for name, digest in loaded.inputs.items() if name != shot_file and made_of.get(name) != digest
    )
    if changed:
        raise InputError(
            place, f"was made of another {changed[0]} than the shot has now", cure="identify the shot again"
        )
    specimen = found.provenance.get("specimen")
    now = {name: getattr(loaded.specimen, name) for name in ("diameter", "length", "density")}
    window = found.provenance.get("window_s")
    if specimen != now or not isinstance(window, list) or tuple(window) != loaded.window:
        raise InputError(
            place,
            "was made with another specimen or window than the shot file declares now",
            cure="identify the shot again",
        )


def rate(
    shots: Sequence[str | Path],
    *,
    group: str = "",
    strains: Sequence[float] = STRAINS,
    shared: float = 0.0,
    keep_unexplained: bool = False,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> RateReport:
    """Compare the stiffness of identified shots over their strain rates: mean, scatter, slope.

    Parameters
    ----------
    shots
        Shots' folders, or their shot.toml files. Each shot has its result in its folder "results".
    group
        Key of the shot files for grouping. "" uses `group` or `material` if a shot has it.
    strains
        Nominal compressive strains of the tables, each in (0, 1).
    shared
        Relative standard uncertainty common to all stiffness factors [-].
    keep_unexplained
        True to include shots with data that the model does not explain. By default they are left out.
    progress
        Called with the number of shots done, and with the stages of image correlation.

    Raises
    ------
    InputError
        If a shot has no result or cannot be used, or if two shots have the same name.
    ValueError
        If a strain or `shared` is out of range.
    """
    paths = [Path(shot) for shot in shots]
    files = [declarations(path)[0] for path in paths]  # bad input is refused before any work
    key = group_key(files, group or None)
    groups = [group_of(file, key) for file in files]
    collected: dict[str, RatedShot] = {}
    for number, (file, name) in enumerate(zip(files, groups, strict=True)):
        progress("rate", number, len(paths))
        one = collected_shot(
            file,
            group=name,
            # Results from pictures are stored with the shot's results.
            measure=partial(measured, folder=file.path.parent / "results", progress=progress),
        )
        one = replace(one, keep_unexplained=keep_unexplained)
        if one.name in collected:
            raise InputError(
                file.path.parent, f"another shot is called {one.name!r} too", cure="give each its own name"
            )
        collected[one.name] = one
    progress("rate", len(paths), len(paths))
    return compare(list(collected.values()), strains=strains, shared=shared, grouped_by=key)

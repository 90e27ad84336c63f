"""Several shots to a report on their rates: collected, grouped, compared."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.inverse.result import Identification
from kolsky.shot.optical_data import measured
from kolsky.shot.records import Shot
from kolsky.shot.schema.reading import TomlFile
from kolsky.studies.rates.collect import collected_shot, declarations, group_key, group_of
from kolsky.studies.rates.comparison import STRAINS, compare
from kolsky.studies.rates.records import RatedShot, RateReport

__all__ = ["rate"]

Identify = Callable[[Path, Shot], Identification]


def rate(
    shots: Sequence[str | Path],
    *,
    group: str = "",
    strains: Sequence[float] = STRAINS,
    shared: float = 0.0,
    identify: Identify | None = None,
    keep_unexplained: bool = False,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> RateReport:
    """Compare the stiffness of identified shots over their strain rates: mean, scatter, slope.

    Parameters
    ----------
    shots
        Shots' folders, or their shot.toml files; each has its result in its folder "results".
    group
        Key of the shot files to group by; "" takes `group` or `material` where a shot has it.
    strains
        Nominal compressive strains of the tables, each in (0, 1).
    shared
        Relative standard uncertainty common to all stiffness factors [-].
    identify
        Called as ``identify(path, shot)`` for a shot that has no result yet; without it such a shot is
        refused.
    keep_unexplained
        Count shots whose data the model does not explain, too; they are left out otherwise.
    progress
        Told of the shots done, and of the stages of image correlation.

    Raises
    ------
    InputError
        If a shot has no result or cannot be used, or two have one name.
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
        one = replace(_collected(file, name, identify, progress), keep_unexplained=keep_unexplained)
        if one.name in collected:
            raise InputError(
                file.path.parent, f"another shot is called {one.name!r} too", cure="give each its own name"
            )
        collected[one.name] = one
    progress("rate", len(paths), len(paths))
    return compare(list(collected.values()), strains=strains, shared=shared, grouped_by=key)


def _collected(file: TomlFile, group: str, identify: Identify | None, progress: Any) -> RatedShot:
    """One shot; what its pictures give is kept among its own results."""
    return collected_shot(
        file,
        group=group,
        identify=None if identify is None else lambda shot: identify(file.path, shot),
        measure=lambda seen: measured(seen, file.path.parent / "results", progress=progress),
    )

"""Repeated tests between bars: each reduced, then their mean curve with its band."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kolsky.bars.records import Reduction
from kolsky.bars.reduction.analyse import analyse
from kolsky.bars.reduction.repeated_tests import RepeatedTests, repeated_tests
from kolsky.base.errors import InputError
from kolsky.shot.bars import load_waves
from kolsky.shot.schema.reading import folder_of


@dataclass(frozen=True)
class RepeatedShots:
    """Repeats of one test, with their mean."""

    names: tuple[str, ...]
    """Names of the shots, in the order of the rows of `mean.repeats.values`."""
    mean: RepeatedTests
    """Mean stress over strain, with its band."""

    def columns(self) -> dict[str, list[float]]:
        """The mean, its 95 % band and every test over strain, as columns of a table."""
        low, high = self.mean.band()
        together = self.mean.repeats
        return {
            "strain (1)": together.axis.tolist(),
            "mean stress (Pa)": together.mean.tolist(),
            "low end of the 95 % band (Pa)": low.tolist(),
            "high end of the 95 % band (Pa)": high.tolist(),
            "scatter between tests (Pa)": together.scatter.tolist(),
            "shared standard uncertainty (Pa)": self.mean.shared.tolist(),
            **{f"{name} (Pa)": row.tolist() for name, row in zip(self.names, together.values, strict=True)},
        }

    def summary(self) -> dict[str, Any]:
        """The largest mean stress with its band, for JSON, SI."""
        low, high = self.mean.band()
        together = self.mean.repeats
        at = int(abs(together.mean).argmax())
        return {
            "tests": list(self.names),
            "strain_range": [float(together.axis[0]), float(together.axis[-1])],
            "largest_mean_stress": {
                "value": float(together.mean[at]),
                "band": [float(low[at]), float(high[at])],
                "strain": float(together.axis[at]),
                "scatter": float(together.scatter[at]),
                "unit": self.mean.unit,
            },
            "remarks": list(together.remarks),
        }


def repeats(
    shots: Sequence[str | Path],
    *,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> RepeatedShots:
    """Reduce repeats of one test between bars and average their stress over strain.

    Parameters
    ----------
    shots
        Shots' folders, or their shot.toml files; two or more.
    progress
        Told of the shots done.

    Raises
    ------
    InputError
        If two shots have one name, or one cannot be used.
    ValueError
        If there are fewer than two shots, or they have no strains in common.
    """
    paths = [Path(shot) for shot in shots]
    given = [load_waves(path) for path in paths]  # bad input is refused before any work
    found: dict[str, Reduction] = {}
    for number, (path, one) in enumerate(zip(paths, given, strict=True)):
        progress("repeats", number, len(paths))
        if one.name in found:
            raise InputError(
                folder_of(path), f"another shot is called {one.name!r} too", cure="give each its own name"
            )
        try:
            found[one.name] = analyse(one).reduction
        except ValueError as error:
            raise InputError(
                folder_of(path), str(error), cure="correct the gauge or bar that it names in shot.toml"
            ) from error
    progress("repeats", len(paths), len(paths))
    return RepeatedShots(tuple(found), repeated_tests(found))

"""A test reduced by classical means, from its shot file: by its bars' gauges or, if it has none, by its
flyer."""

from collections.abc import Callable
from pathlib import Path

from kolsky.bars.reduction.analyse import analyse
from kolsky.bars.result import ReducedTest
from kolsky.base.errors import InputError
from kolsky.shot.bars import load_waves
from kolsky.shot.find import find_shot_file, folder_of
from kolsky.shot.flyer_test.analyse import analyse_flyer
from kolsky.shot.flyer_test.load import load_flyer_test
from kolsky.shot.load import load_shot
from kolsky.shot.schema.bars import AnyFile
from kolsky.shot.schema.reading import read_declared

__all__ = ["waves"]

Progress = Callable[[str, int, int], None]


def waves(
    shot: str | Path,
    *,
    results: Path | None = None,
    progress: Progress = lambda stage, done, total: None,
) -> ReducedTest:
    """Forces, strain, rate and stress of a test by classical means, with corrections and budget.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    results
        Where the surfaces of a shot with pictures are kept; by default the folder "results" of the shot.
    progress
        Told of the steps done, stage by stage.

    Returns
    -------
    ReducedTest
        `kolsky.bars.result.WavesResult` of a test between bars, `kolsky.bars.result.FlyerResult` of a
        flyer's.

    Raises
    ------
    InputError
        If the shot or its files cannot be used.
    """
    shot = Path(shot)
    content = read_declared(find_shot_file(shot), lambda content: AnyFile)[0].content
    try:
        if "gauges" in content:
            return analyse(load_waves(shot), progress=progress)
        from kolsky.shot.optical_data import measured  # brings image correlation: for pictures only

        loaded = load_shot(shot, measure=lambda seen: measured(seen, results, progress=progress))
        return analyse_flyer(load_flyer_test(shot, loaded), progress=progress)
    except ValueError as error:
        raise InputError(folder_of(shot), str(error)) from error

"""A test reduced by classical means, from its shot file: by the gauges of its bars, else by its flyer."""

from collections.abc import Callable
from pathlib import Path

from kolsky.bars.audit import Switches
from kolsky.bars.reduction.analyse import analyse
from kolsky.bars.result import ReducedTest
from kolsky.base.errors import InputError
from kolsky.shot.bars import declared_settings, load_waves
from kolsky.shot.flyer_test.analyse import analyse_flyer
from kolsky.shot.flyer_test.reduction import FlyerInput
from kolsky.shot.incident import incident_channel
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot
from kolsky.shot.schema.bars import WavesSection
from kolsky.shot.schema.reading import Source, is_bar_driven, parsed, shot_toml
from kolsky.shot.schema.uncertainty import UncertaintySection

__all__ = ["waves"]


def load_flyer_test(source: Source, shot: Shot) -> FlyerInput:
    """Load a flyer test for `kolsky waves`.

    Parameters
    ----------
    source
        The shot's folder with its shot.toml, the path of such a file, or the file parsed.
    shot
        The same shot, loaded.

    Raises
    ------
    InputError
        If [incident_force] names a file that cannot be read, a channel that is clipped, or a baseline
        without samples.
    """
    toml = shot_toml(source)
    declared = toml.declared
    section = declared.incident_force
    incident = incident_channel(toml)
    waves = declared.waves or WavesSection()
    if "analysis" in waves.model_fields_set:
        raise toml.error(
            "waves.analysis",
            "is for tests between bars; a flyer test quotes the stress at each face",
            cure="remove it",
        )
    return FlyerInput(
        shot=shot,
        incident=incident,
        mass=0.0 if section is None else section.mass,
        pictured=declared.flyer is None and declared.pictures is not None,
        share=waves.share,
        switches=Switches(waves.corrections),
        uncertainty={
            key: value
            for key, value in (declared.uncertainty or UncertaintySection()).for_waves().items()
            if not isinstance(value, bool)
        },
        settings=declared_settings(toml.content),
    )


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
    file = parsed(shot)
    try:
        if "gauges" in file.content or is_bar_driven(file):
            return analyse(load_waves(file), progress=progress)
        from kolsky.shot.optical_data import measured  # brings image correlation: for pictures only

        loaded = load_shot(file, measure=lambda pictures: measured(pictures, results, progress=progress))
        return analyse_flyer(load_flyer_test(loaded.file or file, loaded), progress=progress)
    except ValueError as error:
        raise InputError(
            file.path.parent, str(error), cure="correct the gauge or bar that it names in shot.toml"
        ) from error

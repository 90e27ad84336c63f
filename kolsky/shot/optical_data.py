"""Camera measurements of a shot: correlate once, store the result, read it back, write tables."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dic import output
from dic.output import MM, write_history
from dic.processes import background
from dic.result import StereoResult
from kolsky.bars.flyer import flight
from kolsky.bars.flyer.flight import FlightOfSpecimen, add_to, flight_of
from kolsky.base.errors import InputError
from kolsky.base.files import filling
from kolsky.base.process import infrequent_gc, single_threaded_libraries
from kolsky.base.records import CentreLine, FlyerMotion
from kolsky.pictures import summary
from kolsky.pictures.correlation import correlate, key_of, length_in_pictures_of, length_sigma_of
from kolsky.pictures.dic_file import read_stereo_result, stored_key, write_stereo_result
from kolsky.pictures.picture_set import PictureSet, Progress
from kolsky.pictures.shared_errors import (
    outline_offsets,
    picture_errors,
    with_departures,
    with_flyer_errors,
    with_outline_errors,
)
from kolsky.pictures.specimen_length import rim_at_rest
from kolsky.shot.records import OpticalData

RESULT_FILE = "dic.h5"


@dataclass(frozen=True)
class Surfaces:
    """The stereo result of a shot and its file."""

    result: StereoResult
    """The stereo result."""
    path: Path
    """Its file."""
    fresh: bool
    """True if the result was computed in this call, False if it was read from the file."""
    flight: FlightOfSpecimen | str
    """The flyer's flight, or the reason why it could not be computed."""

    @property
    def warnings(self) -> list[str]:
        """Warnings about the measurement."""
        return summary.warnings(self.result)

    def rows(self) -> dict[str, str]:
        """Numbers of the measurement by name, as a terminal shows them."""
        return {**summary.printed(self.result), **flight.printed(self.flight)}

    def summary(self) -> dict[str, Any]:
        """Numbers of the measurement for JSON, SI."""
        numbers = {**summary.summary(self.result), **flight.summary(self.flight)}
        return {**numbers, "remarks": self.warnings}


def surfaces(
    pictures: PictureSet,
    folder: Path,
    *,
    device: str = "cpu",
    again: bool = False,
    progress: Progress = lambda stage, done, total: None,
) -> Surfaces:
    """Correlate the pictures of a shot, or read the stored result.

    ``pictures``: the pictures. ``folder``: folder of `RESULT_FILE`. The file is reused if inputs,
    declarations and the version of the software are unchanged. ``device``: where pictures are correlated,
    "cpu" or a CUDA device. ``again``: True to correlate even if the file exists. ``progress``: called with
    the number of frames done in each stage. Raises InputError without a calibration or a measurement.
    """
    path, key = folder / RESULT_FILE, key_of(pictures)
    length = pictures.toml.declared.specimen.length
    if not again and stored_key(path) == key:
        try:
            result = read_stereo_result(path)
            return Surfaces(result=result, path=path, fresh=False, flight=flight_of(result, length))
        except InputError:
            pass  # damaged after it was written: computed again
    with single_threaded_libraries(), infrequent_gc():
        result = correlate(pictures, device, progress)
        with filling(folder) as partial:
            file = partial / RESULT_FILE
            with background(lambda: write_stereo_result(file, result, key=key)) as written:
                flight = flight_of(result, length)
                written()
            if not isinstance(flight, str):
                add_to(file, flight)
    return Surfaces(result=result, path=path, fresh=True, flight=flight)


def measured(
    pictures: PictureSet,
    folder: Path | None = None,
    *,
    device: str = "cpu",
    progress: Progress = lambda stage, done, total: None,
) -> OpticalData:
    """Flyer and outline of a shot from its pictures.

    Parameters
    ----------
    pictures
        The pictures.
    folder
        Folder of the stored result; by default the folder "results" of the shot.
    device
        Where pictures are correlated.
    progress
        Called with the number of frames done in each stage.

    Raises
    ------
    InputError
        For the reasons of `surfaces`, or if the flyer was not found.
    """
    found = surfaces(
        pictures, folder or pictures.toml.path.parent / "results", device=device, progress=progress
    )
    result, number = found.result, pictures.frames.frame
    if result.axial_displacement is None or result.axial_displacement.t.size == 0:
        length = pictures.toml.declared.specimen.length
        section = pictures.toml.declared.dic
        assert section is not None  # shots with pictures have it
        problem, cure = summary.flyer_problem(result, length, length_sigma_of(pictures.toml), section.subset)
        draw = f"`kolsky dic {pictures.toml.path.parent} --regions` draws one"
        raise pictures.toml.error("dic.flyer", problem, cure=f"{cure}; {draw}")
    line = result.centre
    flyer = FlyerMotion(
        time=result.axial_displacement.t,
        displacement=result.axial_displacement.displacement,
        sigma=result.axial_displacement.sigma,
        zero_sigma=result.axial_displacement.rest_sigma,
    )
    outline = CentreLine(time=line.t, frame=number[line.frame], y=line.y, Z=line.Z, sigma=line.sigma)
    errors = picture_errors(result)
    if errors is not None:
        flyer = with_flyer_errors(flyer, result, errors)
        outline = with_outline_errors(outline, result, errors)
    assert pictures.toml.declared.dic is not None  # shots with pictures have it
    outline = with_departures(outline, result, pictures.toml.declared.dic.strip_half_width)
    return OpticalData(
        flyer=flyer,
        centre_line=outline,
        offsets=outline_offsets(result, errors),
        source=found.path,
        symmetry_end=None if isinstance(found.flight, str) else found.flight.end,
        rim=rim_at_rest(
            result,
            length=pictures.toml.declared.specimen.length,
            length_sigma=length_sigma_of(pictures.toml),
            unseen=length_in_pictures_of(pictures.toml),
        ),
    )


def write_tables(folder: Path, found: Surfaces, number: np.ndarray) -> None:
    """Write the outline and the flyer as exports for a shot file, the flight and the reporting table.

    ``folder``: an existing folder. ``found``: the stereo result. ``number``: of each frame in the shot, shape
    [n_frames].
    """
    result = found.result
    line = result.centre
    write_history(
        folder / "centreline.csv",
        {
            "frame": number[line.frame],
            "time (s)": line.t,
            "y (mm)": MM * line.y,
            "Z (mm)": MM * line.Z,
            "sigma_Z (mm)": MM * line.sigma,
        },
    )
    if result.axial_displacement is not None:
        travel = result.axial_displacement
        write_history(
            folder / "flyer.csv",
            {
                "frame": number[travel.frame],
                "time (s)": travel.t,
                "flyer displacement toward the specimen (mm)": MM * travel.displacement,
                "sigma (mm)": MM * travel.sigma,
            },
        )
    table = output.reporting_table(result)
    (folder / "dic_reporting.csv").write_text(output.as_csv(table), encoding="utf-8")
    (folder / "dic_reporting.md").write_text(output.as_markdown(table), encoding="utf-8")
    if not isinstance(found.flight, str):
        write_history(folder / "flight.csv", flight.columns(found.flight))

"""`kolsky film`: the deforming specimen of an identified shot as stills, a film and files for ParaView."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from kolsky.base.errors import InputError
from kolsky.base.files import filling
from kolsky.cli.progress import bars, counted
from kolsky.cli.work import options
from kolsky.cli.work.parts import load, since, tell, usable

STILLS = "png"
SERIES = "vtu"


def film(
    shot: Path,
    *,
    field: str,
    formats: Sequence[str],
    every: int,
    rate: float,
    stills: int,
    out: Path | None,
    as_json: bool,
) -> None:
    """Render the check run of an identification.

    Parameters
    ----------
    shot
        The shot's folder.
    field
        One of `kolsky.report.scene.fields.FIELDS`.
    formats
        Any of "mp4", "gif", "png" (stills) and "vtu" (a series for ParaView).
    every, rate, stills
        Pictures taken of those there are, pictures a second of a film, number of stills.
    out
        Folder of the results, where the identification is too.
    as_json
        Whether to print JSON.

    Raises
    ------
    InputError
        If the shot or its result cannot be used, an option is unknown, or this machine cannot render.
    """
    from kolsky.report.scene.fields import FIELDS
    from kolsky.report.scene.film import FILMS, writer_for

    started = perf_counter()
    options.one_of("--field", field, tuple(FIELDS))
    for name in formats:
        options.one_of("--format", name, (*FILMS, STILLS, SERIES))
        if name in FILMS:
            try:
                writer_for(name)
            except ImportError as error:
                raise InputError(options.COMMAND_LINE, f"--format {name}: {error}") from None
    loaded, folder = load(shot, out)
    from explicit.materials.volumetric import VolumetricLaw, bulk_modulus
    from kolsky.inverse.forward import material_law
    from kolsky.report.paraview import write_vtu
    from kolsky.report.scene.drawing import CannotRender
    from kolsky.report.scene.fields import Solid
    from kolsky.report.scene.film import write_film, write_stills
    from kolsky.report.scene.scene_data import scene_of
    from kolsky.results.hdf5 import read_identification

    result = read_identification(folder / "identification.h5")
    law = material_law(loaded.curve)
    values = {**result.fixed, **{name: e.value for name, e in result.estimates.items()}}
    solid = Solid(
        law=law,
        volume=VolumetricLaw(float(bulk_modulus(law.initial_shear_modulus, values["poisson"]))),
        stiffness_factor=values["stiffness_factor"],
    )
    written: list[str] = []
    with usable(loaded), filling(folder / "film") as partial, bars() as progress:
        scene = scene_of(result, field=field, solid=solid)
        try:
            if STILLS in formats:
                written += [path.name for path in write_stills(partial, scene, stills)]
            for name in (name for name in formats if name in FILMS):
                frames = len(range(0, len(scene.times), every))
                report = counted(progress, f"pictures, {name}", frames)
                written.append(
                    write_film(
                        partial / f"{field}.{name}", scene, every=every, rate=rate, progress=report
                    ).name
                )
        except CannotRender as error:
            raise InputError(options.COMMAND_LINE, str(error)) from None
        if SERIES in formats:
            series = write_vtu(partial, result.response, scene.mesh.quads, every=every)
            written.append(f"{series[-1].name} and {len(series) - 1} meshes")
    summary = {"shot": loaded.name, "field": field, "folder": str(folder / "film"), "files": written}
    said = summary if as_json else None
    shown = {**summary, "files": ", ".join(written)}
    tell([], shown, said, rest={"wall time": since(started)}, warnings=[])

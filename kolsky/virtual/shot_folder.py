"""The folder of a made shot: every file that a laboratory would have, and the truth beside them."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.errors import InputError
from kolsky.base.files import filling, write_table
from kolsky.readers.text import read_bytes
from kolsky.virtual.instruments import measure_curve, measure_flyer, measure_outline, record_forces
from kolsky.virtual.records import Truth
from kolsky.virtual.scope_files import FORMATS
from kolsky.virtual.shot_file import shot_tables, toml_text
from kolsky.virtual.specification import ShotSpecification

TRUTH = "truth.json"
"""The answer of a made shot; nothing but this room and studies of the package itself read it."""
SURFACE = "truth_surface.npz"
ANSWER_LIMIT = 1_000_000
"""Largest `TRUTH` that is read [bytes]."""
TIME_DIGITS = "{:.10e}"


def write_shot(
    shot: ShotSpecification,
    truth: Truth,
    folder: Path,
    *,
    device: str = "cpu",
    threads: int | None = None,
) -> None:
    """Write the folder of one shot, whole or not at all; the truth last.

    Raises
    ------
    InputError
        If it cannot be written.
    ValueError
        If the specification's instruments cannot be.
    """
    q, number = shot.quantities, shot.number
    tables = shot_tables(q, truth.surface)
    form = FORMATS[q.scope.format]
    with filling(folder) as partial:
        form.write(partial / form.name, record_forces(q, truth, shot=number))
        frames = np.arange(len(truth.surface.time))
        given = truth.surface.time + q.imperfections.trigger - q.frames.clock_offset
        times = [TIME_DIGITS.format(t) for t in given]
        write_table(partial / "frames.csv", {"frame": frames, "time (s)": times})
        if q.exports.write:
            flyer = measure_flyer(q, truth, shot=number) * 1e3
            named = {"flyer displacement toward the specimen (mm)": [f"{d:.6f}" for d in flyer]}
            write_table(partial / "flyer.csv", {"frame": frames, "time (s)": times, **named})
            outline = measure_outline(q, truth, shot=number)
            columns: dict[str, Any] = {
                "frame": outline.frame,
                "time (s)": [times[k] for k in outline.frame],
                "y (mm)": [f"{y * 1e3:.6f}" for y in outline.y],
                "Z (mm)": [f"{Z * 1e3:.6f}" for Z in outline.Z],
            }
            write_table(partial / "centreline.csv", columns)
        strain, stress = measure_curve(q, shot=number)
        slow = {"nominal strain (-)": strain, "nominal stress (Pa)": stress}
        write_table(partial / "quasi_static.csv", slow)
        answer = _answer(shot)
        if q.cameras.write:
            from kolsky.virtual.pictures import write_pictures

            made = write_pictures(q, truth.surface, partial, shot=number, device=device, threads=threads)
            tables |= made.tables
            answer["cameras"] = made.answer
        (partial / "shot.toml").write_text(toml_text(tables, name=shot.name), encoding="utf-8")
        surface = truth.surface
        np.savez_compressed(
            partial / SURFACE,
            t=surface.time,
            y=surface.y.astype(np.float32),
            r=surface.r.astype(np.float32),
            d=surface.displacement,
            tilt=surface.tilt,
            t_force=truth.force_time,
            transmitted=truth.transmitted.astype(np.float32),
            incident=truth.incident.astype(np.float32),
        )
        (partial / TRUTH).write_text(json.dumps(answer, indent=1), encoding="utf-8")


def _answer(shot: ShotSpecification) -> dict[str, Any]:
    """What truth.json holds: the answer, and the specification that was made."""
    material = shot.quantities.material
    return {
        "m": material.stiffness_factor,
        "nu": material.poisson,
        "beta_s": material.damping,
        "friction": shot.quantities.imperfections.slip_friction or None,
        **_relaxation(shot),
        "specification": shot.content,
        "specification_sha256": _hash(shot),
        "number": shot.number,
    }


def _relaxation(shot: ShotSpecification) -> dict[str, Any]:
    """The true constants of [relaxation] by their parameters' names; nothing where there is none."""
    declared = shot.quantities.relaxation
    return {} if declared is None else {"relaxation": dict(declared.declared().values)}


def _hash(shot: ShotSpecification) -> str:
    content = shot.quantities.model_dump(mode="json")
    if content["relaxation"] is None:  # folders made before there was such a table have none in their hash
        del content["relaxation"]
    text = json.dumps(content, sort_keys=True) + f" {shot.number}"
    return hashlib.sha256(text.encode()).hexdigest()


def is_there(shot: ShotSpecification, folder: Path) -> bool:
    """Whether the folder holds this very shot.

    Raises
    ------
    InputError
        If it holds something else.
    """
    if not folder.exists() or not any(folder.iterdir()):
        return False
    answer = folder / TRUTH
    try:
        found = json.loads(read_bytes(answer, limit=ANSWER_LIMIT))
        same = found.get("specification_sha256") == _hash(shot)
    except (InputError, ValueError, AttributeError, RecursionError):
        same = False
    if not same:
        raise InputError(
            folder, "holds something else than this shot", cure="give another place with --out FOLDER"
        )
    return True

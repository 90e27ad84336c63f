"""Damaged files and their readers: recordings, tables, pictures, cameras, settings, results."""

import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
for place in (
    ROOT / "tests" / "helpers",
    ROOT / "tests" / "unit" / "dic",
    ROOT / "tests" / "unit" / "bodies",
):
    if str(place) not in sys.path:
        sys.path.insert(0, str(place))

Form = Literal["text", "toml", "binary", "hdf5"]


@dataclass(frozen=True)
class Target:
    """A kind of file and what reads it."""

    name: str  # its name in the corpus
    form: Form  # which damage it is given
    write: Callable[[Path], Path]
    """Writes a sound one, and what belongs to it, into an empty folder; returns its path."""
    read: Callable[[Path], Any]  # reads it; raises one of `tests.fuzz.judge.REFUSALS`
    told_length: bool = True  # whether the file says how long it is, so that a cut one must be refused
    told_values: bool = False  # whether the file carries digests, so that a change of one bit must be noticed


def recorders() -> list[Target]:
    """Files of oscilloscopes and recorders."""
    import readerfiles as files

    from kolsky.readers.recordings import list_channels, read_recordings

    def target(name: str, made: files.Made) -> Target:
        def read(path: Path) -> Any:
            list_channels(path)
            return read_recordings(path, list(made.channels), layout=made.layout)

        binary = files.is_binary(made)
        form: Form = "binary" if binary else "text"
        return Target(f"recorder {name}", form, made.written, read, told_length=binary)

    return [target(name, made) for name, made in files.FILES.items()]


def shots() -> list[Target]:
    """Every file of a shot of exports, read with the whole shot around it."""
    from shot_folders import FILES, OPEN_01

    from kolsky.shot.load import load_shot

    def target(name: str) -> Target:
        def write(folder: Path) -> Path:
            for other in FILES:
                shutil.copy(OPEN_01 / other, folder)
            return folder / name

        return Target(
            f"shot {name}", "toml" if name == "shot.toml" else "text", write,
            lambda path: load_shot(path.parent), told_length=False,
        )  # fmt: skip

    return [target(name) for name in FILES]


def settings() -> list[Target]:
    """Files of settings of the commands that take no shot."""
    from test_reading import DATA, STRIP

    from kolsky.base.toml import parse_toml
    from kolsky.bodies.specimen_reading import read_specification as read_specimen
    from kolsky.pictures.measurement import read_measurement
    from kolsky.prediction.predict import read_test
    from kolsky.studies.sweep import read_design
    from kolsky.virtual.specification import read_specification as read_virtual

    def specimen(folder: Path) -> Path:
        (folder / "pull.csv").write_text(DATA)
        (folder / "spec.toml").write_text(STRIP)
        return folder / "spec.toml"

    def specimen_data(folder: Path) -> Path:
        specimen(folder)
        return folder / "pull.csv"

    def slow(folder: Path) -> Path:
        rows = "\n".join(f"{i},{-900.0 + 5.0 * i:.1f}" for i in range(1, 40))
        (folder / "held.csv").write_text(f"t,stress\n{rows}\n")
        (folder / "slow.toml").write_text(
            'format = 1\n[test.hold]\nkind = "relaxation"\nfile = "held.csv"\nstrain = "10 %"\n'
            'time = { column = "t", unit = "s" }\nstress = { column = "stress", unit = "Pa" }\n'
            'relative_sigma = "1 %"\n'
        )
        return folder / "slow.toml"

    def measurement(folder: Path) -> Path:
        import cv2

        for number in range(3):
            picture = np.random.default_rng(number).integers(0, 255, (40, 60)).astype(np.uint8)
            cv2.imwrite(str(folder / f"cam{number}.png"), picture)
        (folder / "dic.toml").write_text(
            '[dic]\nkind = "plane"\nscale = "0.1 mm"\n[pictures]\ncamera_0 = { pattern = "cam*.png" }\n'
        )
        return folder / "dic.toml"

    def design(folder: Path) -> Path:
        (folder / "points.csv").write_text(
            "friction (1),stiffness_factor (1)\n" + "\n".join(f"0.{k},1.{k}" for k in range(9)) + "\n"
        )
        return folder / "points.csv"

    def copied(name: str) -> Callable[[Path], Path]:
        return lambda folder: Path(shutil.copy(ROOT / "runs" / name, folder))

    def bars(folder: Path) -> Path:
        for name in ("shot.toml", "tek0017.csv"):
            shutil.copy(ROOT / "runs" / "bar-01" / name, folder)
        return folder / "shot.toml"

    def check(path: Path) -> Any:
        from kolsky.shot.load import check_shot

        return check_shot(path.parent)

    made: tuple[tuple[str, Form, Callable[[Path], Path], Callable[[Path], Any]], ...] = (
        ("settings of a planned test", "toml", copied("predict/paper.toml"), read_test),
        ("settings of a virtual shot", "toml", copied("virtual/small.toml"), read_virtual),
        ("settings of a specimen", "toml", specimen, read_specimen),
        (
            "data of a specimen",
            "text",
            specimen_data,
            lambda path: read_specimen(path.with_name("spec.toml")),
        ),
        ("settings of slow tests", "toml", slow, _slow),
        ("settings of a measurement", "toml", measurement, read_measurement),
        ("settings of bars", "toml", bars, check),
        ("points of a design", "text", design, read_design),
        ("any TOML file", "toml", copied("open-01/shot.toml"), parse_toml),
    )
    return [Target(*one, told_length=False) for one in made]


def _slow(path: Path) -> Any:
    from kolsky.inverse.slow_tests import read_slow_tests

    return read_slow_tests(path)


def tables() -> list[Target]:
    """Tables of testing machines, of other correlation programs, meshes."""
    from kolsky.material.reference_curve import read_uniaxial_test
    from kolsky.readers import dic_export
    from kolsky.readers.meshes import read_mesh

    def curve(folder: Path) -> Path:
        return Path(shutil.copy(ROOT / "runs" / "open-01" / "quasi_static.csv", folder))

    def export(folder: Path) -> Path:
        x, y = np.meshgrid(np.linspace(0.0, 10.0, 9), np.linspace(0.0, 6.0, 7))
        for frame in range(3):
            rows = [
                f"{a},{b},{0.1 * a},{0.01 * frame * a},{-0.02 * frame * b},0.0"
                for a, b in zip(x.flat, y.flat, strict=True)
            ]
            (folder / f"frame_{frame:03d}.csv").write_text(
                '"X","Y","Z","U","V","W"\n' + "\n".join(rows) + "\n"
            )
        return folder / "frame_001.csv"

    def read_export(path: Path) -> Any:
        return dic_export.read(tuple(sorted(path.parent.glob("frame_*.csv"))), "vic3d")

    def mesh(folder: Path) -> Path:
        return Path(shutil.copy(ROOT / "runs" / "specimen" / "sheet" / "mesh.msh", folder))

    def uniaxial(path: Path) -> Any:
        header = (ROOT / "runs" / "open-01" / "quasi_static.csv").read_text().splitlines()[0].split(",")
        columns = {"strain": header[0], "stress": header[1]}
        return read_uniaxial_test(path, columns, convention="tension positive", branch="compression")

    return [
        Target("table of a testing machine", "text", curve, uniaxial, told_length=False),
        Target("export of a correlation program", "text", export, read_export, told_length=False),
        Target("mesh", "text", mesh, lambda path: read_mesh(path, dimension=2)),
    ]


def pictures() -> list[Target]:
    """Picture files."""
    from test_dic_images import WRITERS

    from dic.images import open_pictures

    def target(name: str) -> Target:
        def write(folder: Path) -> Path:
            WRITERS[name](folder)
            return folder / name

        def read(path: Path) -> Any:
            opened = open_pictures(path)
            return opened.shape, [opened.frame(index) for index in range(min(opened.n_frames, 5))]

        return Target(f"picture {name}", "binary", write, read, told_length=name != "a1.jpg")

    return [target(name) for name in WRITERS]


def cameras() -> list[Target]:
    """Camera files of every format that writes rigs."""
    from synthetic_dic import rig

    from dic import camera_files
    from dic.camera_files import read_rig, write_rig

    def target(form: Any) -> Target:
        def write(folder: Path) -> Path:
            path = folder / f"rig{form.suffix}"
            write_rig(path, rig(), form.name)
            return path

        return Target(f"camera {form.name}", "text", write, read_rig, told_length=False)

    return [target(form) for form in camera_files.FORMATS]


def results() -> list[Target]:
    """Result files, which a later command reads."""
    from synthetic import synthetic
    from synthetic_dic import synthetic_result

    from doe.ledger import Ledger, Run
    from kolsky.pictures.dic_file import read_stereo_result, write_stereo_result
    from kolsky.results.hdf5 import read_identification, write_identification

    points = np.linspace(0.0, 1.0, 40)[:, None]

    def identification(folder: Path) -> Path:
        write_identification(folder / "identification.h5", synthetic(nodes=False))
        return folder / "identification.h5"

    def surfaces(folder: Path) -> Path:
        write_stereo_result(folder / "dic.h5", synthetic_result(), key="abc")
        return folder / "dic.h5"

    def ledger(folder: Path) -> Path:
        with Ledger(folder / "sweep.sqlite", b"\1" * 32) as book:
            runs = [Run(True, "COMPLETED", np.array([x, x * x, -x])) for x in points[:, 0]]
            book.record(points, runs)
        return folder / "sweep.sqlite"

    def read_ledger(path: Path) -> Any:
        with Ledger(path, b"\1" * 32) as book:
            found = book.find(points)
        return [None if run is None else (run.outcome, run.completed, run.results) for run in found]

    return [
        Target("result identification.h5", "hdf5", identification, read_identification),
        Target("result dic.h5", "hdf5", surfaces, read_stereo_result),
        Target("result sweep.sqlite", "binary", ledger, read_ledger, told_values=True),
    ]


@cache
def all_targets() -> dict[str, Target]:
    """Every target by its name."""
    made = [*recorders(), *shots(), *settings(), *tables(), *pictures(), *cameras(), *results()]
    found = []
    for one in made:
        if one.form == "binary" and _is_hdf5(one.name):
            one = Target(one.name, "hdf5", one.write, one.read, one.told_length)
        found.append(one)
    return {one.name: one for one in found}


def _is_hdf5(name: str) -> bool:
    return name in ("recorder hdf5", "recorder mat73", "picture a.h5")

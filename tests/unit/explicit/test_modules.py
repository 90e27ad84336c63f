"""Time loops compiled ahead of time: what is written, what is found again, and that a CPU does not care."""

import re
import struct
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp

from explicit import Model, PlatenMotion, Samples, Sampling, ahead_of_time, aot, cylinder, run
from explicit.aot import main
from explicit.layout.lanes import BLOCK
from explicit.materials import MarlowLaw, neo_hookean
from explicit.precision import PRECISIONS
from explicit.relaxation import BergstromBoyce, PronySeries
from explicit.time_loop.kernel import time_loop_kernel

ROOT = Path(__file__).resolve().parent.parent.parent.parent
ONE = ["--contacts", "bonded/bonded", "--precision", "fp32", "--element", "one_point"]
"""The choice that is compiled here."""


@dataclass(frozen=True)
class Gpu:
    """As much of a CUDA device as is looked at before Warp is asked to load a module."""

    arch: int
    is_cuda: bool = True
    alias: str = "cuda:0"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("modules")
    only = {"contacts": [("bonded", "bonded")], "precisions": ["fp32"], "elements": ["one_point"]}
    paths = ahead_of_time(place, architectures=[90], **only)
    # state on one chip, for small and large batches, on those of 4 and 16 blocks, or off them on 1, 4, 16
    assert len(set(paths)) == 7
    assert all(path.is_file() for path in paths)
    return place


def model() -> Model:
    motion = PlatenMotion.sampled(lambda t: t, np.ones_like, start=0.0, end=2e-5, n_knots=3)
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=2, n_axial=3)
    return Model(mesh=mesh, density=870.0, materials=(neo_hookean(27e3),), motions=(motion,))


def files(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def test_machine_code_of_the_architecture_is_written(folder):
    assert sorted(Path(name).suffix for name in files(folder)) == [".cubin"] * 7 + [".meta"] * 7
    path = next(folder.rglob("*.cubin"))
    assert path.parent.name == f"warp-{wp.__version__}"
    header = path.read_bytes()[:64]
    assert header[:5] == b"\x7fELF\x02"
    assert struct.unpack_from("<H", header, 18)[0] == 190  # EM_CUDA of the ELF registry
    # e_flags: the architecture is bits 8 to 15 in the ABI of CUDA 12.9 on, bits 0 to 7 before
    flags = struct.unpack_from("<I", header, 48)[0]
    assert 90 in (flags >> 8 & 0xFF, flags & 0xFF)


def test_another_process_finds_them_again(folder):
    before = files(folder)
    command = [sys.executable, "-m", "explicit.aot", "--arch", "90", "--out", str(folder), *ONE]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=60)
    assert done.returncode == 0, done.stderr
    assert files(folder) == before  # the names are hashes of source and options: the same, so nothing is new
    assert str(next(folder.rglob("*.cubin"))) in done.stdout


def test_what_relaxes_can_be_named(tmp_path, monkeypatch):
    asked = []

    def compile_each(*arguments: Any, **options: Any) -> list[Path]:
        asked.append(options["relaxation"])
        return []

    monkeypatch.setattr("explicit.aot.compile_each", compile_each)
    main(["--out", str(tmp_path), *ONE])
    main(["--out", str(tmp_path), *ONE, "--relaxation", "none", "prony", "prony:2", "bergstrom_boyce"])
    series = PronySeries((0.3,), (1e-4,))
    relaxing = replace(model(), relaxation=(series,))
    assert asked[:2] == [None, None]
    # the kinds of time loop that a batch asks for
    assert asked[2] == relaxing.relaxation_kind == PronySeries.kind(1)
    assert asked[3:] == [PronySeries.kind(2), BergstromBoyce.kind(1)]


def test_a_device_is_given_what_it_can_run(folder, tmp_path, monkeypatch):
    kernel = time_loop_kernel(MarlowLaw, "bonded", "bonded", PRECISIONS["fp32"])
    asked: list[tuple[str, int, bool]] = []

    def load(module: Any, *, device: Any, arch: int, module_dir: Path, use_ptx: bool) -> None:
        asked.append((module.name, arch, use_ptx))
        name = module.get_module_identifier(BLOCK) + f".sm{arch}.{'ptx' if use_ptx else 'cubin'}"
        if not (module_dir / name).exists():
            raise FileNotFoundError(name)

    monkeypatch.setattr(wp, "load_aot_module", load)
    monkeypatch.delenv(aot.FOLDER_VARIABLE, raising=False)
    assert aot.load_module(kernel, Gpu(90), folder)
    assert asked == [(kernel.kernel.module.name, 90, False)]
    assert not aot.load_module(kernel, Gpu(90), None)
    monkeypatch.setenv(aot.FOLDER_VARIABLE, str(folder))
    assert aot.load_module(kernel, Gpu(90), None)
    assert len(asked) == 1  # loaded already
    assert aot.load_module(kernel, Gpu(90, alias="cuda:1"), None)
    assert len(asked) == 2
    with pytest.warns(RuntimeWarning, match="no module .* for architecture 80"):
        assert not aot.load_module(kernel, Gpu(80, alias="cuda:2"), folder)
    with pytest.raises(ValueError, match=f"'{tmp_path}/none'.*python -m explicit.aot"):
        aot.load_module(kernel, Gpu(90), tmp_path / "none")


def test_ptx_serves_later_architectures(tmp_path):
    for name in ("wp_a.sm80.ptx", "wp_a.sm90.ptx", "wp_a.sm86.cubin", "wp_a.meta"):
        (tmp_path / name).touch()
    assert aot.candidates(tmp_path, 100) == [(100, False), (90, True), (80, True)]
    assert aot.candidates(tmp_path, 86) == [(86, False), (80, True)]


@pytest.mark.slow
def test_ptx_names_its_target(tmp_path):
    only = {"contacts": [("bonded", "rough")], "precisions": ["fp32"], "elements": ["one_point"]}
    paths = ahead_of_time(tmp_path, architectures=[80, 90], ptx=True, **only)
    assert [path.suffix for path in paths] == [".ptx"] * 10  # four for the clusters of the later one
    for path, arch in zip(paths, (80, 90) * 3 + (90,) * 4, strict=True):
        assert f".target sm_{arch}" in path.read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--arch", "12"], "architecture must be one of"),
        (["--contacts", "bonded"], "written faces/side"),
        (["--contacts", "bonded/glued"], "contact law must be one of .*'glued'"),
        (["--precision", "fp16"], "precision must be one of"),
        (["--element", "cax8"], "element must be one of"),
        (["--relaxation", "maxwell"], "what relaxes must be none or one of .*'maxwell'"),
        (["--relaxation", "prony:0"], "number above 0, .*'prony:0'"),
    ],
)
def test_what_is_not_known_is_refused(arguments, message, tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["--out", str(tmp_path / "out"), *arguments])
    assert re.search(message, capsys.readouterr().err)
    assert not (tmp_path / "out").exists()


def test_a_cpu_does_not_look_at_modules(tmp_path, monkeypatch):
    times = np.linspace(0.0, 2e-5, 3)
    plain = run(model(), Samples.of(), Sampling(times, times))
    monkeypatch.setenv(aot.FOLDER_VARIABLE, str(tmp_path / "none"))
    again = run(model(), Samples.of(), Sampling(times, times), modules=tmp_path / "none")
    assert np.array_equal(plain.force_flyer, again.force_flyer)
    assert (plain.force_flyer[0, 1:] > 0.0).all()

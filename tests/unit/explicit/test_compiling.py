"""Time loops are compiled in advance: each once, with a report, and only if they are not cached."""

import gc
import re
import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import warp as wp

from explicit import (
    Model,
    PlatenMotion,
    Problem,
    Samples,
    Sampling,
    ahead_of_time,
    aot,
    arguments,
    compile_time_loops,
    cylinder,
    run,
    run_batch,
)
from explicit.aot import main
from explicit.arguments import APART, in_one_copy
from explicit.device import select_device
from explicit.elements.base import solid_struct
from explicit.layout.lanes import BLOCK
from explicit.materials import MarlowLaw, neo_hookean
from explicit.precision import PRECISIONS
from explicit.relaxation import BergstromBoyce, PronySeries
from explicit.simd import kernel, lane_kernel
from explicit.simd.kernel import cached_translation
from explicit.time_loop.kernel import time_loop_kernel


@pytest.fixture
def problem(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[int], Problem]:
    """A batch of some runs, on a machine that knows no time loop."""
    monkeypatch.setattr(kernel, "kernel_cache", lambda: tmp_path)
    lane_kernel.cache_clear()
    end = 1e-4
    model = Model(
        mesh=cylinder(4.75e-3, 6.5e-3, n_radial=3, n_axial=4),
        density=870.0,
        materials=(neo_hookean(25e3),),
        motions=(PlatenMotion.sampled(lambda t: 2.6 * t, lambda t: 0.0 * t + 2.6, start=0.0, end=end),),
    )
    times = np.linspace(0.0, end, 3)

    def batch(runs: int) -> Problem:
        return Problem(model, Samples.of(stiffness_factor=np.ones(runs)), Sampling(times, times))

    return batch


def test_every_time_loop_is_compiled_once(problem: Callable[[int], Problem]) -> None:
    told: list[tuple[int, int]] = []
    single, many = problem(1), problem(8)
    assert compile_time_loops([single, single, many], threads=1, progress=lambda *at: told.append(at)) == 2
    assert told == [(0, 2), (1, 2), (2, 2)]
    assert compile_time_loops([single, many], threads=1, progress=lambda *at: told.append(at)) == 0
    assert len(told) == 3
    # 9 runs on one thread are a pack and a single one: both are known
    assert compile_time_loops([problem(9)], threads=1) == 0


def test_others_are_looked_at_only_beside_what_is_not_known(problem: Callable[[int], Problem]) -> None:
    single, asked = problem(1), []

    def other() -> Problem:
        asked.append(1)
        return replace(single, model=replace(single.model, element="fbar"))

    assert compile_time_loops([single], also=[other], threads=1) == 2
    assert compile_time_loops([single], also=[other], threads=1) == 0
    assert asked == [1]


def test_nothing_is_done_for_a_gpu(
    problem: Callable[[int], Problem], monkeypatch: pytest.MonkeyPatch
) -> None:
    def gpu(name: str) -> Any:
        return SimpleNamespace(is_cuda=True)

    monkeypatch.setattr(run_batch, "select_device", gpu)
    assert compile_time_loops([problem(1)], device="cuda") == 0


def test_what_cannot_be_loaded_is_an_error(
    problem: Callable[[int], Problem], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any, **__: Any) -> None:
        raise RuntimeError("no compiler")

    monkeypatch.setattr(run_batch.wp, "load_module", broken)
    with pytest.raises(RuntimeError, match="no compiler"):
        compile_time_loops([problem(1)])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(kernel, "kernel_cache", lambda: tmp_path)
    return tmp_path


def kernel_of(number: int, *, twice: bool = False) -> Any:
    """A kernel in a module of its own, with a constant and a function that it refers to."""
    factor = number

    @wp.func
    def grown(x: int):
        return x + factor

    @wp.func
    def doubled(x: int):
        return x + x + factor

    change = doubled if twice else grown

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(x: wp.array(dtype=int)):
        x[0] = change(x[0])

    return kernel


def never() -> str:
    raise AssertionError("it was there to be found")


def test_a_translation_is_made_once_for_its_constant_function_choice_and_source(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cached_translation(kernel_of(1), "worker 8 fp64", lambda: "code") == "code"
    assert cached_translation(kernel_of(1), "worker 8 fp64", never) == "code"
    (file,) = (folder / "lanes").iterdir()
    assert file.read_text() == "code"
    cached_translation(kernel_of(1), "worker 8 fp64", lambda: "first")
    assert cached_translation(kernel_of(2), "worker 8 fp64", lambda: "constant") == "constant"
    assert cached_translation(kernel_of(1, twice=True), "worker 8 fp64", lambda: "function") == "function"
    assert cached_translation(kernel_of(1), "worker 16 fp64", lambda: "choice") == "choice"
    monkeypatch.setattr(kernel, "_package", lambda: b"another source")
    assert cached_translation(kernel_of(1), "worker 8 fp64", lambda: "source") == "source"
    assert len(list((folder / "lanes").iterdir())) == 5


def test_the_source_of_the_package_is_hashed_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    before = kernel._package.__wrapped__()
    assert before == kernel._package()
    read = Path.read_bytes

    def changed(path: Path) -> bytes:
        return read(path) + (b"#" if path.name == "memory.py" else b"")

    monkeypatch.setattr(Path, "read_bytes", changed)
    assert kernel._package.__wrapped__() != before


def test_a_cache_that_cannot_be_written_keeps_nothing(folder: Path) -> None:
    (folder / "lanes").write_text("no folder")
    assert cached_translation(kernel_of(1), "worker 8 fp64", lambda: "code") == "code"
    assert cached_translation(kernel_of(1), "worker 8 fp64", lambda: "again") == "again"
    assert [path.name for path in folder.iterdir()] == ["lanes"]


def test_what_fails_is_not_kept(folder: Path) -> None:
    def fails() -> str:
        raise TypeError("no meaning over lanes")

    with pytest.raises(TypeError, match="no meaning"):
        cached_translation(kernel_of(1), "worker 8 fp64", fails)
    assert not (folder / "lanes").exists()


ROOT = Path(__file__).resolve().parent.parent.parent.parent
ONE = ["--contacts", "bonded/bonded", "--precision", "fp32", "--element", "one_point"]
"""The choice that is compiled here."""


@dataclass(frozen=True)
class Gpu:
    """As much of a CUDA device as is looked at before Warp is asked to load a module."""

    arch: int
    is_cuda: bool = True
    alias: str = "cuda:0"


class Compiler:
    """Compiles the modules of these numbers, 10 s each; the files of the others are empty."""

    def __init__(self, *numbers: int) -> None:
        self.numbers, self.asked = numbers, 0

    def __call__(self, module: Any, *, arch: list[int], module_dir: Path, use_ptx: bool) -> None:
        self.asked += 1
        if self.asked - 1 in self.numbers:
            COMPILE(module, arch=arch, module_dir=module_dir, use_ptx=use_ptx)
            return
        name = f"{module.get_module_identifier(module.options['block_dim'])}"
        for end in (".meta", *(f".sm{one}.{'ptx' if use_ptx else 'cubin'}" for one in arch)):
            module_dir.mkdir(parents=True, exist_ok=True)
            (module_dir / f"{name}{end}").touch()


COMPILE = wp.compile_aot_module


@pytest.fixture(scope="module")
def modules_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("modules")
    only = {"contacts": [("bonded", "bonded")], "precisions": ["fp32"], "elements": ["one_point"]}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wp, "compile_aot_module", Compiler())
        paths = ahead_of_time(place, architectures=[90], **only)
    # state on one chip, for small and large batches, on those of 4 and 16 blocks, or off them on 1, 4, 16
    assert len(set(paths)) == 7
    assert all(path.is_file() for path in paths)
    return place


def model() -> Model:
    motion = PlatenMotion.sampled(lambda t: t, np.ones_like, start=0.0, end=2e-5, n_knots=3)
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=2, n_axial=3)
    return Model(mesh=mesh, density=870.0, materials=(neo_hookean(27e3),), motions=(motion,))


def files(modules_folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in modules_folder.rglob("*") if path.is_file()}


def test_every_variant_has_a_file(modules_folder):
    assert sorted(Path(name).suffix for name in files(modules_folder)) == [".cubin"] * 7 + [".meta"] * 7
    assert {path.parent.name for path in modules_folder.rglob("*.cubin")} == {f"warp-{wp.__version__}"}


@pytest.mark.slow
def test_machine_code_of_the_architecture_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(wp, "compile_aot_module", Compiler(3))  # on the chips of a cluster
    only = {"contacts": [("bonded", "bonded")], "precisions": ["fp32"], "elements": ["one_point"]}
    path = ahead_of_time(tmp_path, architectures=[90], **only)[3]
    assert not list(path.parent.glob("*.cu"))
    header = path.read_bytes()[:64]
    assert header[:5] == b"\x7fELF\x02"
    assert struct.unpack_from("<H", header, 18)[0] == 190  # EM_CUDA of the ELF registry
    # e_flags: the architecture is bits 8 to 15 in the ABI of CUDA 12.9 on, bits 0 to 7 before
    flags = struct.unpack_from("<I", header, 48)[0]
    assert 90 in (flags >> 8 & 0xFF, flags & 0xFF)


def test_another_process_finds_them_again(modules_folder):
    before = files(modules_folder)
    command = [sys.executable, "-m", "explicit.aot", "--arch", "90", "--out", str(modules_folder), *ONE]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=60)
    assert done.returncode == 0, done.stderr
    assert (
        files(modules_folder) == before
    )  # the names are hashes of source and options: the same, so nothing is new
    assert str(next(modules_folder.rglob("*.cubin"))) in done.stdout


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


def test_a_device_is_given_what_it_can_run(modules_folder, tmp_path, monkeypatch):
    kernel = time_loop_kernel(MarlowLaw, "bonded", "bonded", PRECISIONS["fp32"])
    asked: list[tuple[str, int, bool]] = []

    def load(module: Any, *, device: Any, arch: int, module_dir: Path, use_ptx: bool) -> None:
        asked.append((module.name, arch, use_ptx))
        name = module.get_module_identifier(BLOCK) + f".sm{arch}.{'ptx' if use_ptx else 'cubin'}"
        if not (module_dir / name).exists():
            raise FileNotFoundError(name)

    monkeypatch.setattr(wp, "load_aot_module", load)
    monkeypatch.delenv(aot.FOLDER_VARIABLE, raising=False)
    assert aot.load_module(kernel, Gpu(90), modules_folder)
    assert asked == [(kernel.kernel.module.name, 90, False)]
    assert not aot.load_module(kernel, Gpu(90), None)
    monkeypatch.setenv(aot.FOLDER_VARIABLE, str(modules_folder))
    assert aot.load_module(kernel, Gpu(90), None)
    assert len(asked) == 1  # loaded already
    assert aot.load_module(kernel, Gpu(90, alias="cuda:1"), None)
    assert len(asked) == 2
    with pytest.warns(RuntimeWarning, match="no module .* for architecture 80"):
        assert not aot.load_module(kernel, Gpu(80, alias="cuda:2"), modules_folder)
    with pytest.raises(ValueError, match=f"'{tmp_path}/none'.*python -m explicit.aot"):
        aot.load_module(kernel, Gpu(90), tmp_path / "none")


def test_ptx_serves_later_architectures(tmp_path):
    for name in ("wp_a.sm80.ptx", "wp_a.sm90.ptx", "wp_a.sm86.cubin", "wp_a.meta"):
        (tmp_path / name).touch()
    assert aot.candidates(tmp_path, 100) == [(100, False), (90, True), (80, True)]
    assert aot.candidates(tmp_path, 86) == [(86, False), (80, True)]


@pytest.mark.slow
def test_ptx_names_its_target(tmp_path, monkeypatch):
    monkeypatch.setattr(wp, "compile_aot_module", Compiler(0))
    only = {"contacts": [("bonded", "rough")], "precisions": ["fp32"], "elements": ["one_point"]}
    paths = ahead_of_time(tmp_path, architectures=[80, 90], ptx=True, **only)
    assert [path.suffix for path in paths] == [".ptx"] * 10  # four for the clusters of the later one
    written = [f"wp_.*sm{arch}.ptx" for arch in (80, 90) * 3 + (90,) * 4]
    assert all(re.fullmatch(name, path.name) for name, path in zip(written, paths, strict=True))
    for path, arch in zip(paths[:2], (80, 90), strict=True):
        assert f".target sm_{arch}" in path.read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--arch", "12"], "architecture must be one of"),
        (["--contacts", "bonded"], "written faces/side"),
        (["--contacts", "bonded/glued"], "contact law must be one of .*'glued'"),
        (["--precision", "fp16"], "precision must be one of"),
        (["--element", "cax8"], "element must be one of"),
        (["--relaxation", "maxwell"], "the relaxation must be none or one of .*'maxwell'"),
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


def test_every_array_is_that_of_its_own_copy() -> None:
    where, Solid = select_device("cpu"), solid_struct(PRECISIONS["fp64"])
    rng = np.random.default_rng(5)
    solids = np.zeros(3, dtype=Solid.numpy_dtype())
    for name in solids.dtype.names or ():
        solids[name] = rng.uniform(size=3)
    values = {
        "times": (rng.uniform(size=7), wp.float64), "rounded": (rng.uniform(size=(2, 5)), wp.float32),
        "turned": (rng.uniform(size=(4, 3)).T, wp.float64), "chosen": (np.array([2, 0, 1]), wp.int32),
        "none": (np.zeros((0, 4)), wp.float64), "solids": (solids, Solid),
    }  # fmt: skip
    found = in_one_copy(values, where)
    assert list(found) == list(values)
    for name, (numbers, dtype) in values.items():
        array, wanted = found[name], wp.array(numbers, dtype=dtype, device=where)
        assert (array.shape, array.dtype, array.strides) == (wanted.shape, wanted.dtype, wanted.strides)
        np.testing.assert_array_equal(array.numpy(), wanted.numpy())
    first = found["times"].ptr
    assert all((array.ptr - first) % APART == 0 for array in found.values())
    assert len({array.ptr for array in found.values()}) == len(found)


def test_the_memory_lives_as_long_as_one_of_its_arrays(monkeypatch) -> None:
    where, made = select_device("cpu"), []
    wide = wp.array

    def watched(*args, **options):
        array = wide(*args, **options)
        if "ptr" not in options:
            made.append(array.ptr)
        return array

    monkeypatch.setattr(arguments.wp, "array", watched)
    kept = in_one_copy({"a": (np.arange(40.0), wp.float64), "b": (np.arange(9), wp.int32)}, where)["b"]
    assert len(made) == 1
    gc.collect()
    others = [wide(np.full(400, -1.0), dtype=wp.float64, device=where) for _ in range(50)]
    assert all(other.ptr != made[0] for other in others)
    np.testing.assert_array_equal(kept.numpy(), np.arange(9))

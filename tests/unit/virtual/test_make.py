"""Synthetic folders: readable, equal for one seed, wrong on request; no command reads the truth."""

import re
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from time import sleep
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from kolsky_command import json_of

from kolsky.base.errors import InputError
from kolsky.base.files import template_file
from kolsky.shot.load import load_shot
from kolsky.virtual import make as make_module
from kolsky.virtual.make import gpu_batches, make
from kolsky.virtual.schema import Specification
from kolsky.virtual.specification import read_specification
from kolsky.virtual.truth import TruthError, try_truths

ROOT = Path(__file__).parents[3]
TINY = """
[motion]
compression = "12 %"
[truth]
mesh = [8, 11]
"""


def made(folder: Path, text: str = "", **options: object) -> Path:
    """Make the shots of a tiny specification; the folder they are in."""
    folder.mkdir(exist_ok=True)
    path = folder / "SPEC.toml"
    path.write_text("format = 1\n" + TINY + text, encoding="utf-8")
    make(read_specification(path), folder / "out", **options)  # type: ignore[arg-type]
    return folder / "out"


@pytest.mark.parametrize("form", ["csv", "csv semicolon", "xlsx", "tdms"])
def test_every_scope_format_is_read_back(tmp_path: Path, form: str) -> None:
    if form == "tdms" and find_spec("nptdms") is None:
        pytest.skip("npTDMS is not installed")
    quiet = '[transmitted]\nnoise = "0.3 mV"\n[scope]\nclock_offset = "40 us"\nformat = '
    shot = load_shot(made(tmp_path, f'{quiet}"{form}"\n'))
    truth = np.load(shot.folder / "truth_surface.npz")
    force = shot.force.history()
    expected = np.interp(force.time, truth["t_force"], truth["transmitted"], left=0.0)
    step = 2.0 / 4096 / 0.0112
    assert (force.force - expected).std() == pytest.approx(np.hypot(0.3e-3 / 0.0112, step / 12**0.5), rel=0.1)
    at_rest = shot.flyer.displacement[:12]  # type: ignore[union-attr]
    assert at_rest.std() == pytest.approx(1e-6, rel=0.6)


def test_one_seed_one_shot(tmp_path: Path) -> None:
    draws = (
        '[population]\nshots = {}\n[population.draw]\n"material.stiffness_factor" = {{ low = 1, high = 2 }}\n'
    )
    few = made(tmp_path / "few", draws.format(2), numbers=[2]) / "virtual-2"
    all_of_them = made(tmp_path / "all", draws.format(3)) / "virtual-2"
    names = sorted(path.name for path in few.iterdir())
    assert "truth.json" in names
    for name in names:
        assert (few / name).read_bytes() == (all_of_them / name).read_bytes(), name
    first = all_of_them.parent / "virtual-1"
    assert (first / "scope.csv").read_bytes() != (few / "scope.csv").read_bytes()


def test_a_shot_that_cannot_be_made_leaves_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The third simulation folds: the other folders are there, and the refusal names it and why."""
    whole = make_module.try_truths

    def folding(specifications: list[Specification], **options: object) -> list[object]:
        truths: list[object] = list(whole(specifications, **options))  # type: ignore[arg-type]
        long = [q.specimen.length > 6.9e-3 for q in specifications]
        return [TruthError("it folds") if far else truth for far, truth in zip(long, truths, strict=True)]

    monkeypatch.setattr(make_module, "try_truths", folding)
    draws = (
        '[population]\nshots = 3\n[population.draw]\n"specimen.length" = { choose = ["6.5 mm", "7 mm"] }\n'
    )
    with pytest.raises(InputError, match=r"virtual-\d cannot be made: it folds"):
        made(tmp_path, draws)
    lengths = {shot.name: shot.quantities.specimen.length for shot in read_specification(tmp_path)}
    there = {path.name for path in (tmp_path / "out").iterdir()}
    assert 0 < len(there) < 3
    assert there == {name for name, length in lengths.items() if length < 6.9e-3}


def test_gpus_get_equally_long_batches(tmp_path: Path) -> None:
    """150 shots of four GPUs are one batch each, of every duration; the longest of each are as long."""
    speeds = np.random.default_rng(1).uniform(1.2, 3.5, 150)
    jobs = [SimpleNamespace(last=2.6e-3 / speed) for speed in speeds]
    todo = [(SimpleNamespace(number=k), tmp_path) for k in range(150)]

    def numbers(batches: list[list[Any]]) -> list[list[int]]:
        return [[shot.number for shot, _ in batch] for batch in batches]

    found = numbers(gpu_batches(todo, jobs, 4))  # type: ignore[arg-type]
    assert sorted(k for batch in found for k in batch) == list(range(150))
    assert [len(batch) for batch in found] == [38, 38, 37, 37]
    slowest = np.argsort(speeds)
    assert [batch[0] for batch in found] == slowest[:4].tolist()
    # One GPU takes more than it simulates at a time in two rounds, alike in number.
    alone = numbers(gpu_batches(todo, jobs, 1))  # type: ignore[arg-type]
    assert [len(batch) for batch in alone] == [75, 75]
    assert [batch[0] for batch in alone] == slowest[:2].tolist()
    assert len(gpu_batches(todo[:3], jobs[:3], 4)) == 3  # type: ignore[arg-type]


def test_every_gpu_has_one_batch_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The shots of three batches on two stand-ins for GPUs: all written, none on a busy one."""
    busy: dict[str, int] = {"cuda:0": 0, "cuda:1": 0}
    most, used = dict(busy), []
    lock = Lock()

    def truths(batch: list[Any], gpu: str, threads: int) -> list[Any]:
        with lock:
            busy[gpu] += 1
            most[gpu] = max(most[gpu], busy[gpu])
            used.append(gpu)
        sleep(0.05)
        with lock:
            busy[gpu] -= 1
        return list(try_truths([shot.quantities for shot, _ in batch], folder=tmp_path, threads=1))

    @contextmanager
    def threads_for_processes(workers: int) -> Iterator[ThreadPoolExecutor]:
        with ThreadPoolExecutor(workers) as pool:
            yield pool

    monkeypatch.setattr(make_module, "gpus", lambda name: tuple(busy))
    monkeypatch.setattr(make_module, "TRUTHS_PER_GPU", 1)
    monkeypatch.setattr(make_module, "_truths", truths)
    monkeypatch.setattr("kolsky.base.process.process_pool", threads_for_processes)
    out = made(tmp_path, "[population]\nshots = 4\n", device="cuda", workers=3)
    assert {path.name for path in out.iterdir()} == {f"virtual-{k}" for k in range(1, 5)}
    assert sorted(used) == ["cuda:0", "cuda:0", "cuda:1", "cuda:1"]
    assert most == {"cuda:0": 1, "cuda:1": 1}


def test_what_is_there_is_kept_and_another_shot_refused(tmp_path: Path) -> None:
    out = made(tmp_path)
    (out / "notes.txt").write_text("mine")
    before = (out / "truth.json").stat().st_mtime_ns
    again = make(read_specification(tmp_path), out)
    assert [shot.fresh for shot in again] == [False]
    assert (out / "truth.json").stat().st_mtime_ns == before
    with pytest.raises(InputError, match="something else than this shot"):
        made(tmp_path, '[specimen]\nlength = "7 mm"\n')


def test_imperfections_are_in_the_shot_file_or_in_the_recordings(tmp_path: Path) -> None:
    wrong = made(
        tmp_path / "wrong",
        """
[imperfections]
length = "-1.5 %"
diameter = "2 %"
density = "5 %"
sensitivity = "10 %"
poisson = -0.004
damping = "10 us"
trigger = "20 us"
y_offset = "100 um"
Z_offset = "20 um"
gain = "3 %"
baseline = "5 mV"
""",
    )
    right = made(tmp_path / "right")
    declared = tomllib.loads((wrong / "shot.toml").read_text("utf-8"))
    assert declared["specimen"] == {"diameter": "9.69 mm", "length": "6.4025 mm", "density": "913.5 kg/m^3"}
    assert declared["force"]["sensitivity"] == "0.01232 V/N"
    assert declared["model"]["poisson"] == 0.495
    assert declared["model"]["damping"] == "35 us"

    def table(folder: Path, name: str) -> np.ndarray:
        return np.loadtxt(folder / name, delimiter=",", skiprows=1)

    shift = table(wrong, "frames.csv") - table(right, "frames.csv")
    assert shift[:, 1] == pytest.approx(20e-6, abs=1e-12)
    outline = table(wrong, "centreline.csv") - table(right, "centreline.csv")
    assert outline[:, 2] == pytest.approx(0.1, abs=2e-6)
    assert outline[:, 3] == pytest.approx(0.02, abs=2e-6)
    volts, clean = table(wrong, "scope.csv"), table(right, "scope.csv")
    n = len(clean)
    extra = volts[:n, 2] - clean[:, 2]
    truth = np.load(right / "truth_surface.npz")
    force = np.interp(clean[:, 0], truth["t_force"], truth["transmitted"], left=0.0)
    expected = 0.03 * 0.0112 * force + 0.005 * (clean[:, 0] >= 37.5e-6)
    away = np.abs(clean[:, 0] - 37.5e-6) > 1e-6  # a sample at the very start is on either side of it
    assert extra[away] == pytest.approx(expected[away], abs=2.1 / 4096)  # a code of either


def test_the_truth_is_read_by_nothing_else() -> None:
    """No module of the package but those of the virtual laboratory knows the name of the truth's files."""
    named = re.compile(r"truth\.json|truth_surface|shot_folder import .*TRUTH")
    readers = {
        str(path.relative_to(ROOT))
        for package in ("kolsky", "dic", "explicit", "doe")
        for path in (ROOT / package).rglob("*.py")
        if named.search(path.read_text("utf-8"))
    }
    assert readers <= {"kolsky/virtual/make.py", "kolsky/virtual/shot_file.py"}


def test_the_template_is_the_defaults() -> None:
    """Every key of the schema stands in the template, in force or as a comment, at its default."""
    text = template_file("virtual.toml")
    written = Specification.model_validate(tomllib.loads(text)).model_dump()
    default = Specification().model_dump()
    assert written.keys() == default.keys()
    for title, table in default.items():
        if isinstance(table, dict):
            numbers = {key: value for key, value in table.items() if isinstance(value, float)}
            # A text such as "24.7 kPa" is read with one rounding.
            assert {key: written[title][key] for key in numbers} == pytest.approx(numbers, rel=1e-14), title
            assert {**written[title], **numbers} == table, title
        else:
            assert written[title] == table, title
    for title, table in Specification.model_fields.items():
        keys = getattr(table.annotation, "model_fields", {})
        if title in {"uncertainty", "transmission"}:
            continue
        for key in keys:
            assert re.search(rf"^(# )?{key} = ", text, re.MULTILINE), f"{title}.{key}"


def test_the_command_says_as_one_object_what_it_made(tmp_path: Path) -> None:
    path = tmp_path / "SPEC.toml"
    path.write_text("format = 1\n" + TINY, encoding="utf-8")
    out = tmp_path / "out"
    for made_now in (1, 0):  # a shot that is there is kept
        said = json_of("virtual", "make", path, "--out", out)
        assert (said["shots"], said["made"], said["folder"]) == (1, made_now, str(out))
        assert [Path(folder, "shot.toml").is_file() for folder in said["folders"]] == [True]

"""Translated time loops are found again, and never where anything they depend on is another."""

from pathlib import Path
from typing import Any

import pytest
import warp as wp

from explicit.simd import kernel
from explicit.simd.kernel import cached_translation


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


def test_a_translation_is_made_once(folder: Path) -> None:
    assert cached_translation(kernel_of(1), "worker 8 fp64", lambda: "code") == "code"
    assert cached_translation(kernel_of(1), "worker 8 fp64", never) == "code"
    (file,) = (folder / "lanes").iterdir()
    assert file.read_text() == "code"


def test_another_constant_function_choice_or_source_is_another_translation(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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

"""Time loops are compiled before they are wanted: each once, told of, and only where they are not known."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from explicit import Model, PlatenMotion, Problem, Samples, Sampling, compile_time_loops, cylinder, run_batch
from explicit.materials import neo_hookean
from explicit.simd import kernel, lane_kernel


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

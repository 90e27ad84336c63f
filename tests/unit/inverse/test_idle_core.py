"""Work beside a lone run: done once, in a thread, its errors raised, and what is loaded there is found."""

import sys
import threading
from pathlib import Path

import pytest

from explicit.simd import lane_kernel
from kolsky.inverse.forward import Numerics
from kolsky.inverse.problem import Settings, prepare_shot
from kolsky.inverse.search import search_shot
from kolsky.inverse.work import SWITCH_INTERVAL, IdleCore, leaves_a_core
from kolsky.shot.load import load_shot
from kolsky.uncertainty.mesh_error import mesh_change

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


def test_what_waits_is_done_once_beside_a_block_with_an_idle_core() -> None:
    done: list[tuple[str, bool]] = []
    core = IdleCore(
        [
            lambda name=name: done.append((name, threading.current_thread() is threading.main_thread()))
            for name in ("first", "second")
        ]
    )
    with core.used(idle=False):
        pass
    assert done == []
    for _ in range(2):
        with core.used(idle=True):
            pass
        assert done == [("first", False), ("second", False)]


def test_runs_that_are_put_off_wait_for_a_lone_run_without_other_work_or_to_be_asked_for() -> None:
    done: list[str] = []
    core = IdleCore([lambda: done.append("loaded")])
    runs = core.put_off(lambda: done.append("run") or len(done))
    with core.used(idle=False):
        pass
    assert done == []
    with core.used(idle=True):
        pass
    assert done == ["loaded"]
    for _ in range(2):
        with core.used(idle=True):
            pass
        assert done == ["loaded", "run"]
    assert runs() == 2
    again = core.put_off(lambda: done.append("asked") or len(done))
    assert again() == 3
    with core.used(idle=True):  # nothing is done twice
        pass
    assert done == ["loaded", "run", "asked"]


def test_one_thread_leaves_no_core() -> None:
    assert not leaves_a_core("cpu", 1)
    assert leaves_a_core("cpu", 2)


def test_errors_are_raised_and_the_interpreter_is_as_before() -> None:
    before, within = sys.getswitchinterval(), []

    def fail() -> None:
        within.append(sys.getswitchinterval())
        raise ImportError("no such library")

    with pytest.raises(ImportError, match="no such library"), IdleCore([fail]).used(idle=True):
        pass
    assert within == [pytest.approx(SWITCH_INTERVAL)]  # Python keeps whole microseconds
    with pytest.raises(ValueError, match="the run"), IdleCore([fail]).used(idle=True):
        raise ValueError("the run")
    assert sys.getswitchinterval() == before


def test_a_search_loads_beside_its_lone_run_what_the_mesh_error_needs() -> None:
    loaded: list[bool] = []
    lane_kernel.cache_clear()  # other tests have loaded both elements
    settings = Settings(
        free={"stiffness_factor": None},
        numerics=Numerics(mesh=(12, 16)),
        refined_mesh=(18, 24),
        replicates=0,
    )
    found = search_shot(
        prepare_shot(load_shot(OPEN_01)),
        settings,
        lambda stage, done, total: None,
        meanwhile=[lambda: loaded.append(threading.current_thread() is threading.main_thread())],
    )
    assert loaded == [False]
    before = lane_kernel.cache_info()
    mesh_change(found.stages, found.fine)
    after = lane_kernel.cache_info()
    assert after.misses == before.misses
    assert after.hits >= before.hits + 2

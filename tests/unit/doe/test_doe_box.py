"""Box: scaling compared with values by hand, round trips, and error messages."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import ledger_sweep
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from doe import Box
from doe.ledger import Ledger, Run, run_chunks

BOX = Box(("stiffness_factor", "damping"), (0.75, 1e-6), (1.25, 1e-2), (False, True))


@st.composite
def boxes(draw: st.DrawFn) -> Box:
    """Boxes whose edges are at least a thousandth of their bounds, so that a round trip keeps digits."""
    d = draw(st.integers(1, 4))
    logarithmic = tuple(draw(st.booleans()) for _ in range(d))
    lower = tuple(draw(st.floats(1e-6, 1e3)) if log else draw(st.floats(-1e3, 1e3)) for log in logarithmic)
    edges = tuple(draw(st.floats(1e-3, 1e3)) * max(abs(a), 1e-3) for a in lower)
    return Box(tuple(f"p{j}" for j in range(d)), lower, tuple(map(sum, zip(lower, edges))), logarithmic)  # noqa: B905


def unit_points(box: Box) -> st.SearchStrategy[list[list[float]]]:
    return st.lists(
        st.lists(st.floats(0, 1), min_size=box.dimension, max_size=box.dimension), min_size=1, max_size=5
    )


def test_scale_linear_and_logarithmic_by_hand() -> None:
    # A quarter of [0.75, 1.25] is 0.875; half of four decades from 1e-6 is 1e-4.
    np.testing.assert_allclose(BOX.scale([0.25, 0.5]), [0.875, 1e-4], rtol=1e-14)  # a few ulp of pow
    np.testing.assert_allclose(BOX.unit([0.875, 1e-4]), [0.25, 0.5], rtol=1e-14)  # a few ulp of log


def test_default_is_linear_and_of_reads_names() -> None:
    assert Box(("a",), (0,), (2,)).logarithmic == (False,)
    assert Box.of({"stiffness_factor": (0.75, 1.25), "damping": (1e-6, 1e-2)}, logarithmic=["damping"]) == BOX


@given(boxes())
def test_faces_are_exact(box: Box) -> None:
    assert tuple(box.scale(np.zeros(box.dimension))) == box.lower
    assert tuple(box.scale(np.ones(box.dimension))) == box.upper
    assert tuple(box.unit(box.lower)) == (0.0,) * box.dimension
    assert tuple(box.unit(box.upper)) == (1.0,) * box.dimension


@given(st.data())
def test_round_trip_and_containment(data: st.DataObject) -> None:
    box = data.draw(boxes())
    u = np.array(data.draw(unit_points(box)))
    x = box.scale(u)
    # Round-off 1e-16 of the bound, divided by an edge of 1e-3 of it (and by log(1.001) for a logarithm).
    np.testing.assert_allclose(box.unit(x), u, atol=5e-12, rtol=0)
    assert box.contains(box.scale(0.001 + 0.998 * u)).all()
    assert not box.contains(box.scale(1.001 + u)).any()
    assert not box.contains(box.scale(-0.001 - u)).any()


@given(st.data())
def test_around_is_the_intersection(data: st.DataObject) -> None:
    box = data.draw(boxes())
    u = np.array(data.draw(unit_points(box)))[0]
    fraction = data.draw(st.floats(0.05, 1.0))
    small = box.around(box.scale(u), fraction)
    # Edges in the outer unit box: [u - f/2, u + f/2] cut at 0 and 1; tolerance as in the round trip.
    np.testing.assert_allclose(box.unit(small.lower), np.maximum(u - fraction / 2, 0), atol=1e-11)
    np.testing.assert_allclose(box.unit(small.upper), np.minimum(u + fraction / 2, 1), atol=1e-11)
    assert small.names == box.names
    assert small.logarithmic == box.logarithmic


def test_containment_and_names() -> None:
    assert BOX.contains([[1.0, -1.0], [1.0, 1e-3], [1.3, 1e-3]]).tolist() == [False, True, False]
    assert bool(BOX.contains([1.0, 1e-2]))
    assert BOX.as_dict([1.0, 1e-3]) == {"stiffness_factor": 1.0, "damping": 1e-3}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((), (), ()), "at least one parameter"),
        (("m", (0,), (1,)), "must be a tuple of names"),
        ((("m", "m"), (0, 0), (1, 1)), "used 2 times"),
        ((("",), (0,), (1,)), "name is empty"),
        ((("m",), (1,), (1,)), r"'m' must be below its upper bound, got \[1.0, 1.0\]"),
        ((("m",), (np.nan,), (1,)), "'m' must be finite"),
        ((("m",), (-1.7e308,), (1.7e308,)), "'m' must be finite"),
        ((("m",), (0,), (np.inf,)), "'m' must be finite"),
        ((("m",), (0, 1), (2,)), r"lower must have one entry a name \(1\), got 2"),
        ((("m",), (0,), (1,), (True,)), "'m' needs a lower bound > 0, got 0"),
        ((("m",), (1,), (2,), (True, False)), "logarithmic must have one entry"),
    ],
)
def test_bad_boxes_are_refused(arguments: tuple, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Box(*arguments)


def test_bad_points_are_refused() -> None:
    with pytest.raises(ValueError, match=r"must hold the 2 parameters .* got shape \[3\]"):
        BOX.scale([0.1, 0.2, 0.3])
    with pytest.raises(ValueError, match=r"damping is nan at index \[1\]"):
        BOX.unit([[1.0, 1e-3], [1.0, np.nan]])
    with pytest.raises(ValueError, match="'damping' must be > 0, got 0"):
        BOX.unit([1.0, 0.0])
    with pytest.raises(ValueError, match=r"run 1: stiffness_factor = 1.3 is outside \[0.75, 1.25\]"):
        BOX.require([[1.0, 1e-3], [1.3, 1e-3]], what="run")
    with pytest.raises(ValueError, match=r"fraction must be in \(0, 1\], got 0"):
        BOX.around([1.0, 1e-3], 0.0)
    with pytest.raises(ValueError, match="stiffness_factor = 2 is outside"):
        BOX.around([2.0, 1e-3], 0.5)
    with pytest.raises(ValueError, match=r"logarithmic names \['dampign'\]"):
        Box.of({"damping": (1e-6, 1e-2)}, logarithmic=["dampign"])


POINTS = ledger_sweep.POINTS[:400]


def processes(workers: int = 2) -> ProcessPoolExecutor:
    # Not forked: this process has threads, and what they hold would be held in the child for ever.
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"))


def assert_same_bits(runs: list[Run]) -> None:
    plain = run_chunks(ledger_sweep.oscillator, POINTS, chunk=len(POINTS))
    assert [run.outcome for run in runs] == [run.outcome for run in plain]
    assert [run.results.tobytes() for run in runs] == [run.results.tobytes() for run in plain]


def test_chunks_through_threads_are_recorded_by_the_parent(tmp_path: Path) -> None:
    with Ledger(tmp_path / "l.sqlite", ledger_sweep.MODEL) as book:
        runs = run_chunks(
            ledger_sweep.oscillator, POINTS, chunk=7, ledger=book, executor=partial(ThreadPoolExecutor, 3)
        )
        assert len(book) == 400
    assert_same_bits(runs)


def test_a_process_that_dies_has_its_chunk_run_again(tmp_path: Path) -> None:
    marker = tmp_path / "died"
    with Ledger(tmp_path / "l.sqlite", ledger_sweep.MODEL) as book:
        runs = run_chunks(
            partial(ledger_sweep.mortal, marker), POINTS, chunk=20, ledger=book, executor=processes
        )
        assert len(book) == 400
    assert marker.exists()
    assert_same_bits(runs)


def test_workers_that_always_die_end_the_sweep() -> None:
    with pytest.raises(RuntimeError, match="workers died 2 times in a row with no chunk finished"):
        run_chunks(ledger_sweep.hopeless, POINTS[:4], chunk=2, executor=partial(processes, 1), attempts=2)

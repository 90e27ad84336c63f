"""Drawing by two processes gives the figures of one; the first draws what the second fails at."""

import os
import time

import pytest

from kolsky.report.pages.parallel import can_fork, draw_in_processes

sharing = pytest.mark.skipif(not can_fork(), reason="one core, or no copies of processes here")


def draws(n: int) -> list:
    return [lambda k=k: f"{k} " + "x" * 100_000 for k in range(n)]


@pytest.mark.parametrize("processes", [1, 2])
def test_every_figure_once_and_in_order(processes: int) -> None:
    assert draw_in_processes(processes, draws(7)) == [draw() for draw in draws(7)]


@sharing
def test_both_draw() -> None:
    def slowly() -> str:
        time.sleep(0.05)
        return str(os.getpid())

    assert len(set(draw_in_processes(2, [slowly] * 12))) == 2


@sharing
def test_what_the_copy_fails_at_is_drawn_here() -> None:
    here = os.getpid()

    def only_here() -> str:
        time.sleep(0.05)
        if os.getpid() != here:
            raise RuntimeError("no")
        return "drawn"

    assert draw_in_processes(2, [only_here] * 6) == ["drawn"] * 6


@sharing
def test_what_fails_here_is_told() -> None:
    def never() -> str:
        raise ValueError("cannot be drawn")

    with pytest.raises(ValueError, match="cannot be drawn"):
        draw_in_processes(2, [never] * 4)

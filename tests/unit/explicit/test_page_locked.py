"""Memory that results from a GPU arrive in: who has it, and when it is used again."""

import gc

import numpy as np
import pytest

from explicit.device import select_device
from explicit.drivers import STEP, Pool


@pytest.fixture
def pool() -> Pool:
    select_device("cpu")
    return Pool(limit=4 * STEP, pinned=False)


def test_a_piece_is_used_again_when_its_result_is_gone(pool: Pool) -> None:
    piece, numbers = pool.lend(10)
    numbers[:] = np.arange(10.0)
    view = numbers[2:4]
    del numbers
    gc.collect()
    other, _ = pool.lend(10)
    assert other is not piece  # the view still lives
    np.testing.assert_array_equal(view, [2.0, 3.0])
    del view
    gc.collect()
    assert pool.lend(10)[0] is piece


def test_the_numbers_are_those_of_the_piece(pool: Pool) -> None:
    piece, numbers = pool.lend(7)
    piece.memory.numpy()[:7] = np.arange(7.0)
    assert numbers.shape == (7,)
    assert numbers.flags.writeable
    np.testing.assert_array_equal(numbers, np.arange(7.0))


def test_no_more_is_locked_than_is_allowed(pool: Pool) -> None:
    kept = [pool.lend(STEP) for _ in range(4)]
    assert pool.lend(1) is None
    kept.pop()
    gc.collect()
    assert pool.lend(1) is not None


def test_free_pieces_make_room_for_a_larger_one(pool: Pool) -> None:
    for _ in range(2):
        assert pool.lend(STEP) is not None
    gc.collect()
    piece, _ = pool.lend(4 * STEP)
    assert piece.memory.size == 4 * STEP


def test_a_piece_is_not_wasted_on_much_less(pool: Pool) -> None:
    large, numbers = pool.lend(3 * STEP)
    del numbers
    gc.collect()
    assert pool.lend(10)[0] is not large
    assert pool.lend(STEP + 1)[0] is large

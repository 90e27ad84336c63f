"""Arrays that reach a device in one copy hold what each would hold by itself, while one of them lives."""

import gc

import numpy as np
import warp as wp

from explicit import arguments
from explicit.arguments import APART, in_one_copy
from explicit.device import select_device
from explicit.elements.base import solid_struct
from explicit.precision import PRECISIONS


def test_every_array_is_that_of_its_own_copy() -> None:
    where, Solid = select_device("cpu"), solid_struct(PRECISIONS["fp64"])
    rng = np.random.default_rng(5)
    solids = np.zeros(3, dtype=Solid.numpy_dtype())
    for name in solids.dtype.names or ():
        solids[name] = rng.uniform(size=3)
    values = {
        "times": (rng.uniform(size=7), wp.float64),
        "rounded": (rng.uniform(size=(2, 5)), wp.float32),
        "turned": (rng.uniform(size=(4, 3)).T, wp.float64),
        "chosen": (np.array([2, 0, 1]), wp.int32),
        "none": (np.zeros((0, 4)), wp.float64),
        "solids": (solids, Solid),
    }
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

"""Figures that are drawn fast look the same: collection of cycles, layout of spines."""

import gc

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from kolsky.base.process import GC_THRESHOLD, infrequent_gc
from kolsky.report.canvas import STYLE


def test_cycles_are_looked_for_seldom_until_the_end_or_an_error():
    before, within = gc.get_threshold(), []

    @infrequent_gc()
    def failing():
        within.append(gc.get_threshold())
        raise KeyError("a figure")

    with pytest.raises(KeyError):
        failing()
    assert within == [(GC_THRESHOLD, *before[1:])]
    assert gc.get_threshold() == before


def test_spines_take_no_room_of_their_own():
    with matplotlib.rc_context(fname=STYLE):
        figure = Figure(figsize=(3.3, 2.5), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2)
        left.plot([0.0, 1.3], [0.0, 2.0e3])
        left.set(xlabel="Time (ms)", ylabel="Force (N)", title="one")
        left.twinx().plot([0.0, 1.3], [3.0, 4.0])
        right.imshow(np.arange(12.0).reshape(3, 4))
        figure.colorbar(right.images[0], ax=right, location="bottom", extend="both")
        figure.draw_without_rendering()
        for ax in figure.axes:
            whole = ax.get_tightbbox().extents
            for spine in ax.spines.values():
                spine.set_in_layout(False)
            # [px]; the same numbers added in another order
            np.testing.assert_allclose(ax.get_tightbbox().extents, whole, atol=1e-9)

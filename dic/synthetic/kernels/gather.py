"""Kernels of the pixels: the mean of the rays around each, through the lens."""

import warp as wp

from dic.synthetic.kernels.cast import View


@wp.func
def level_of(
    view: View, table: wp.array2d(dtype=wp.float32), sharpest: wp.float32, step: wp.float32, away: wp.float32
):
    """Row of the table for a place at that depth: a whole number and the part above it."""
    level = wp.int32(0)
    part = wp.float32(0.0)
    if table.shape[0] > 1 and away > wp.float32(0.0):
        disc = wp.float32(view.coc * (wp.float64(1.0) / view.focus - wp.float64(1.0) / wp.float64(away)))
        wide = wp.sqrt(sharpest * sharpest + disc * disc / wp.float32(16.0))
        part = wp.clamp(
            (wide - sharpest) / step, wp.float32(0.0), wp.float32(table.shape[0]) - wp.float32(1.001)
        )
        level = wp.int32(part)
        part = part - wp.float32(level)
    return level, part


@wp.kernel(enable_backward=False)
def across(
    view: View,
    table: wp.array2d(dtype=wp.float32),
    sharpest: wp.float32,
    step: wp.float32,
    grey: wp.array3d(dtype=wp.float32),
    depth: wp.array3d(dtype=wp.float32),
    run: wp.int32,
    lines: wp.array3d(dtype=wp.float32),
):
    """Rays gathered along the rows: the integral over a pixel's width of what the lens makes of the light.

    `table` holds the weights of a pixel's rays along one axis for lenses of the standard deviations
    `sharpest`, `sharpest + step`, ... [px]. Away from the plane of focus the circle of confusion, a disc of
    diameter coc |1/focus - 1/depth|, adds a sixteenth of its square to the variance.
    """
    here, row, column = wp.tid()
    for c in range(column, column + run):
        level, part = level_of(view, table, sharpest, step, depth[here, row // view.fine, c + view.pad])
        above = wp.min(level + 1, table.shape[0] - 1)
        light = wp.float32(0.0)
        for i in range(table.shape[1]):
            w = table[level, i] + part * (table[above, i] - table[level, i])
            light = light + w * grey[here, row, c * view.fine + i]
        lines[here, row, c] = light


@wp.kernel(enable_backward=False)
def down(
    view: View,
    table: wp.array2d(dtype=wp.float32),
    sharpest: wp.float32,
    step: wp.float32,
    lines: wp.array3d(dtype=wp.float32),
    depth: wp.array3d(dtype=wp.float32),
    run: wp.int32,
    picture: wp.array3d(dtype=wp.float32),
):
    """The same along the columns."""
    here, row, column = wp.tid()
    for c in range(column, column + run):
        level, part = level_of(view, table, sharpest, step, depth[here, row + view.pad, c + view.pad])
        above = wp.min(level + 1, table.shape[0] - 1)
        light = wp.float32(0.0)
        for j in range(table.shape[1]):
            w = table[level, j] + part * (table[above, j] - table[level, j])
            light = light + w * lines[here, row * view.fine + j, c]
        picture[here, row, c] = light

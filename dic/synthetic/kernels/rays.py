"""The renderer's Warp kernels: rays on bodies and boards, and the weighted mean of rays for each pixel.

Rays are intersected with bodies of revolution whose generators are polylines. Lengths and positions are
float64. A camera is sixty radii away. In float32 the square root in the intersection of a ray with a cone
would have an error of half a micrometre.
"""

import warp as wp

FAR = wp.constant(wp.float64(1.0e9))
"""Distance of a ray that hits no body."""
FLAT = wp.constant(wp.float64(1.0e-12))
"""A segment with a smaller height than this [m] is treated as a disc normal to the axis."""
EDGE = wp.constant(wp.float64(1.0e-10))
"""Overlap of neighbouring segments [m]: no ray passes between them."""


@wp.struct
class Placed:
    """A body at one instant: rotation into its frame, the camera's centre in that frame, its size, its
    slip."""

    turn: wp.mat33d
    eye: wp.vec3d
    widest: wp.float64
    low: wp.float64
    high: wp.float64
    slip: wp.vec2d


@wp.struct
class Painted:
    """Time-independent data of a body: index of its first node, and its paint."""

    first: wp.int32
    radius: wp.float64
    texels: wp.int64
    rows: wp.int32
    columns: wp.int32
    pitch: wp.float64
    origin: wp.vec2d
    patch: wp.vec3d
    shine: wp.float32


@wp.struct
class Bodies:
    """Bodies of revolution at all instants; passed by value, therefore few arrays."""

    nodes: wp.array2d(dtype=wp.vec3d)
    along: wp.array(dtype=wp.float64)
    placed: wp.array2d(dtype=Placed)
    painted: wp.array(dtype=Painted)
    bins: wp.array3d(dtype=wp.vec2i)
    texels: wp.array(dtype=wp.float32)


@wp.func
def on_segment(
    p: wp.vec3d,
    d: wp.vec3d,
    least: wp.float64,
    y0: wp.float64,
    r0: wp.float64,
    y1: wp.float64,
    r1: wp.float64,
):
    """Smallest s >= least at which the ray p + s d meets a segment, and the relative position on the
    segment."""
    best = FAR
    share = wp.float64(0.0)
    if wp.abs(y1 - y0) < FLAT:
        if wp.abs(d[1]) > FLAT:
            s = (y0 - p[1]) / d[1]
            x = p[0] + s * d[0]
            z = p[2] + s * d[2]
            rho = wp.sqrt(x * x + z * z)
            low = wp.min(r0, r1)
            high = wp.max(r0, r1)
            if s >= least and rho >= low and rho <= high and high > low:
                best = s
                share = (rho - r0) / (r1 - r0)
    else:
        g = (r1 - r0) / (y1 - y0)
        rho0 = r0 + g * (p[1] - y0)
        a = d[0] * d[0] + d[2] * d[2] - g * g * d[1] * d[1]
        b = p[0] * d[0] + p[2] * d[2] - g * d[1] * rho0
        c = p[0] * p[0] + p[2] * p[2] - rho0 * rho0
        under = b * b - a * c
        if under >= wp.float64(0.0):
            root = wp.sqrt(under)
            for which in range(2):
                s = FAR
                if wp.abs(a) > FLAT:
                    s = (-b - root) / a
                    if (which == 0) != (a > wp.float64(0.0)):
                        s = (-b + root) / a
                elif which == 0 and wp.abs(b) > FLAT:
                    s = -c / (wp.float64(2.0) * b)
                if s < FAR and s >= least and best == FAR:
                    y = p[1] + s * d[1]
                    between = y >= wp.min(y0, y1) - EDGE and y <= wp.max(y0, y1) + EDGE
                    if between and r0 + g * (y - y0) >= -EDGE:
                        best = s
                        share = (y - y0) / (y1 - y0)
    return best, wp.clamp(share, wp.float64(0.0), wp.float64(1.0))


@wp.func
def on_body(bodies: Bodies, q: wp.int32, b: wp.int32, p: wp.vec3d, d: wp.vec3d):
    """First s at which the ray p + s d meets body b at instant q, relative position on the segment, and
    segment (-1: none).

    `p` is the point of the ray closest to the axis. The body lies between -half and half. The visible point
    is nearly always on the near half, which is searched first. In each half only the segments at the heights
    of the ray are tested.
    """
    best = FAR
    share = wp.float64(0.0)
    segment = wp.int32(-1)
    at = bodies.placed[q, b]
    across = d[0] * d[0] + d[2] * d[2]
    room = at.widest * at.widest - p[0] * p[0] - p[2] * p[2]
    beyond = wp.max(wp.max(p[1] - at.high, at.low - p[1]) - EDGE, wp.float64(0.0))
    if room > wp.float64(0.0) and beyond * beyond * across <= room * d[1] * d[1]:
        half = wp.sqrt(room / across) + EDGE
        n = bodies.bins.shape[2]
        scale = wp.float64(n) / wp.max(at.high - at.low, FLAT)
        for side in range(2):
            if segment < 0:
                least = -half
                most = wp.float64(EDGE)
                if side == 1:
                    least = wp.float64(0.0)
                    most = half
                y0 = p[1] + least * d[1]
                y1 = p[1] + most * d[1]
                low = wp.clamp((wp.min(y0, y1) - EDGE - at.low) * scale, wp.float64(0.0), wp.float64(n - 1))
                high = wp.clamp((wp.max(y0, y1) + EDGE - at.low) * scale, wp.float64(0.0), wp.float64(n - 1))
                first = wp.int32(low)
                last = wp.int32(high)
                span = bodies.bins[q, b, first]
                k0 = span[0]
                k1 = span[1]
                for layer in range(first + 1, last + 1):
                    span = bodies.bins[q, b, layer]
                    k0 = wp.min(k0, span[0])
                    k1 = wp.max(k1, span[1])
                node = bodies.nodes[q, k0]
                for k in range(k0, k1 + 1):
                    after = bodies.nodes[q, k + 1]
                    s, t = on_segment(p, d, least, node[0], node[1], after[0], after[1])
                    if s <= most and s < best:
                        best = s
                        share = t
                        segment = k
                    node = after
    return best, share, segment


@wp.struct
class View:
    """A camera, its rays and its lamp."""

    rays: wp.array2d(dtype=wp.vec2d)
    pad: wp.int32
    fine: wp.int32
    turn: wp.mat33d
    centre: wp.vec3d
    haze: wp.array3d(dtype=wp.vec2f)
    haze_pitch: wp.float64
    lamp: wp.vec3f
    ambient: wp.float32
    gloss: wp.float32
    background: wp.float32
    focus: wp.float64
    coc: wp.float64


@wp.func
def haze_at(view: View, f: wp.int32, x: wp.float64, y: wp.float64):
    """Displacement of a pixel by the air in frame f [px]."""
    u = wp.clamp(x / view.haze_pitch, wp.float64(0.0), wp.float64(view.haze.shape[2]) - wp.float64(1.001))
    v = wp.clamp(y / view.haze_pitch, wp.float64(0.0), wp.float64(view.haze.shape[1]) - wp.float64(1.001))
    i = wp.int32(wp.floor(u))
    j = wp.int32(wp.floor(v))
    a = wp.float32(u - wp.float64(i))
    b = wp.float32(v - wp.float64(j))
    one = wp.float32(1.0)
    shift = (one - b) * ((one - a) * view.haze[f, j, i] + a * view.haze[f, j, i + 1]) + b * (
        (one - a) * view.haze[f, j + 1, i] + a * view.haze[f, j + 1, i + 1]
    )
    return wp.vec2d(wp.float64(shift[0]), wp.float64(shift[1]))


@wp.func
def direction(view: View, f: wp.int32, row: wp.int32, column: wp.int32):
    """Direction of a ray in the scene's frame, without lens distortion, of length 1 along the optical axis.

    `View.rays` holds the undistorted points of whole pixels; linear interpolation between them is accurate to
    1e-6 px.
    """
    fine = wp.float64(view.fine)
    half = wp.float64(0.5)
    x = (wp.float64(column) + half) / fine - half
    y = (wp.float64(row) + half) / fine - half
    if view.haze.shape[0] > 0:
        shift = haze_at(view, f, x, y)
        x = x + shift[0]
        y = y + shift[1]
    x = x + wp.float64(1.0)  # the first of `rays` is one pixel before the first that is rendered
    y = y + wp.float64(1.0)
    i = wp.clamp(wp.int32(wp.floor(x)), 0, view.rays.shape[1] - 2)
    j = wp.clamp(wp.int32(wp.floor(y)), 0, view.rays.shape[0] - 2)
    a = x - wp.float64(i)
    b = y - wp.float64(j)
    one = wp.float64(1.0)
    ideal = (one - b) * ((one - a) * view.rays[j, i] + a * view.rays[j, i + 1]) + b * (
        (one - a) * view.rays[j + 1, i] + a * view.rays[j + 1, i + 1]
    )
    return wp.mul(wp.transpose(view.turn), wp.vec3d(ideal[0], ideal[1], one))


@wp.func
def texel(texels: wp.array(dtype=wp.float32), body: Painted, around: wp.float64, along: wp.float64):
    """Reflectance of a body's paint, bilinear between its texels. Outside the texture it is the value of the
    nearest texel."""
    u = wp.clamp(
        (around - body.origin[0]) / body.pitch, wp.float64(0.0), wp.float64(body.columns) - wp.float64(1.001)
    )
    v = wp.clamp(
        (along - body.origin[1]) / body.pitch, wp.float64(0.0), wp.float64(body.rows) - wp.float64(1.001)
    )
    i = wp.int32(u)
    j = wp.int32(v)
    a = wp.float32(u - wp.float64(i))
    c = wp.float32(v - wp.float64(j))
    at = body.texels + wp.int64(j) * wp.int64(body.columns) + wp.int64(i)
    below = at + wp.int64(body.columns)
    one = wp.float32(1.0)
    near = (one - a) * texels[at] + a * texels[at + wp.int64(1)]
    far = (one - a) * texels[below] + a * texels[below + wp.int64(1)]
    return (one - c) * near + c * far


@wp.func
def reflectance(bodies: Bodies, q: wp.int32, b: wp.int32, x: wp.vec3d, k: wp.int32, share: wp.float64):
    """Reflectance at a point of body b in its frame. Detached paint is read at its original position."""
    body = bodies.painted[b]
    along = bodies.along[k] + share * (bodies.along[k + 1] - bodies.along[k])
    around = body.radius * wp.float64(wp.atan2(wp.float32(x[0]), wp.float32(x[2])))
    if body.patch[2] > wp.float64(0.0):
        off = wp.vec2d(around - body.patch[0], along - body.patch[1])
        inside = wp.float64(1.0) - wp.dot(off, off) / (body.patch[2] * body.patch[2])
        if inside > wp.float64(0.0):
            slip = bodies.placed[q, b].slip
            around = around - inside * inside * slip[0]
            along = along - inside * inside * slip[1]
    return texel(bodies.texels, body, around, along)


@wp.func
def outward(bodies: Bodies, q: wp.int32, x: wp.vec3d, d: wp.vec3d, k: wp.int32, share: wp.float64):
    """Outward normal of any length at a point of a body in its frame: (x/r, -dr/dy, z/r), or along the
    axis."""
    node = bodies.nodes[q, k]
    after = bodies.nodes[q, k + 1]
    normal = wp.vec3d(wp.float64(0.0), wp.float64(1.0), wp.float64(0.0))
    if wp.abs(after[0] - node[0]) > FLAT:
        g = node[2] + share * (after[2] - node[2])
        rho = wp.max(wp.sqrt(x[0] * x[0] + x[2] * x[2]), FLAT)
        normal = wp.vec3d(x[0] / rho, -g, x[2] / rho)
    elif d[1] > wp.float64(0.0):
        normal = -normal
    return normal


@wp.func
def lit(view: View, shine: wp.float32, paint: wp.float32, n: wp.vec3d, toward: wp.vec3d):
    """Light from a point: diffuse (Lambert) with a highlight (Blinn and Phong)."""
    normal = wp.normalize(wp.vec3f(wp.float32(n[0]), wp.float32(n[1]), wp.float32(n[2])))
    facing = wp.max(wp.dot(normal, view.lamp), wp.float32(0.0))
    light = paint * (view.ambient + (wp.float32(1.0) - view.ambient) * facing)
    if shine > wp.float32(0.0):
        eye = wp.normalize(wp.vec3f(wp.float32(toward[0]), wp.float32(toward[1]), wp.float32(toward[2])))
        between = wp.normalize(eye + view.lamp)
        light = light + shine * wp.pow(wp.max(wp.dot(normal, between), wp.float32(0.0)), view.gloss)
    return light


@wp.func
def bodies_ray(
    view: View,
    bodies: Bodies,
    begin: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.float32),
    f: wp.int32,
    row: wp.int32,
    column: wp.int32,
):
    """Light along a ray, averaged over the instants of the exposure, and the depth at the last instant. 0: no
    body."""
    d = direction(view, f, row, column)
    light = wp.float32(0.0)
    away = wp.float32(0.0)
    for q in range(begin[f], begin[f + 1]):
        nearest = FAR
        brightness = view.background
        for b in range(bodies.painted.shape[0]):
            e = wp.mul(bodies.placed[q, b].turn, d)
            o = bodies.placed[q, b].eye
            s0 = -(o[0] * e[0] + o[2] * e[2]) / (e[0] * e[0] + e[2] * e[2])
            p = o + s0 * e
            s, share, k = on_body(bodies, q, b, p, e)
            if k >= 0 and s + s0 < nearest:
                nearest = s + s0
                x = p + s * e
                paint = reflectance(bodies, q, b, x, k, share)
                normal = wp.mul(wp.transpose(bodies.placed[q, b].turn), outward(bodies, q, x, e, k, share))
                brightness = lit(view, bodies.painted[b].shine, paint, normal, -d)
        light = light + weight[q] * brightness
        away = wp.float32(0.0)
        if nearest < FAR:
            away = wp.float32(nearest)
    return light, away


@wp.func
def store(
    view: View,
    index: wp.int32,
    row: wp.int32,
    column: wp.int32,
    light: wp.float32,
    away: wp.float32,
    grey: wp.array3d(dtype=wp.float32),
    depth: wp.array3d(dtype=wp.float32),
):
    """Write a ray's light, and the depth of the ray in the middle of a pixel."""
    grey[index, row, column] = light
    if row % view.fine == view.fine // 2 and column % view.fine == view.fine // 2:
        depth[index, row // view.fine, column // view.fine] = away


@wp.kernel(enable_backward=False)
def cast_bodies(
    view: View,
    bodies: Bodies,
    begin: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.float32),
    frame: wp.int32,
    run: wp.int32,
    grey: wp.array3d(dtype=wp.float32),
    depth: wp.array3d(dtype=wp.float32),
):
    """Rays of bodies: one per thread on a GPU, a row of rays per thread on a CPU."""
    index, row, column = wp.tid()
    for c in range(column, column + run):
        light, away = bodies_ray(view, bodies, begin, weight, frame + index, row, c)
        store(view, index, row, c, light, away, grey, depth)


@wp.func
def board_ray(view: View, bodies: Bodies, f: wp.int32, row: wp.int32, column: wp.int32):
    """Light along a ray on the flat board z = 0 of body 0's frame, and the depth. Outside the board it is the
    background."""
    d = direction(view, f, row, column)
    e = wp.mul(bodies.placed[f, 0].turn, d)
    o = bodies.placed[f, 0].eye
    s = -o[2] / e[2]
    x = o[0] + s * e[0]
    y = o[1] + s * e[1]
    body = bodies.painted[0]
    wide = wp.float64(body.columns - 1) * body.pitch
    high = wp.float64(body.rows - 1) * body.pitch
    origin = body.origin
    light = view.background
    away = wp.float32(0.0)
    inside = x >= origin[0] and x <= origin[0] + wide and y >= origin[1] and y <= origin[1] + high
    if s > wp.float64(0.0) and inside:
        light = texel(bodies.texels, body, x, y)
        away = wp.float32(s)
    return light, away


@wp.kernel(enable_backward=False)
def cast_board(
    view: View,
    bodies: Bodies,
    frame: wp.int32,
    run: wp.int32,
    grey: wp.array3d(dtype=wp.float32),
    depth: wp.array3d(dtype=wp.float32),
):
    """Rays of a board: one per thread on a GPU, a row of rays per thread on a CPU."""
    index, row, column = wp.tid()
    for c in range(column, column + run):
        light, away = board_ray(view, bodies, frame + index, row, c)
        store(view, index, row, c, light, away, grey, depth)


@wp.func
def level_of(
    view: View, table: wp.array2d(dtype=wp.float32), sharpest: wp.float32, step: wp.float32, away: wp.float32
):
    """Row of the table for a point at a depth: integer and fractional part."""
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
    """Weighted sums of rays along the rows: the integral of the blurred light over a pixel's width.

    `table` contains the weights of a pixel's rays along one axis for lenses of the standard deviations
    `sharpest`, `sharpest + step`, ... [px]. Out of focus the circle of confusion has the diameter coc
    |1/focus - 1/depth|. It adds a sixteenth of the square of this diameter to the variance.
    """
    index, row, column = wp.tid()
    for c in range(column, column + run):
        level, part = level_of(view, table, sharpest, step, depth[index, row // view.fine, c + view.pad])
        above = wp.min(level + 1, table.shape[0] - 1)
        light = wp.float32(0.0)
        for i in range(table.shape[1]):
            w = table[level, i] + part * (table[above, i] - table[level, i])
            light = light + w * grey[index, row, c * view.fine + i]
        lines[index, row, c] = light


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
    index, row, column = wp.tid()
    for c in range(column, column + run):
        level, part = level_of(view, table, sharpest, step, depth[index, row + view.pad, c + view.pad])
        above = wp.min(level + 1, table.shape[0] - 1)
        light = wp.float32(0.0)
        for j in range(table.shape[1]):
            w = table[level, j] + part * (table[above, j] - table[level, j])
            light = light + w * lines[index, row * view.fine + j, c]
        picture[index, row, c] = light

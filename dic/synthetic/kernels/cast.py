"""Kernels of the rays: grey values and depths on bodies and on a board."""

import warp as wp

from dic.synthetic.kernels.hit import FAR, FLAT, Bodies, Painted, on_body


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
    moved = (one - b) * ((one - a) * view.haze[f, j, i] + a * view.haze[f, j, i + 1]) + b * (
        (one - a) * view.haze[f, j + 1, i] + a * view.haze[f, j + 1, i + 1]
    )
    return wp.vec2d(wp.float64(moved[0]), wp.float64(moved[1]))


@wp.func
def direction(view: View, f: wp.int32, row: wp.int32, column: wp.int32):
    """Direction of a ray in the scene's frame, of length 1 along the view; the lens undone.

    `View.rays` holds the ideal points of whole pixels; between them the lens bends by 1e-6 px at most.
    """
    fine = wp.float64(view.fine)
    half = wp.float64(0.5)
    x = (wp.float64(column) + half) / fine - half
    y = (wp.float64(row) + half) / fine - half
    if view.haze.shape[0] > 0:
        moved = haze_at(view, f, x, y)
        x = x + moved[0]
        y = y + moved[1]
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
    """Reflectance of a body's paint, bilinear between its texels; beyond them that of the nearest."""
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
    """Reflectance at a place of body b in its own frame; loose paint is read where it came from."""
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
    """Normal of any length at a place of a body in its own frame: (x/r, -dr/dy, z/r), or along the axis."""
    here = bodies.nodes[q, k]
    after = bodies.nodes[q, k + 1]
    normal = wp.vec3d(wp.float64(0.0), wp.float64(1.0), wp.float64(0.0))
    if wp.abs(after[0] - here[0]) > FLAT:
        g = here[2] + share * (after[2] - here[2])
        rho = wp.max(wp.sqrt(x[0] * x[0] + x[2] * x[2]), FLAT)
        normal = wp.vec3d(x[0] / rho, -g, x[2] / rho)
    elif d[1] > wp.float64(0.0):
        normal = -normal
    return normal


@wp.func
def lit(view: View, shine: wp.float32, paint: wp.float32, n: wp.vec3d, toward: wp.vec3d):
    """Light from a place: diffuse by Lambert, with a highlight by Blinn and Phong."""
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
    """Light along a ray, a mean over the instants of the exposure, and the depth at the last; 0: none."""
    d = direction(view, f, row, column)
    light = wp.float32(0.0)
    away = wp.float32(0.0)
    for q in range(begin[f], begin[f + 1]):
        nearest = FAR
        seen = view.background
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
                seen = lit(view, bodies.painted[b].shine, paint, normal, -d)
        light = light + weight[q] * seen
        away = wp.float32(0.0)
        if nearest < FAR:
            away = wp.float32(nearest)
    return light, away


@wp.func
def store(
    view: View,
    here: wp.int32,
    row: wp.int32,
    column: wp.int32,
    light: wp.float32,
    away: wp.float32,
    grey: wp.array3d(dtype=wp.float32),
    depth: wp.array3d(dtype=wp.float32),
):
    """Write a ray's light, and the depth of the ray in the middle of a pixel."""
    grey[here, row, column] = light
    if row % view.fine == view.fine // 2 and column % view.fine == view.fine // 2:
        depth[here, row // view.fine, column // view.fine] = away


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
    """Rays of bodies: one a thread on a GPU, a row of them on a CPU."""
    here, row, column = wp.tid()
    for c in range(column, column + run):
        light, away = bodies_ray(view, bodies, begin, weight, frame + here, row, c)
        store(view, here, row, c, light, away, grey, depth)


@wp.func
def board_ray(view: View, bodies: Bodies, f: wp.int32, row: wp.int32, column: wp.int32):
    """Light along a ray on a flat board z = 0 of body 0's frame, and the depth; beside it the background."""
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
    """Rays of a board: one a thread on a GPU, a row of them on a CPU."""
    here, row, column = wp.tid()
    for c in range(column, column + run):
        light, away = board_ray(view, bodies, frame + here, row, c)
        store(view, here, row, c, light, away, grey, depth)

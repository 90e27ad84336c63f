"""First place where a ray meets a body of revolution whose generator is a polyline.

Lengths and places are float64: a camera is sixty radii away, and the square root in the cut of a ray with
a cone
would leave half a micrometre of float32.
"""

import warp as wp

FAR = wp.constant(wp.float64(1.0e9))
"""Distance of a ray that meets nothing."""
FLAT = wp.constant(wp.float64(1.0e-12))
"""A segment of less height [m] is a disc across the axis."""
EDGE = wp.constant(wp.float64(1.0e-10))
"""Overlap of neighbouring segments [m], so that no ray slips through between them."""


@wp.struct
class Placed:
    """A body at one instant: rotation into its frame, the camera's centre there, its size, its slip."""

    turn: wp.mat33d
    eye: wp.vec3d
    widest: wp.float64
    low: wp.float64
    high: wp.float64
    slip: wp.vec2d


@wp.struct
class Painted:
    """What does not change of a body: its nodes among those of all, and its paint."""

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
    """Bodies of revolution at all instants; functions take it by value, so its arrays are few."""

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
    """Nearest place s >= least of the ray p + s d on a segment, and the share of the segment's length."""
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
    """First place s of the ray p + s d on body b at instant q, with segment (-1: none) and share of it.

    `p` is the ray's place closest to the axis, so that the body lies between -half and half. What is seen
    lies nearly always on the near half; only the segments at the heights that a half passes are cut.
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

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
class Bodies:
    """Bodies of revolution at all instants; the nodes of all bodies stand side by side."""

    y: wp.array2d(dtype=wp.float64)
    r: wp.array2d(dtype=wp.float64)
    slope: wp.array2d(dtype=wp.float64)
    along: wp.array(dtype=wp.float64)
    first: wp.array(dtype=wp.int32)
    count: wp.array(dtype=wp.int32)
    span: wp.array2d(dtype=wp.vec2d)
    bins: wp.array3d(dtype=wp.vec2i)
    widest: wp.array2d(dtype=wp.float64)
    turn: wp.array2d(dtype=wp.mat33d)
    place: wp.array2d(dtype=wp.vec3d)
    radius: wp.array(dtype=wp.float64)
    texels: wp.array(dtype=wp.float32)
    texel_first: wp.array(dtype=wp.int64)
    texel_shape: wp.array(dtype=wp.vec2i)
    texel_pitch: wp.array(dtype=wp.float64)
    texel_origin: wp.array(dtype=wp.vec2d)
    slip: wp.array2d(dtype=wp.vec2d)
    patch: wp.array(dtype=wp.vec3d)
    shine: wp.array(dtype=wp.float32)


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
def among(
    bodies: Bodies,
    q: wp.int32,
    b: wp.int32,
    p: wp.vec3d,
    d: wp.vec3d,
    least: wp.float64,
    most: wp.float64,
):
    """First place s in [least, most] of the ray on body b, among the segments at the heights it passes."""
    best = FAR
    share = wp.float64(0.0)
    segment = wp.int32(-1)
    span = bodies.span[q, b]
    y0 = p[1] + least * d[1]
    y1 = p[1] + most * d[1]
    low = wp.min(y0, y1) - EDGE
    high = wp.max(y0, y1) + EDGE
    if high >= span[0] and low <= span[1]:
        n = bodies.bins.shape[2]
        scale = wp.float64(n) / wp.max(span[1] - span[0], FLAT)
        first = wp.clamp(wp.int32(wp.floor((low - span[0]) * scale)), 0, n - 1)
        last = wp.clamp(wp.int32(wp.floor((high - span[0]) * scale)), 0, n - 1)
        k0 = bodies.bins[q, b, first][0]
        k1 = bodies.bins[q, b, first][1]
        for bin in range(first + 1, last + 1):
            k0 = wp.min(k0, bodies.bins[q, b, bin][0])
            k1 = wp.max(k1, bodies.bins[q, b, bin][1])
        for k in range(k0, k1 + 1):
            s, t = on_segment(
                p, d, least, bodies.y[q, k], bodies.r[q, k], bodies.y[q, k + 1], bodies.r[q, k + 1]
            )
            if s <= most and s < best:
                best = s
                share = t
                segment = k
    return best, share, segment


@wp.func
def on_body(bodies: Bodies, q: wp.int32, b: wp.int32, p: wp.vec3d, d: wp.vec3d):
    """First place s of the ray p + s d on body b at instant q, with segment (-1: none) and share of it.

    `p` is the ray's place closest to the axis, so that the body lies between -half and half: what is seen
    lies
    nearly always on the near half.
    """
    best = FAR
    share = wp.float64(0.0)
    segment = wp.int32(-1)
    across = d[0] * d[0] + d[2] * d[2]
    room = bodies.widest[q, b] * bodies.widest[q, b] - p[0] * p[0] - p[2] * p[2]
    if room > wp.float64(0.0):
        half = wp.sqrt(room / across) + EDGE
        best, share, segment = among(bodies, q, b, p, d, -half, EDGE)
        if segment < 0:
            best, share, segment = among(bodies, q, b, p, d, wp.float64(0.0), half)
    return best, share, segment

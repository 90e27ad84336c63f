"""The cut through the simulated specimen at a time, as SVG: quick enough to follow a slider."""

from __future__ import annotations

from html import escape

from matplotlib import colormaps

from kolsky.report.scene.scene_data import FIELDS, Scene

WIDTH, HEIGHT = 480, 300
"""Of the drawing [px]."""
INK = "#1a1a1a"


def cut_svg(scene: Scene, k: int) -> str:
    """The cut through the specimen at a time, coloured by its field, with the measured outline as dots."""
    nodes, values = 1e3 * scene.nodes[k], scene.values[k]
    low, high = scene.limits
    kind = FIELDS[scene.field]
    shade = colormaps[kind.colours]
    widest, tallest = 1e3 * scene.nodes[..., 0].max(), 1e3 * scene.nodes[..., 1].max()
    scale = min((WIDTH - 20) / (2.3 * widest), (HEIGHT - 78) / (1.16 * tallest))
    middle, floor = WIDTH / 2, HEIGHT - 58

    def at(r: float, y: float) -> str:
        return f"{middle + scale * r:.1f},{floor - scale * y:.1f}"

    parts = []
    for quad in scene.mesh.quads:
        share = (float(values[quad].mean()) - low) / (high - low)
        colour = _hex(shade(min(max(share, 0.0), 1.0), bytes=True))
        for side in (1.0, -1.0):
            corners = " ".join(at(side * r, y) for r, y in nodes[quad])
            parts.append(f'<polygon points="{corners}" fill="{colour}" stroke="{colour}" stroke-width=".6"/>')
    top, half = nodes[:, 1].max(), 1.15 * widest
    for y, thick in ((0.0, -0.05), (top, 0.05)):
        corners = " ".join(
            at(r, h)
            for r, h in ((-half, y), (half, y), (half, y + thick * tallest), (-half, y + thick * tallest))
        )
        parts.append(f'<polygon points="{corners}" fill="#8a8a8a"/>')
    y, Z = scene.outline_at(k)
    for one, radius in zip(1e3 * y, 1e3 * Z, strict=True):
        x, height = at(radius, one).split(",")
        parts.append(f'<circle cx="{x}" cy="{height}" r="2.2" fill="#fff" stroke="{INK}"/>')
    bar = "".join(
        f'<rect x="{WIDTH / 2 - 100 + 4 * i}" y="{HEIGHT - 34}" width="4.3" height="9" '
        f'fill="{_hex(shade(i / 49.0, bytes=True))}"/>'
        for i in range(50)
    )
    text = f'font-size="12" fill="{INK}" text-anchor="middle"'
    ends = (
        f'<text x="{WIDTH / 2 - 100}" y="{HEIGHT - 12}" {text}>{low:.3g}</text>'
        f'<text x="{WIDTH / 2 + 100}" y="{HEIGHT - 12}" {text}>{high:.3g}</text>'
        f'<text x="{WIDTH / 2}" y="{HEIGHT - 12}" {text}>{escape(kind.label)}</text>'
    )
    words = f"Cut through the specimen, coloured by: {kind.label}; dots: measured outline"
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="100%" role="img" aria-label="{escape(words)}">'
        + "".join(parts) + bar + ends + "</svg>"
    )  # fmt: skip


def _hex(colour: tuple[float, ...]) -> str:
    return "#" + "".join(f"{int(part):02x}" for part in colour[:3])

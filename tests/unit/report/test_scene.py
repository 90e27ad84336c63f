"""Pictures and films of the deforming specimen, and the error message without a renderer."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kolsky_command import run_kolsky
from synthetic import synthetic
from typer.testing import CliRunner

import explicit
from explicit.materials.laws.marlow import neo_hookean
from explicit.materials.volumetric import VolumetricLaw
from kolsky.cli import app
from kolsky.inverse.result import Identification
from kolsky.report.canvas import build
from kolsky.report.figures import REGISTRY
from kolsky.report.scene import drawing
from kolsky.report.scene.drawing import CannotRender, evenly_spaced, picture, render, write_film, write_stills
from kolsky.report.scene.scene_data import (
    FIELDS,
    SceneDataMissing,
    Solid,
    Surface,
    has_scene,
    lifted,
    platens,
    scene_of,
    simulated,
    smallest_stretch,
)

SOLID = Solid(neo_hookean(1e5), VolumetricLaw(1e7), 1.1)
rendering = pytest.mark.skipif(not drawing.renders(), reason="VTK has nothing to draw with here")


def result(scale: tuple[float, float] = (1.0, 1.0)) -> Identification:
    """The synthetic answer with a mesh of its own size, uniformly stretched in its later pictures."""
    found = synthetic()
    size = found.provenance["specimen"]
    mesh = explicit.cylinder(
        0.5 * size["diameter"], size["length"], n_radial=found.refined_mesh[0],
        n_axial=found.refined_mesh[1], grading=2.0,
    )  # fmt: skip
    nodes = np.repeat(mesh.nodes[None], len(found.response.surface_times), axis=0)
    nodes[len(nodes) // 2 :] *= scale
    settings = {"numerics": {"grading": 2.0}}
    return replace(
        found,
        response=replace(found.response, nodes=nodes[None]),
        provenance={**found.provenance, "settings": settings},
    )


def test_the_smallest_stretch_of_a_uniform_compression() -> None:
    scene = scene_of(result((1.25, 0.64)))
    np.testing.assert_allclose(scene.values[-1], 0.64, rtol=1e-12)  # round-off
    np.testing.assert_allclose(scene.values[0], 1.0, rtol=1e-12)


def test_pressure_stress_and_energy_of_a_uniform_compression() -> None:
    # J = 0.9^2 * 1.2 and, for a neo-Hookean solid, W = mu/2 (I1_bar - 3) + K/2 (J - 1)^2, by hand; two of
    # three principal stresses are equal, so that von Mises is their difference from the third.
    J = 0.9**2 * 1.2
    invariant = J ** (-2 / 3) * (2 * 0.9**2 + 1.2**2)
    expected = {
        "pressure": -1.1 * 1e7 * (J - 1.0) / 1e6,
        "stress": 1.1 * 1e5 * J ** (-5 / 3) * (1.2**2 - 0.9**2) / 1e6,
        "energy": 1.1 * (0.5e5 * (invariant - 3.0) + 0.5e7 * (J - 1.0) ** 2) / 1e6,
    }
    for field, value in expected.items():
        scene = scene_of(result((0.9, 1.2)), field=field, solid=SOLID)
        # The law is a table of 129 knots; neo-Hookean in it is exact to round-off of its energy's sum.
        np.testing.assert_allclose(scene.values[-1], value, rtol=1e-6)


def test_chosen_pictures_are_those_of_the_whole_scene_and_have_its_colours() -> None:
    whole = scene_of(result((1.25, 0.64)))
    n = len(whole.times)
    assert n > 3
    some = scene_of(result((1.25, 0.64)), chosen=lambda count: [1, count - 1])
    np.testing.assert_array_equal(some.times, whole.times[[1, n - 1]])
    np.testing.assert_array_equal(some.nodes, whole.nodes[[1, n - 1]])
    np.testing.assert_array_equal(some.values, whole.values[[1, n - 1]])
    assert some.limits == whole.limits
    assert whole.limits[0] < 1.0


def test_measured_points_are_those_of_the_nearest_frame() -> None:
    found = result()
    scene = scene_of(found)
    line = found.comparison.centre_line
    time = np.unique(line.time)[2]
    k = int(np.argmin(np.abs(scene.times - time)))
    near = np.unique(line.time)[np.argmin(np.abs(np.unique(line.time) - scene.times[k]))]
    y, Z = scene.outline_at(k)
    assert sorted(Z) == sorted(line.Z[line.time == near])
    assert np.all(np.diff(y) >= 0.0)
    np.testing.assert_array_equal(scene.points_at(k), np.column_stack([np.zeros(y.size), y, Z]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: replace(r, response=replace(r.response, nodes=None)), "kept no nodes"),
        (lambda r: replace(r, provenance={}), "does not hold the size"),
        (lambda r: replace(r, refined_mesh=(3, 4)), "nodes, its mesh has 20"),
        (
            lambda r: replace(r, response=replace(r.response, nodes=np.full_like(r.response.nodes, np.nan))),
            "reached none of its times",
        ),
    ],
)
def test_results_that_cannot_be_shown(change: Any, words: str) -> None:
    assert has_scene(result())
    assert not has_scene(change(result()))
    with pytest.raises(SceneDataMissing, match=words):
        scene_of(change(result()))


def test_unknown_fields_and_fields_without_their_material() -> None:
    said = "there is no field 'heat'; choose from stretch, pressure, stress, energy"
    with pytest.raises(ValueError, match=said):
        scene_of(result(), field="heat")
    with pytest.raises(ValueError, match="needs the material"):
        scene_of(result(), field="pressure")


@rendering
def test_the_picture_shows_the_colour_of_the_value() -> None:
    # Uniform fields: the cut is of one colour. The two ends of the scale must not look alike.
    scene = scene_of(result((1.25, 0.64)))
    pyvista = drawing.offscreen_pyvista()
    last = render(pyvista, scene, len(scene.times) - 1, bar=False)
    first = render(pyvista, scene, 0, bar=False)
    assert last.shape == (560, 1008, 3)

    def coloured(image: Any) -> float:
        """Mean of red over blue where an image is neither white nor grey."""
        pixels = image.reshape(-1, 3).astype(int)
        vivid = pixels[np.ptp(pixels, axis=1) > 40]
        assert len(vivid) > 2000  # the specimen fills a good part of the picture
        return float(np.mean(vivid[:, 0] > vivid[:, 2]))

    assert coloured(first) > 0.9  # viridis: yellow at 1
    assert coloured(last) < 0.5  # violet at the least stretch; the points are red
    with pytest.raises(IndexError, match="there are pictures 0 to"):
        picture(scene, len(scene.times))


@rendering
def test_stills_and_films(tmp_path: Path) -> None:
    scene = scene_of(result((1.25, 0.64)))
    assert len(write_stills(tmp_path, scene, 2)) == 2
    pytest.importorskip("imageio")
    pytest.importorskip("imageio_ffmpeg")
    every = max(1, len(scene.times) // 2)
    film = write_film(tmp_path / "a.mp4", scene, every=every)
    assert film.read_bytes()[4:8] == b"ftyp"
    assert write_film(tmp_path / "a.gif", scene, every=every).read_bytes()[:3] == b"GIF"
    with pytest.raises(ValueError, match="format 'avi' is not one of mp4, gif"):
        write_film(tmp_path / "a.avi", scene)
    assert sorted(p.suffix for p in tmp_path.iterdir()) == [".gif", ".mp4", ".png", ".png"]


def test_the_figure_of_the_report() -> None:
    kind = REGISTRY["scene"]
    assert kind.applies(result())
    assert not kind.applies(synthetic())  # its provenance does not say how its mesh was graded


def test_a_machine_that_cannot_render(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawing, "renders", lambda: False)
    with pytest.raises(CannotRender, match="neither a display nor EGL nor OSMesa"):
        picture(scene_of(result()), 0)


def test_chosen_pictures() -> None:
    assert evenly_spaced(173, 3) == [0, 86, 172]
    assert evenly_spaced(2, 6) == [0, 1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--field", "heat"], "it must be stretch, pressure, stress or energy"),
        (["--format", "avi"], "it must be mp4, gif, png or vtu"),
        ([], "identification.h5"),
    ],
)
def test_what_the_command_refuses(options: list[str], words: str, tmp_path: Path) -> None:
    shot = Path(__file__).parents[3] / "runs" / "open-01"
    done = run_kolsky("film", shot, "--out", tmp_path, *options, code=2)
    assert words in done.output


def test_every_field_has_a_label_with_its_unit() -> None:
    for kind in FIELDS.values():
        assert kind.label.endswith(")")
    assert json.dumps(list(FIELDS)) == '["stretch", "pressure", "stress", "energy"]'


@rendering
def test_the_report_shows_three_pictures_on_one_scale() -> None:
    kind = REGISTRY["scene"]
    drawn = build(kind, result((1.25, 0.64)))
    shown = [ax for ax in drawn.axes if ax.images]
    assert len(shown) == 3
    first, *_, last = (np.asarray(ax.images[0].get_array()).astype(int) for ax in shown)
    assert first.shape == last.shape
    # Uniform fields: yellow at 1, violet at the least stretch; the shorter specimen leaves the top white.
    for pixels, share in ((first, 1.0), (last, 0.0)):
        vivid = pixels[np.ptp(pixels, axis=2) > 40]
        assert len(vivid) > 2000  # the specimen fills a good part of the picture
        assert np.mean(vivid[:, 0] > vivid[:, 2]) == pytest.approx(share, abs=0.5)  # most of it
    assert (last[0] == 255).all() > (first[0] == 255).all()


def test_the_report_says_why_nothing_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawing, "renders", lambda: False)
    drawn = build(REGISTRY["scene"], result())
    assert "is not drawn: VTK finds neither a display nor EGL" in str(drawn.get_label())
    assert not any(ax.images for ax in drawn.axes)


def test_surfaces_of_the_scene_have_the_areas_of_their_solids() -> None:
    # A cylinder of radius R and height H: half its skin is pi R H + pi R^2, the cut 2 R H.
    scene = scene_of(result())
    R, H = scene.nodes[0, :, 0].max(), scene.nodes[0, :, 1].max()

    def area(surface: Surface) -> float:
        corner = surface.points[surface.faces]
        return float(
            0.5
            * np.linalg.norm(np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]), axis=1).sum()
        )

    body = simulated(scene, 0)
    # 60 chords of half a circle: shorter by (pi / 60)^2 / 24 = 1.1e-4
    assert area(body) == pytest.approx(np.pi * R * H + np.pi * R**2 + 2.0 * R * H, rel=5e-4)
    assert body.values is not None
    assert len(body.values) == len(body.points)
    lower, upper = platens(R, H)
    assert upper.points[:, 1].min() == pytest.approx(H)
    assert lower.points[:, 1].max() == pytest.approx(0.0)
    moved = lifted(np.array([[3.0, 7.0, 4.0], [0.0, 1.0, 0.0]]), 0.5)
    np.testing.assert_allclose(moved, [[3.3, 7.0, 4.4], [0.0, 1.0, 0.0]])


def test_a_command_without_pyvista_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    shot = Path(__file__).parents[3] / "runs" / "open-01"
    done = run_kolsky("film", shot, "--out", tmp_path, code=2)
    assert "pip install 'pyvista'" in done.output
    done = CliRunner().invoke(app, ["film", str(shot), "--format", "vtu", "--out", str(tmp_path), "--json"])
    assert "identification.h5" in done.output  # what it needs, and not PyVista


def test_the_smallest_stretch_is_the_smallest_singular_value() -> None:
    rng = np.random.default_rng(5)
    F = np.zeros((50, 3, 3))
    F[:, :2, :2] = np.eye(2) + 0.4 * rng.standard_normal((50, 2, 2))
    F[:, 2, 2] = rng.uniform(0.3, 1.8, 50)
    expected = np.linalg.svd(F, compute_uv=False)[:, -1]
    # A difference of squares: the root of round-off where the plane is nearly flattened.
    np.testing.assert_allclose(smallest_stretch(F), expected, atol=1e-7)

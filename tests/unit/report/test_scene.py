"""Pictures and films of the deforming specimen."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kolsky_command import run_kolsky
from matplotlib import colormaps
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from synthetic import synthetic

import explicit
from explicit.materials.laws.marlow import neo_hookean
from explicit.materials.volumetric import VolumetricLaw
from kolsky.inverse.result import Identification
from kolsky.report.canvas import build
from kolsky.report.figures import REGISTRY
from kolsky.report.scene.drawing import draw_cut, evenly_spaced, picture, write_film, write_stills
from kolsky.report.scene.scene_data import (
    FIELDS,
    SceneDataMissing,
    Solid,
    has_scene,
    scene_of,
    smallest_stretch,
)

SOLID = Solid(neo_hookean(1e5), VolumetricLaw(1e7), 1.1)


def result(scale: tuple[float, float] = (1.0, 1.0)) -> Identification:
    """The synthetic answer with a mesh of its own size, uniformly stretched in its later pictures."""
    found = synthetic()
    size = found.provenance["specimen"]
    mesh = explicit.cylinder(
        0.5 * size["diameter"], size["length"], n_radial=found.refined_mesh[0],
        n_axial=found.refined_mesh[1], grading=5.0,
    )  # fmt: skip
    nodes = np.repeat(mesh.nodes[None], len(found.response.surface_times), axis=0)
    nodes[len(nodes) // 2 :] *= scale
    return replace(
        found,
        response=replace(found.response, nodes=nodes[None]),
        provenance={**found.provenance, "refined_grading": 5.0},
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


def test_the_picture_shows_the_colour_of_the_value() -> None:
    # Uniform fields: the cut is of one colour, at the end of the scale; half of the height is above it.
    scene = scene_of(result((1.25, 0.64)))
    for k, share in ((0, 1.0), (len(scene.times) - 1, 0.0)):
        image = picture(scene, k)
        assert image.shape == picture(scene, k, axes=False).shape == (560, 1008, 3)
        expected = (255 * np.array(colormaps["viridis"](share)[:3])).astype(int)
        alike = (np.abs(image[:, :800].astype(int) - expected) < 3).all(axis=2)
        assert alike.sum() > 20_000  # the specimen fills a good part of the picture
    with pytest.raises(IndexError, match="there are pictures 0 to"):
        picture(scene, len(scene.times))


def test_the_cut_is_drawn_on_both_sides_of_the_axis() -> None:
    scene = scene_of(result((1.25, 0.64)))
    ax = Figure().add_subplot()
    drawn = draw_cut(ax, scene, len(scene.times) - 1)
    corners = np.asarray(drawn.get_coordinates())
    r, y = np.moveaxis(1e3 * scene.nodes[-1], -1, 0)
    n = r.shape[1]
    np.testing.assert_array_equal(corners[:, n - 1 :], np.stack([r, y], axis=-1))
    np.testing.assert_array_equal(corners[:, n - 1 :: -1], np.stack([-r, y], axis=-1))
    np.testing.assert_array_equal(np.asarray(drawn.get_array())[:, : n - 1], scene.values[-1, :, ::-1])
    heights, radii = scene.outline_at(len(scene.times) - 1)
    for line, side in zip(ax.lines, (1e3, -1e3), strict=True):
        np.testing.assert_array_equal(line.get_xydata(), np.column_stack([side * radii, 1e3 * heights]))


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


def test_the_report_shows_three_pictures_on_one_scale() -> None:
    drawn = build(REGISTRY["scene"], result((1.25, 0.64)))
    first, *_, last = (ax for ax in drawn.axes if ax.get_xlabel().endswith(" ms"))
    assert first.get_xlabel() < last.get_xlabel()
    assert (first.get_xlim(), first.get_ylim()) == (last.get_xlim(), last.get_ylim())
    (one,), (other,) = ([c for c in ax.collections if isinstance(c, QuadMesh)] for ax in (first, last))
    assert one.get_clim() == other.get_clim()


def test_the_smallest_stretch_is_the_smallest_singular_value() -> None:
    rng = np.random.default_rng(5)
    F = np.zeros((50, 3, 3))
    F[:, :2, :2] = np.eye(2) + 0.4 * rng.standard_normal((50, 2, 2))
    F[:, 2, 2] = rng.uniform(0.3, 1.8, 50)
    expected = np.linalg.svd(F, compute_uv=False)[:, -1]
    # A difference of squares: the root of round-off where the plane is nearly flattened.
    np.testing.assert_allclose(smallest_stretch(F), expected, atol=1e-7)

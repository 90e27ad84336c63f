"""Reduction of a tracked body to a surface in the test frame, and of the specimen's to outline and
strains."""

from dataclasses import replace

import numpy as np

from dic.arrays import IntArray
from dic.bodies.follow import TrackedBody
from dic.chain.inspect_images import Inputs
from dic.chain.settings import ChainSettings
from dic.result import Body, Placement, SurfaceStrain
from dic.surfaces import StrainGauge, outline, referenced, strains, to_surface
from dic.surfaces.surface_history import CentrePoints


def surface_of(
    inputs: Inputs, body: TrackedBody, placement: Placement, reference: list[int]
) -> tuple[Body, IntArray]:
    """The points of a body that have a place in the reference frames; of those that have none, the outcomes
    in the material picture."""
    r = body.reconstruction
    kept = referenced(r, reference)
    surface = to_surface(r, placement.frame, inputs.t, reference=reference, points=kept)
    sigma = [np.sqrt(0.5 * np.trace(track.covariance[:, kept], axis1=2, axis2=3)) for track in body.tracks]
    return (
        Body(
            surface=surface,
            pixels=(r.pixels[0][:, kept], r.pixels[1][:, kept]),
            match_sigma=(sigma[0], sigma[1]),
            zncc=(body.tracks[0].zncc[:, kept], body.tracks[1].zncc[:, kept]),
            epipolar=r.epipolar[:, kept],
            points=body.points[kept],
            cell=body.cell[kept],
        ),
        r.outcome[body.material, ~kept],
    )


def surface_of_flyer(inputs: Inputs, flyer: TrackedBody | None, placement: Placement) -> Body | None:
    """The flyer's points, if there is one: from their places in the material picture, as most of them are not
    in view at rest."""
    if flyer is None:
        return None
    return surface_of(inputs, flyer, placement, [flyer.material])[0]


def outline_of(specimen: Body, settings: ChainSettings) -> tuple[CentrePoints, int]:
    """The outline on the centre line without rows of too large a sigma, and how many those were."""
    line = outline(
        specimen.surface,
        specimen.points,
        half_width=settings.strip_half_width,
        subset=settings.subset,
        shape=max(settings.tracking.correlation.shape, settings.stereo.shape),
    )
    if settings.largest_sigma is None:
        return line, 0
    fine = line.sigma <= settings.largest_sigma
    kept = {name: getattr(line, name)[fine] for name in ("t", "frame", "y", "Z", "sigma")}
    return replace(line, **kept), int(np.sum(~fine))


def strains_of(specimen: Body, settings: ChainSettings) -> SurfaceStrain:
    """Green-Lagrange strains of the specimen over the declared window."""
    gauge = StrainGauge(window=settings.strain_window, step=settings.step, subset=settings.subset)
    history = strains(specimen.surface, specimen.points, gauge)
    measured = history.green_lagrange
    return SurfaceStrain(
        value=measured.value, sigma=measured.sigma, outcome=history.outcome, gauge=history.gauge
    )

"""The flyer's flight among the figures of the surfaces that pictures gave."""

from kolsky.bars.flyer.flight_report import FlightOfSpecimen
from kolsky.report.figures import flight
from kolsky.report.figures.base import FigureKind, Panels
from kolsky.report.view import SurfaceView


def _shown(view: SurfaceView) -> FlightOfSpecimen:
    assert isinstance(view.flight, FlightOfSpecimen)  # `applies`
    return view.flight


def draw(view: SurfaceView, panels: Panels) -> None:
    """Draw strain and rate, the angle, the tilt."""
    flight.draw(_shown(view), panels)


KIND: FigureKind[SurfaceView] = FigureKind(
    name="flight",
    width=flight.KIND.width,
    height=lambda view: flight.KIND.height(_shown(view)),
    caption=lambda view: flight.caption(_shown(view)),
    panels=lambda view: flight.KIND.panels(_shown(view)),
    draw=draw,
    applies=lambda view: isinstance(view.flight, FlightOfSpecimen),
)

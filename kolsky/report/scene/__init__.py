"""Pictures and films of the deforming specimen between its platens, rendered without a window."""

from kolsky.report.scene.drawing import CannotRender, picture, renders
from kolsky.report.scene.fields import FIELDS, FieldKind
from kolsky.report.scene.film import FILMS, write_film, write_stills
from kolsky.report.scene.stage import NotShown, Stage, stage_of

__all__ = [
    "FIELDS",
    "FILMS",
    "CannotRender",
    "FieldKind",
    "NotShown",
    "Stage",
    "picture",
    "renders",
    "stage_of",
    "write_film",
    "write_stills",
]

"""Pictures and films of the deforming specimen between its platens, rendered without a window."""

from kolsky.report.scene.drawing import picture
from kolsky.report.scene.fields import FIELDS, FieldKind
from kolsky.report.scene.film import FILMS, write_film, write_stills
from kolsky.report.scene.stage import Stage, stage_of

__all__ = ["FIELDS", "FILMS", "FieldKind", "Stage", "picture", "stage_of", "write_film", "write_stills"]

"""Camera files whose entries lie in each other without end are refused before a parser runs out of stack."""

from pathlib import Path

import pytest

from dic.camera_files import read_rig
from dic.camera_files.opencv import DEEPEST, _depth
from dic.camera_files.source import CameraFileError

DEEP = 100_000


@pytest.mark.parametrize(
    "text",
    [
        '{"M1":' * DEEP + "1" + "}" * DEEP,
        '{"M1":' + "[" * DEEP + "]" * DEEP + "}",
        "%YAML:1.0\n---\nM1: " + "[" * DEEP,
        "%YAML:1.0\n---\nM1:\n" + "- " * DEEP + "1\n",
        "<opencv_storage>" + "<a>" * DEEP + "</a>" * DEEP + "</opencv_storage>",
    ],
)
def test_deep_nesting_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.yml"
    path.write_text(text)
    with pytest.raises(CameraFileError, match=f"more than {DEEPEST} levels deep"):
        read_rig(path)


def test_the_depth_is_counted() -> None:
    assert _depth('{"a": [1, 2], "b": {"c": [3]}}') == 3
    assert _depth("<opencv_storage><a><b>1</b></a><c>2</c></opencv_storage>") == 3
    assert _depth("a: !!opencv-matrix\n   rows: 3\n   data: [ 1., -2., -3. ]\n") == 1
    assert _depth("x:\n  - - - 1\n  - 2\n") == 3

"""What `kolsky identify` loads: libraries only where they serve."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_libraries_that_most_shots_do_not_need_are_not_loaded() -> None:
    code = (
        "import sys; from pathlib import Path; from kolsky.shot.load import load_shot; "
        "load_shot(Path('runs/open-01')); import kolsky.identification, kolsky.report.result_folder; "
        "names = ('pint', 'scipy.stats', 'scipy.signal', 'scipy.ndimage', 'dic.result', 'dic.images', "
        "'h5py', 'matplotlib'); print([name for name in names if name in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["[]"]

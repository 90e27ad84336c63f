"""A program that ends with the process that started it: `python following.py PARENT PROGRAM [WORDS]`.

It imports the standard library only, because it runs before all other imports of that program.
"""

import ctypes
import os
import runpy
import signal
import sys

_SET_SIGNAL = 1
"""PR_SET_PDEATHSIG of Linux's prctl: the signal that the system sends when the parent ends."""


def end_with(parent: int) -> None:
    """Ask the operating system to end this process when its parent ends; has an effect on Linux only.

    A thread that waits for the parent would react late while a library holds the interpreter's lock. For the
    system the parent is the thread that started this process. This thread must wait for the process.

    ``parent``: number of the process that started this one. If it has already ended, this process ends at
    once.
    """
    if sys.platform != "linux":
        return
    if ctypes.CDLL(None, use_errno=True).prctl(_SET_SIGNAL, int(signal.SIGKILL), 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl")
    if os.getppid() != parent:
        os._exit(1)


if __name__ == "__main__":
    end_with(int(sys.argv[1]))
    del sys.argv[:2]
    runpy.run_path(sys.argv[0], run_name="__main__")

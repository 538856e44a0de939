"""The main function of a batch's process: fit recordings until no more are sent."""

from __future__ import annotations

import os
import pickle
import sys


def serve() -> None:
    """Read the work, confirm it by an empty answer, then read recordings and write rows.

    The process ends with its standard input, so no worker outlives a caller that was killed.
    """
    tasks, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # What a fit prints must not reach the answers.
    os.dup2(2, 1)
    sys.path[:] = pickle.load(tasks)
    from ._rows import rows_of

    work, task = pickle.load(tasks), []
    while True:
        pickle.dump(rows_of(task, work), answers)
        answers.flush()
        try:
            task = pickle.load(tasks)
        except EOFError:
            return

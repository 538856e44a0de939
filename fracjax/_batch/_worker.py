"""What a process of its own does for a batch: fits what it is sent, until nobody sends any more."""

from __future__ import annotations

import os
import pickle
import sys


def serve() -> None:
    """Read the work, say that it was understood, then read recordings and write rows.

    It ends with its standard input: of a driver that was killed no worker stays behind.
    """
    given, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # What a fit prints is no answer.
    os.dup2(2, 1)
    sys.path[:] = pickle.load(given)
    from ._rows import row_of

    work, task = pickle.load(given), []
    while True:
        pickle.dump([row_of(job, work) for job in task], answers)
        answers.flush()
        try:
            task = pickle.load(given)
        except EOFError:
            return

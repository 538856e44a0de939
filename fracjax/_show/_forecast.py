"""How long a running computation will go on."""

from __future__ import annotations

import time


class Forecast:
    """How much of a round is done, and how long it will go on at its present rate.

    A round is what is counted at once, such as a descent from each start of a fit.  How many rounds
    follow is not known before, so that nothing is said of them.

    Attributes:
        text: such as "3 of 8, about 12 s more of this round"; empty outside of a round.
    """

    def __init__(self) -> None:
        self.text, self._began = "", time.monotonic()

    def count(self, done: int, total: int) -> None:
        """Count what is done of a round, which begins with none done.

        Args:
            done: How many are done.
            total: How many there are.
        """
        now = time.monotonic()
        if done == 0:
            self._began = now
        self.text = ""
        if 0 < done < total:
            seconds = max(1, round((now - self._began) / done * (total - done)))
            self.text = f"{done} of {total}, about {seconds} s more of this round"

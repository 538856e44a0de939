"""Results for a signal that are kept, because many recordings may have the same drive."""

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Concatenate, ParamSpec, TypeVar

import numpy as np

Given = ParamSpec("Given")
Result = TypeVar("Result")
_COUNT, _LARGEST = 160, 2**15
"""How many results of a function are kept, and of signals of how many samples, which limits
memory.  Chosen by judgement."""


def kept(
    function: Callable[Concatenate[np.ndarray, Given], Result],
) -> Callable[Concatenate[np.ndarray, Given], Result]:
    """A function of a signal (N,) whose results are kept, by the signal's content."""

    @lru_cache(maxsize=_COUNT)
    def of_content(content: bytes, *args: Given.args, **kwargs: Given.kwargs) -> Result:
        return function(np.frombuffer(content), *args, **kwargs)

    @wraps(function)
    def of_signal(signal: np.ndarray, *args: Given.args, **kwargs: Given.kwargs) -> Result:
        if signal.size > _LARGEST:
            return function(signal, *args, **kwargs)
        return of_content(signal.tobytes(), *args, **kwargs)

    return of_signal

"""The drive before the first sample."""

from __future__ import annotations

from typing import Literal, get_args

History = Literal["rest", "constant", "periodic"]
HISTORIES: tuple[History, ...] = get_args(History)

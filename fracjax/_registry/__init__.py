"""Real recordings, which are not part of the package: their origin and their local copies."""

from ._registry import RECORDINGS as RECORDINGS
from ._registry import fetch_recording as fetch_recording

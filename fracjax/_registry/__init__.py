"""Real recordings, which are no part of the package: where they are from, and where they lie."""

from ._registry import RECORDINGS as RECORDINGS
from ._registry import fetch_recording as fetch_recording

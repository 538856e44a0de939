"""What a call gives: recordings, models, and how the models are to be fitted."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from .._io import Taken
    from .._models import Model
    from .._prepare import HistoryOption
    from .._recording import Recording


class Given(NamedTuple):
    """How a call wants its recordings read, and models fitted to them."""

    columns: dict[str, Any]
    """The options of `read`."""
    history: str
    settle: str | None
    seed: int
    pair: tuple[str, str] | None = None
    """The files of a drive and of its response, which are one recording."""

    def read(self, path: str) -> Recording:
        """A recording."""
        from .._io import read

        return read(path, **self.columns)

    def taken(self, paths: Sequence[str]) -> list[Taken]:
        """Every recording that the call names, each segment of a file by itself, and how it was
        read."""
        from .._io import read_segments

        segments = [each for path in paths for each in read_segments(path, **self.columns)]
        if self.pair is not None:
            drive, response = self.pair
            segments += read_segments(drive, response=response, **self.columns)
        return segments

    def understood(
        self, paths: Sequence[str], names: Sequence[str], pauses: str | None = None
    ) -> tuple[list[Recording], list[Model]]:
        """The recordings and models that the call names, each model once; with `pauses` between
        them the recordings are one."""
        recordings = [each.recording for each in self.taken(paths)]
        if pauses is not None:
            from .._recording import joined

            recordings = [joined(recordings, pauses)]
        return recordings, models_for(list(dict.fromkeys(names)), recordings)

    def the_one(self, path: str | None) -> Recording:
        """The one recording that the call names."""
        from .._recording import InputError

        segments = self.taken([path] if path else [])
        if len(segments) > 1:
            place = path or " and ".join(self.pair or ())
            sources = ", ".join(each.recording.source for each in segments)
            raise InputError.at(
                place, "one recording", sources, f"give --segment 1 to {len(segments)}"
            )
        return segments[0].recording

    @property
    def past(self) -> HistoryOption | None:
        """The history that the call states, None where the data shall decide."""
        return None if self.history == "auto" else self.history  # type: ignore[return-value]

    def how(self, recordings: list[Recording]) -> dict[str, Any]:
        """The keywords of a fit that say the same.  Raises InputError where the settling time is
        none, or too long for one of the recordings."""
        from .._prepare import settling_samples

        if self.settle is not None:
            for recording in recordings:
                settling_samples(self.settle, recording)
        return {"history": self.past, "settling": self.settle, "seed": self.seed}


def models_for(names: Sequence[str], recordings: list[Recording]) -> list[Model]:
    """The models of these names, their effects of a size that suits the recordings."""
    from .._models import parse_model
    from .._prepare import setting_of

    setting = setting_of(recordings)
    return [parse_model(name, setting) for name in names]


def model_of_fit(path: str) -> tuple[Model, dict[str, Any]]:
    """The model in a fit.json, and the content of the file."""
    from .._fit import load_model

    return load_model(path), json.loads(Path(path).read_text(encoding="utf-8"))

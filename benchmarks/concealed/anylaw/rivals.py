"""Which effects could pass for another on a recording, to one who does not know the law."""

from __future__ import annotations

import numpy as np

from ..actuator import rms
from ..drives import Array
from ..separability import SEPARABLE, unexplained_by
from ..truth import name_of
from .effects import BESIDE, TRIED
from .oracle import LawFree
from .session import Session, possible

DRAWS = 3  # shapes of an effect that could pass for another
ENOUGH = 0.7  # share of an effect that what passes for it can reach
ALIKE = 0.5  # share of a power that what passes for it may leave


class Rivals:
    """Changes that each effect could make to a session at several shapes."""

    def __init__(self, session: Session, seed: int) -> None:
        self.session, self.rng = session.coarse, np.random.default_rng([seed, 17])
        self.draws = {
            key: [e.shape(self.rng) for _ in range(DRAWS)] for key, e in (TRIED | BESIDE).items()
        }
        self.plain, self.travelled = self.session.plain, session.dense(["degrading"])
        self.made: dict[tuple[str, float], tuple[Array, Array]] = {}

    def columns(self, key: str, size: float) -> tuple[Array, Array]:
        """Changes in um, a column per shape, brought near an rms in um; how often as large they
        can be."""
        if (key, size) not in self.made:
            self.made[key, size] = self._columns(key, size)
        return self.made[key, size]

    def _columns(self, key: str, size: float) -> tuple[Array, Array]:
        e, scene = (TRIED | BESIDE)[key], self.session.first.scene
        columns, room = [], []
        for shape in self.draws[key] if e.shape(self.rng) else self.draws[key][:1]:
            a = used = e.typical
            for _ in range(2):
                change = self.session.recorded([(e, e.parameters(a, shape, scene))]) - self.plain
                used = a
                if not change.any():
                    break
                a = float(np.clip(a * size / rms(change), 0.02 * e.typical, e.cap))
            columns.append(change)
            room.append(e.cap / used)
        return np.column_stack(columns), np.array(room)

    def apart(self, change: Array, own: str, law_free: LawFree, beside: Array | None) -> dict:
        """λ of a change from every other effect, beyond hysteresis and a second effect.

        An effect that at its largest leaves less than ENOUGH of the change does not pass for it.
        """
        aside = unit(law_free.off(beside[:, None])) if beside is not None else None

        def off(x: Array) -> Array:
            beyond = law_free.off(x)
            return beyond if aside is None else beyond - aside @ (aside.T @ beyond)

        truth = off(change[:, None])[:, 0]
        least, by_name = ENOUGH * float(np.linalg.norm(truth)), {}
        for key in TRIED | BESIDE:
            if name_of(key) != own and possible(key, self.session.first):
                changes, room = self.columns(key, rms(change))
                beyond = off(changes)
                beyond = beyond[:, room * np.linalg.norm(beyond, axis=0) > least]
                by_name.setdefault(name_of(key), []).append(beyond)
        out = {}
        for name, parts in by_name.items():
            columns = np.column_stack(parts)
            out[name] = float(truth @ truth)
            if columns.shape[1]:
                out[name] = unexplained_by(name, truth, columns)
        if own:
            u, size, _ = np.linalg.svd(off(self.travelled), full_matrices=False)
            out["degradation"] = float(truth @ truth - np.sum((u.T @ truth) ** 2 / (1 + size**-2)))
        return out


def unit(column: Array) -> Array:
    return column / (np.linalg.norm(column) + 1e-300)


def look_alikes(apart: dict[str, float], power: float) -> list[str]:
    """Effects that nobody could tell from one of a power: of what is not detectable, none."""
    if power < SEPARABLE:
        return []
    return sorted(k for k, v in apart.items() if v < min(SEPARABLE, ALIKE * power))

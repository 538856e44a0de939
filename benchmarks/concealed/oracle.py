"""What a fit that knows the effect must expect on a recording it has not seen (Cramér–Rao).

    E rms² = rms²(noise there) + tr(J_h C J_hᵀ)/n_h,    C = (J_tᵀ J_t + P⁻¹)⁻¹

J_t, J_h: derivatives of the training and of the held-out response by every number of the truth
and by an offset, J_t whitened.  It knows the base's law and the effect's, and of their numbers how
large they are: P, their own squares.
"""

from __future__ import annotations

import numpy as np

from .actuator import Actuator
from .drives import Array
from .truth import Effect, Params, whiten

MOVES = 0.1  # what a difference quotient moves the response by, in sd of the noise
UNTAUGHT = {"seed", "sign"}  # what chooses a realisation or a case is no number to learn

Pairs = list[tuple[Effect, dict]]
Place = tuple[int, str, int | None]  # of the law (-1) or an effect, its name, its place in a list


def expected_rmse(
    training: Actuator, held_out: Actuator, pairs: Pairs, noise: str, sd: float, floor: float
) -> float:
    """In um, of a refit of the very law with the very effects; `floor` is the noise's own rms."""
    before = [a.with_all(pairs) for a in (training, held_out)]
    rows: list[list[Array]] = [[], []]
    for place in numbers(training.law, pairs):
        size, share = _size(training.law, pairs, place), 1e-4
        for _ in range(2):  # the second with a step that the response answers in proportion
            moved = _moved(training, held_out, pairs, place, share * size)
            change = np.sqrt(np.mean((moved[0] - before[0]) ** 2))
            last, share = share, share * float(np.clip(MOVES * sd / (change + 1e-300), 1e-3, 1e2))
        for kept, now, then in zip(rows, moved, before, strict=True):
            kept.append((now - then) / last)
    offset = training.scene.stroke
    trained = np.column_stack([*rows[0], np.full(len(before[0]), offset)])
    told = np.column_stack([*rows[1], np.full(len(before[1]), offset)])
    known = whiten(noise, trained, sd)
    doubt = np.linalg.inv(np.eye(known.shape[1]) + known.T @ known)
    return float(np.sqrt(floor**2 + np.einsum("ni,ij,nj->", told, doubt, told) / len(told)))


def numbers(law: Params, pairs: Pairs) -> list[Place]:
    """Every number of the law and of the effects that a fit has to learn."""
    found: list[Place] = [(-1, name, None) for name in law]
    for k, (_, params) in enumerate(pairs):
        for name, value in params.items():
            if name in UNTAUGHT or value is None or isinstance(value, str | bool | int):
                continue
            places = range(len(value)) if isinstance(value, list) else [None]
            found += [(k, name, i) for i in places if _at(value, i) != 0]
    return found


def _at(value: float | list, i: int | None) -> float:
    return value if i is None else value[i]  # type: ignore[index,return-value]


def _size(law: Params, pairs: Pairs, place: Place) -> float:
    k, name, i = place
    return abs(_at(law[name] if k < 0 else pairs[k][1][name], i))


def _moved(
    training: Actuator, held_out: Actuator, pairs: Pairs, place: Place, step: float
) -> list[Array]:
    """Both responses with one number larger by a step."""
    k, name, i = place
    if k < 0:
        law = training.law | {name: training.law[name] + step}
        return [Actuator(a.name, law, a.drive).with_all(pairs) for a in (training, held_out)]
    effect, params = pairs[k]
    value = params[name]
    value = value + step if i is None else [*value[:i], value[i] + step, *value[i + 1 :]]
    changed = [*pairs[:k], (effect, params | {name: value}), *pairs[k + 1 :]]
    return [a.with_all(changed) for a in (training, held_out)]

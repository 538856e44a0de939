"""What a fit that knows the effect must expect on a recording it has not seen (Cramér–Rao).

    E rms² = rms²(noise there) + tr(J_h C J_hᵀ)/n_h,    C = (J_tᵀ J_t + P⁻¹)⁻¹

J_t, J_h: derivatives of the training and of the held-out response by every number of the truth
and by an offset, J_t whitened.  It knows the base's law and the effect's, and of their numbers how
large they are: P, their own squares.
"""

from __future__ import annotations

import numpy as np

from .actuator import OVER, Actuator, rms
from .drives import Array
from .truth import Effect, Params, simulate, whiten

MOVES = 0.1  # what a difference quotient moves the response by, in sd of the noise

Pairs = list[tuple[Effect, dict]]
Place = tuple[int, str, int | None]  # of the law (0) or an effect, its name, its place in a list


def expected_rmse(
    training: Actuator, held_out: Actuator, pairs: Pairs, noise: str, sd: float, floor: float
) -> float:
    """In um, of a refit of the very law with the very effects; `floor` is the noise's own rms."""
    effects, groups = [e for e, _ in pairs], [training.law, *(params for _, params in pairs)]

    def response(actuator: Actuator, place: Place, share: float) -> Array:
        law, *changed = _larger(groups, place, share)
        both = list(zip(effects, changed, strict=True))
        return simulate(both, actuator.drive, actuator.t, actuator.base, law)[::OVER]

    before = [actuator.with_all(pairs) for actuator in (training, held_out)]
    rows: list[list[Array]] = [[], []]
    for place in numbers(training.law, pairs):
        first = 1e-4
        change = rms(response(training, place, first) - before[0])
        share = first * float(np.clip(MOVES * sd / (change + 1e-300), 1e-3, 1e2))
        for kept, actuator, then in zip(rows, (training, held_out), before, strict=True):
            kept.append((response(actuator, place, share) - then) / share)
    offset = training.scene.stroke
    trained, told = (
        np.column_stack([*kept, np.full(len(then), offset)])
        for kept, then in zip(rows, before, strict=True)
    )
    known = whiten(noise, trained, sd)
    doubt = np.linalg.inv(np.eye(known.shape[1]) + known.T @ known)
    return float(np.sqrt(floor**2 + np.einsum("ni,ij,nj->", told, doubt, told) / len(told)))


def numbers(law: Params, pairs: Pairs) -> list[Place]:
    """Every number of the law and of the effects that a fit has to learn: whole ones are none, and
    what is nothing has no size to begin from."""
    found: list[Place] = []
    for k, group in enumerate([law, *(params for _, params in pairs)]):
        for name, value in group.items():
            if isinstance(value, list):
                found += [(k, name, i) for i, one in enumerate(value) if one != 0]
            elif isinstance(value, float) and value != 0:
                found.append((k, name, None))
    return found


def _larger(groups: list[dict], place: Place, share: float) -> list[dict]:
    """The law and the effects' parameters with one number larger by a share of its size."""
    k, name, i = place
    value = groups[k][name]
    if i is None:
        value = value + share * abs(value)
    else:
        value = [*value[:i], value[i] + share * abs(value[i]), *value[i + 1 :]]
    return [*groups[:k], groups[k] | {name: value}, *groups[k + 1 :]]

"""The loop's shape as a named effect, beside those of the catalogue."""

from __future__ import annotations

from .._blocks import EFFECTS, INSIDE, Effect

HYSTERESIS_SHAPE = Effect(
    name="hysteresis_shape",
    site="additive",
    sentence="the loop has another shape than the model's: rate-independent hysteresis that no "
    "effect of the catalogue describes with few parameters",
    equation="sum over plays of functions of their states, y = ∫ g(r, p_r) dr",
    source="Brokate & Sprekels, Hysteresis and Phase Transitions (1996), chapter 2",
    trials=lambda setting: (),
    separated_by={},
    concealed_by="the model's own loop",
    axes=("reversal", "level", "phase", "harmonics"),
)


def entry_of(name: str) -> Effect:
    """The catalogue's entry of what a diagnosis names."""
    if name in INSIDE:
        inside = INSIDE[name]
        return Effect(
            name=name,
            site="force",
            sentence=inside.sentence,
            equation=inside.equation,
            source=inside.source,
            trials=lambda setting: (),
            separated_by=dict(inside.separated_by),
            concealed_by="the linear dynamics",
            axes=("frequency", "level", "time"),
        )
    return HYSTERESIS_SHAPE if name == HYSTERESIS_SHAPE.name else EFFECTS[name]

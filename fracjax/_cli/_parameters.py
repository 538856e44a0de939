"""The parameters of a block, for the lists of models and effects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .._blocks import AbstractBlock


def free_parameters(block: AbstractBlock) -> list[dict[str, Any]]:
    """A block's free parameters as plain data: name, unit and plausible range.

    The range of a vector is the widest of its components; None where any value is plausible.
    """
    import numpy as np

    from .._naming import shown_names
    from .._parameters import named_parameters

    shown = shown_names(block)
    rows = []
    for name, parameter in named_parameters(block).items():
        if not parameter.fixed:
            low, high = (f(p) for f, p in zip((np.min, np.max), parameter.plausible, strict=True))
            plausible = [float(low), float(high)] if np.isfinite(high - low) else None
            rows.append({"name": shown[name], "unit": parameter.unit, "plausible": plausible})
    return rows

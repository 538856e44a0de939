"""The recording, validated once at the border, and the units it is written in."""

from fracjax._recording._errors import InputError, closest, found_in, item, pair_of, require_kind
from fracjax._recording._joined import joined
from fracjax._recording._kept import kept
from fracjax._recording._periods import Repeats, maxima_of, mismatch, runs_of, unit_range
from fracjax._recording._recording import (
    Recording,
    inspect_together,
    require_units,
    require_units_of,
)
from fracjax._recording._rows import in_rows, quantiles
from fracjax._recording._signals import (
    LARGEST,
    MINIMUM_SAMPLES,
    bridged,
    require_samples,
    resolution,
    spikes,
    varying,
)
from fracjax._recording._spectrum import fastest, hann, thinned
from fracjax._recording._units import PREFIXED, UNSTATED, conversion, parse_quantity, unit

__all__ = [
    "LARGEST",
    "MINIMUM_SAMPLES",
    "PREFIXED",
    "UNSTATED",
    "InputError",
    "Recording",
    "Repeats",
    "bridged",
    "closest",
    "conversion",
    "fastest",
    "found_in",
    "hann",
    "in_rows",
    "inspect_together",
    "item",
    "joined",
    "kept",
    "maxima_of",
    "mismatch",
    "pair_of",
    "parse_quantity",
    "quantiles",
    "require_kind",
    "require_samples",
    "require_units",
    "require_units_of",
    "resolution",
    "runs_of",
    "spikes",
    "thinned",
    "unit",
    "unit_range",
    "varying",
]

"""Fitting many recordings one by one: resumable, on this machine's cores or on a cluster."""

from ._batch import FITS as FITS
from ._batch import Count as Count
from ._batch import fit_batch as fit_batch
from ._batch import silent as silent
from ._overview import Spread as Spread
from ._overview import at_bounds as at_bounds
from ._overview import over_noise as over_noise
from ._overview import overview as overview
from ._overview import spreads as spreads
from ._rows import SCHEMA as SCHEMA
from ._rows import STATUSES as STATUSES

"""Every number that decides a verdict, with its meaning and the study that it comes from.

Three more stand where the posterior is: what path curves do not know (`_path`, `UNKNOWN`), the
prior odds of an effect (`EACH`), and the probability at which one is named (`SURE`).
"""

from .._path import MISFIT
from .._path import SURE as SURE

SIGNIFICANCE = 0.01
"""p-value below which a place on an axis, or the residual as a whole, is significant; by
convention."""

ADEQUATE = 1 + MISFIT
"""χ² of a recording over that of path curves up to which nothing is said to be missing: of those
that a rate-independent law made they leave .93 to 1.1."""

NUMERICS = 1.0
"""Discretisation error above which no effect is named, in noise units."""

DETECTED = 5.0
"""The |z| at which an amplitude counts as detectable: 1 % false alarms over hundreds of columns,
with a margin."""

REFUTED = 2.0
"""Ratio of the extended model's error on held-out data to the base's from which the names are
withdrawn.  Of 250 development cases one right name had more, and none a wrong one."""

BETTER = 0.9
"""Ratio of errors on held-out data below which a sum of plays stands in the model's place, and the
loop's shape is said to be another."""

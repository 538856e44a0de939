"""Every number that decides a verdict: what it means, and what it was chosen by."""

SIGNIFICANCE = 0.01
"""The p-value below which a place on an axis stands out; by convention."""

SURE = 0.9
"""The least probability that something is there before it is named."""

SHARE = 0.3
"""Where the model's loop is not the actuator's: the least share of what loop shapes and other
effects leave beyond the noise that an effect must take, in training and of stretches set aside.  On
72 development cases with inexact bases two of 30 names that were not there took more."""

SECOND = 0.05
"""Where the model's loop is the actuator's: the least share of all that there was beyond the noise
that one of several effects must take.  What an effect's own law differs from its secant took up to
.03 on 80 development cases."""

DOUBT = 0.1
"""How much of χ² per sample the noise level is never surer than, where the model's loop is not the
actuator's."""

ALIKE = 0.1
"""The share of its own fall of χ² by which an effect excludes another where no law is exact."""

APART = 25.0
"""The least fall of χ² by which one effect excludes another: five standard errors between them."""

MISFIT = 1.3
"""χ² per sample from which what no column follows counts as coloured noise."""

NUMERICS = 1.0
"""Noise units of discretisation error above which nothing is named."""

EXPLAINED = 0.9
"""The share of the mismatch that loop shapes must carry for the shape to be named."""

DETECTED = 5.0
"""The score at which an amplitude counts as detectable: 1 % over hundreds of columns."""

REFUTED = 2.0
"""How many times the base's error on a recording held out what is named may not make of it."""

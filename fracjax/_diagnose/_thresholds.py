"""Every number that decides a verdict, with its meaning and the study that it comes from."""

SIGNIFICANCE = 0.01
"""p-value below which a place on an axis, or the residual as a whole, is significant; by
convention."""

SURE = 0.95
"""The smallest probability at which an effect, or another shape of the loop, is reported; chosen by
judgement."""

SHARE = 0.25
"""If the loop has another shape than the model's: the smallest share of what loop shapes and other
effects leave that a named effect explains, in training and in half of the held-out parts.  Of what
rests on single events: the share of the other stretches' square error that it explains."""

CHANCE = 1e-3
"""The largest p-value of the test that an effect improves held-out parts by chance, if it explains
all of them; of one that explains a share s, times s²: the smaller an effect is, the more a misfit
resembles it.  Of 256 development cases, 123 of them without an effect, this gave wrong names in 7
and found 52 of 149 effects; .001 for every share 8 and 54, .0001 6 and 41."""

SECOND = 0.05
"""If the loop has the model's shape: the smallest share of the whole excess that one of several
named effects explains.  The difference between an effect and its secant explained up to 0.03 on
development cases of the first tier."""

DOUBT = 0.1
"""Relative uncertainty of χ² per sample, at least, if the loop has another shape than the model's;
chosen by judgement."""

ALIKE = 0.1
"""The share of its own reduction of χ² by which an effect must exceed another to exclude it, if the
loop has another shape than the model's; chosen by judgement."""

APART = 14.0
"""The smallest difference of χ², with Occam's factor, by which one effect excludes another: odds of
a thousand to one."""

MISFIT = 1.3
"""χ² per sample from which the misfit counts as coloured noise; chosen by judgement."""

NUMERICS = 1.0
"""Discretisation error above which no effect is named, in noise units."""

EXPLAINED = 0.9
"""The share of the excess that loop shapes must explain for the loop's shape to be named; chosen by
judgement."""

DETECTED = 5.0
"""The |z| at which an amplitude counts as detectable: 1 % false alarms over hundreds of columns,
with a margin."""

REFUTED = 2.0
"""Ratio of the extended model's error on held-out data to the base's from which the names are
withdrawn.  Of 250 development cases one right name had more, and none a wrong one; on a recording
of an elastomer three effects that are not there had 41."""

FAR = 10.0
"""The residual, over the noise, from which a loop of another shape is far from the model's, and the
other models are compared; chosen by judgement."""

"""The colours of pictures and pages."""

MEASURED = "#444444"
# Okabe & Ito's palette, which colour-blind readers can distinguish, on white and on black.
COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7")
"""Those of models, the same in all figures."""
CANDIDATES = ("#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Those of candidates, beside two models at most."""

"""The colours of models, the same in all figures."""

# Okabe & Ito's palette, which colour-blind readers can distinguish, on white and on black.
COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7")
CANDIDATES = ("#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Those of candidates, beside two models at most."""

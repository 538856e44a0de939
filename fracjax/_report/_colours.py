"""The colours of models, the same in all figures."""

# Okabe & Ito's palette, which colour-blind readers can distinguish, on white and on black.
COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7")

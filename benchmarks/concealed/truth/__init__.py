"""The truths: base laws, effects and noise, each by numerics of its own (no fracjax code)."""

from .bases import BASES as BASES, OVER as OVER, Base as Base, Params as Params
from .branches import Sliding as Sliding, play as play, rayleigh as rayleigh
from .catalogue import EFFECTS as EFFECTS, NAMES as NAMES, OUTSIDE as OUTSIDE, name_of as name_of
from .effect import (
    Effect as Effect,
    Scene as Scene,
    drive_side as drive_side,
    response_side as response_side,
    simulate as simulate,
)
from .linear import relax as relax
from .mechanics import resonance as resonance
from .noise import NOISES as NOISES, noise as noise, whiten as whiten
from .paths import Path as Path, power_derivative as power_derivative

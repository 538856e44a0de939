"""The truths: base laws, effects and noise, each by numerics of its own (no fracjax code)."""

from .bases import BASES as BASES
from .bases import OVER as OVER
from .bases import Base as Base
from .bases import Params as Params
from .branches import Sliding as Sliding
from .branches import play as play
from .branches import rayleigh as rayleigh
from .catalogue import EFFECTS as EFFECTS
from .catalogue import NAMES as NAMES
from .catalogue import OUTSIDE as OUTSIDE
from .catalogue import name_of as name_of
from .effect import (
    Effect as Effect,
)
from .effect import (
    Scene as Scene,
)
from .effect import (
    drive_side as drive_side,
)
from .effect import (
    response_side as response_side,
)
from .effect import (
    simulate as simulate,
)
from .linear import relax as relax
from .mechanics import resonance as resonance
from .noise import NOISES as NOISES
from .noise import noise as noise
from .noise import whiten as whiten
from .paths import Path as Path
from .paths import power_derivative as power_derivative

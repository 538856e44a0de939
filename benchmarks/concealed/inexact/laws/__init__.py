"""Hysteresis laws that are none of the first tier's, one file each."""

from .duhem import DUHEM
from .jiles_atherton import JILES_ATHERTON
from .law import Law as Law
from .law import Params as Params
from .law import drawn as drawn
from .law import opening as opening
from .lugre import LUGRE
from .prandtl_ishlinskii import PRANDTL_ISHLINSKII
from .preisach import HILLS, RANDOM
from .ramberg_osgood import RAMBERG_OSGOOD
from .rate_dependent_play import RATE_DEPENDENT_PLAY

LAWS: dict[str, Law] = {
    "preisach_random": RANDOM,
    "preisach_hills": HILLS,
    "prandtl_ishlinskii": PRANDTL_ISHLINSKII,
    "rate_dependent_play": RATE_DEPENDENT_PLAY,
    "jiles_atherton": JILES_ATHERTON,
    "lugre": LUGRE,
    "duhem": DUHEM,
    "ramberg_osgood": RAMBERG_OSGOOD,
}

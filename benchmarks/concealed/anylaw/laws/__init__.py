"""The third tier's laws by the memory that they have, and which model of the product has each."""

from ...inexact.laws import LAWS as INEXACT
from ...inexact.laws import Law as Law
from ...inexact.laws import drawn as drawn
from .bouc_wen import BOUC_WEN
from .degrading import DEGRADING_BOUC_WEN, DEGRADING_PLANE, DEGRADING_PLAYS
from .krasnoselskii_pokrovskii import KRASNOSELSKII_POKROVSKII
from .maxwell_slip import MAXWELL_SLIP
from .nonlinear_preisach import NONLINEAR_PREISACH

RETURNING: dict[str, Law] = {
    **{k: INEXACT[k] for k in ("preisach_random", "preisach_hills", "prandtl_ishlinskii")},
    "krasnoselskii_pokrovskii": KRASNOSELSKII_POKROVSKII,
    "maxwell_slip": MAXWELL_SLIP,
    "nonlinear_preisach": NONLINEAR_PREISACH,
    "ramberg_osgood": INEXACT["ramberg_osgood"],
}
"""Return-point memory: the response is a function of the path state."""

FADING: dict[str, Law] = {
    "duhem": INEXACT["duhem"],
    "jiles_atherton": INEXACT["jiles_atherton"],
    "bouc_wen": BOUC_WEN,
}
"""What came before fades along the path."""

DEGRADING: dict[str, Law] = {
    "degrading_plays": DEGRADING_PLAYS,
    "degrading_bouc_wen": DEGRADING_BOUC_WEN,
    "degrading_plane": DEGRADING_PLANE,
}
"""The loop changes with the path travelled; without `worn` it does not."""

LAWS = RETURNING | FADING | DEGRADING
MEMORY = (
    dict.fromkeys(RETURNING, "returning")
    | dict.fromkeys(FADING, "fading")
    | dict.fromkeys(DEGRADING, "degrading")
)

HAS = {
    "bouc_wen": ("bouc_wen", "degrading_bouc_wen"),
    "prandtl_ishlinskii": ("maxwell_slip", "ramberg_osgood", "degrading_plays"),
}
"""Laws that a model of the product has, or comes near with enough plays: it is not believed."""

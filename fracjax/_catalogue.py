"""The models of the catalogue: blocks at nominal parameters, or sized by a recording's setting."""

from __future__ import annotations

from collections.abc import Callable

import equinox as eqx
import numpy as np

from ._blocks import (
    FOH,
    LFDH,
    AbstractBlock,
    BoucWen,
    Creep,
    Filters,
    FractionalKelvinVoigt,
    FractionalMaxwell,
    FractionalZener,
    Gain,
    Impedance,
    Lag,
    Mass,
    Modes,
    Oscillator,
    PEADynamics,
    PrandtlIshlinskii,
    Setting,
    Springpot,
    StaticCurve,
)
from ._parameters import Parameter


def coupled() -> AbstractBlock:
    """FOH, then fractional creep, whose gain merges into FOH's [F §2.5]: six parameters."""
    return FOH() >> Creep(fixed_gain=True)


def coupled_model_1() -> AbstractBlock:
    """Coupled Model-1 [F §4.4]: NBW, then the creep that TFOCIM identifies.

    TFOCIM draws one straight line through the amplitude ratios, so its creep is s^-μ [F 11].
    """
    return BoucWen() >> Creep(fixed_gain=True)


def coupled_model_2() -> AbstractBlock:
    """Coupled Model-2 [F §4.4]: NBW, then the creep that OFOCIM identifies.

    OFOCIM fits creep and dynamics together, so its creep is (k_p + a s^μ)/(m s² + …) [F 20].  The
    paper does not say whether the dynamics then stay in the cascade.  Here they do, because they
    were identified together with the creep, and at the 1 Hz of the paper's Table 4 they change
    nothing.  The paper's count of six parameters suggests that only the creep stayed: that model is
    `coupled`, of order -μ.
    """
    return BoucWen() >> PEADynamics(fixed_gain=True)


def coupled_model_3() -> AbstractBlock:
    """Coupled Model-3 [F §4.4]: FOH, then the creep that OFOCIM identifies, as in Model-2."""
    return FOH() >> PEADynamics(fixed_gain=True)


ORDINARY = Setting(
    drive_low=0.0,
    drive_high=100.0,
    response_span=10.0,
    step=1e-3,
    duration=10.0,
    top_frequency=10.0,
    top_rate=1e3,
    rms_rate=500.0,
    response_low=0.0,
    resolution=1e-3,
)
"""The setting of a common piezo stack (100 V, 10 µm), by which models and effects are sized that
are named without a recording; chosen by judgement."""

_AT_ONCE = 0.7
"""The share of a typical response that follows the drive without memory; chosen by judgement."""


def prandtl_ishlinskii(setting: Setting = ORDINARY) -> AbstractBlock:
    """Prandtl–Ishlinskii plays over the setting's drive, weighted as in a typical loop.

    Source: Al Janaideh, Rakheja & Su, IEEE/ASME Trans. Mechatronics 16 (2011) 734.
    """
    shares = np.append(_AT_ONCE, np.full(12, (1 - _AT_ONCE) / 12))
    slope = setting.response_span / setting.drive_span
    return PrandtlIshlinskii(slope * shares, low=setting.drive_low, high=setting.drive_high)


def oscillator(setting: Setting = ORDINARY) -> AbstractBlock:
    """A mass on a spring, of the setting's gain, resonant in its band.

    Source: Den Hartog, Mechanical Vibrations (1956), chapter 2.
    """
    return Oscillator(_gain_of(setting), setting.top_frequency)


def mass(setting: Setting = ORDINARY) -> AbstractBlock:
    """A mass without a spring, which crosses the setting's span in its duration.

    Source: Janot, Gautier & Brunot, Nonlinear System Identification Benchmarks (2019).
    """
    rate = 2 * np.pi * setting.top_frequency
    return Mass(_gain_of(setting) * rate / setting.duration, rate)


def lag(setting: Setting = ORDINARY) -> AbstractBlock:
    """A store that drains in proportion to its level, in a tenth of the setting's duration.

    Source: Ogata, Modern Control Engineering (2010), section 4.2.
    """
    return Lag(_gain_of(setting), (setting.duration * _A_TENTH,))


def two_lags(setting: Setting = ORDINARY) -> AbstractBlock:
    """Two such stores in series.

    Source: Ogata, Modern Control Engineering (2010), section 4.2.
    """
    return Lag(_gain_of(setting), (setting.duration * _A_TENTH, setting.duration * _A_TENTH / 2))


def modes(setting: Setting = ORDINARY) -> AbstractBlock:
    """Two modes in the setting's band.

    Source: Ewins, Modal Testing (2000), section 2.4.
    """
    gain, top = _gain_of(setting), setting.top_frequency
    return Modes((0.7 * gain, 0.3 * gain), (0.4 * top, top))


def filters(setting: Setting = ORDINARY) -> AbstractBlock:
    """Two filters of third order in series, with their corners in the setting's band.

    Source: Schoukens & Ljung, IEEE Control Syst. Mag. 39 (2019) 28.
    """
    top = setting.top_frequency
    corners = (0.5 * top, 0.7 * top)
    return Filters(_gain_of(setting), corners, (0.5, 0.5), corners, (4 * top, 4 * top))


def impedance(setting: Setting = ORDINARY) -> AbstractBlock:
    """Stiffness, damper, mass and springpot side by side, position to force.

    Source: Mainardi, Fractional Calculus and Waves in Linear Viscoelasticity (2010), chapter 3.
    """
    return Impedance(_gain_of(setting))


def wiener_hammerstein(setting: Setting = ORDINARY) -> AbstractBlock:
    """A static curve between two lags: what it bends is filtered before and after.

    Source: Schoukens & Ljung, IEEE Control Syst. Mag. 39 (2019) 28.
    """
    fast = 1 / (2 * np.pi * setting.top_frequency)
    gain = Parameter(1.0, "response/drive", fixed=True)
    filters = (eqx.tree_at(lambda block: block.gain, Lag(1.0, (fast, fast)), gain) for _ in "ab")
    first, second = filters
    low, high = setting.drive_low, setting.drive_high
    curve = StaticCurve(low, high, _gain_of(setting) * np.linspace(low, high, 9))
    return first >> curve >> second


_A_TENTH = 0.1
"""A store's time constant over the recording's duration, to begin with; chosen by judgement."""


def _gain_of(setting: Setting) -> float:
    """The response's span over the drive's, in its units."""
    return setting.response_span / setting.drive_span


_DYNAMICS: dict[str, Callable[..., AbstractBlock]] = {
    "oscillator": oscillator,
    "mass": mass,
    "lag": lag,
    "two_lags": two_lags,
    "modes": modes,
    "filters": filters,
    "wiener_hammerstein": wiener_hammerstein,
}
_MATERIALS: dict[str, Callable[..., AbstractBlock]] = {
    "impedance": impedance,
    "springpot": Springpot,
    "fractional_maxwell": FractionalMaxwell,
    "fractional_kelvin_voigt": FractionalKelvinVoigt,
    "fractional_zener": FractionalZener,
}

SIZED: dict[str, Callable[..., AbstractBlock]] = {
    "prandtl_ishlinskii": prandtl_ishlinskii,
    **_DYNAMICS,
    "impedance": impedance,
}
"""The models whose blocks depend on the range of the drive, each with a function of the setting."""

GROUPS: dict[str, dict[str, Callable[..., AbstractBlock]]] = {
    "loops": {
        "foh": FOH,
        "lfdh": LFDH,
        "creep": Creep,
        "coupled": coupled,
        "bouc_wen": BoucWen,
        "prandtl_ishlinskii": prandtl_ishlinskii,
        "pea_dynamics": PEADynamics,
        "gain": Gain,
        "coupled_model_1": coupled_model_1,
        "coupled_model_2": coupled_model_2,
        "coupled_model_3": coupled_model_3,
    },
    "dynamics": _DYNAMICS,
    "materials": _MATERIALS,
}
"""The models by what they are: actuators with hysteresis, machines, materials."""

MODELS: dict[str, Callable[..., AbstractBlock]] = {
    name: make for group in GROUPS.values() for name, make in group.items()
}
"""The models by name, each with a function that makes its block at nominal parameters."""

"""Every block at values where it shows what it does, and the drive of their tests."""

import jax.numpy as jnp
import numpy as np

from fracjax._blocks import (
    FOH,
    LFDH,
    BoucWen,
    ClockSkew,
    Creep,
    Delay,
    DriveLag,
    Electrostriction,
    InverseLFDH,
    MainsInterference,
    MinorLoopMemory,
    PEADynamics,
    Resonance,
    Saturation,
    SingleOperator,
    ThermalDrift,
)
from fracjax._blocks.creep import KelvinVoigtCreep, LogarithmicCreep
from fracjax._blocks.viscoelastic_layer import MaxwellLayer
from fracjax._parameters import set_values
from tests.helpers import smooth

STEP = 4.6e-3  # no line of the mains falls on half the sampling rate
SAMPLES = 161

TIMES = np.arange(SAMPLES) * STEP
DRIVE = jnp.asarray(smooth(TIMES))
foh = FOH(k_l=0.05, k_h=0.04, k_p=1e-4, alpha=0.14, beta=-0.13)
lfdh, creep, lag = LFDH(), Creep(2.0, 0.05), DriveLag(0.02)
log_creep = LogarithmicCreep(0.05, 0.03)
ladder = set_values(KelvinVoigtCreep(0.02, 0.02, 5.0), {"gains": np.array([0.02, 0.0, 0.05, 0.01])})
arms = set_values(MaxwellLayer(0.03, 0.01, 7.0), {"shares": np.array([0.02, 0.05, 0.0, 0.01])})
bouc_wen = BoucWen(0.1, -1.5, 0.05, 1.3, 1.6)
delay = Delay(2.4 * STEP, longest=20 * STEP)
resonance = Resonance(9.0, 0.2)
electrostriction = Electrostriction(0.1, centre=60.0, span=45.0)
saturation = Saturation(70.3, low=40.0, high=85.0)
memory = MinorLoopMemory(np.linspace(0.1, 0.3, 12), span=45.0)
drift = set_values(ThermalDrift(0.2, longest=0.8), {"amplitude": 0.3, "slope": -0.2})
mains = set_values(
    MainsInterference(50.0),
    {"cosines": np.linspace(0.3, 0.1, 5), "sines": np.linspace(-0.1, 0.2, 5)},
)

skew = ClockSkew(-9e-4)

operator, inverse_lfdh = SingleOperator(0.3, 0.4), InverseLFDH()
pea = PEADynamics(0.8, 0.3, -0.25, 9.0, 0.2)

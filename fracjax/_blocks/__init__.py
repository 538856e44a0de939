"""The blocks, one per file; a new effect is its file plus one line here."""

from . import (
    amplitude_dependence,
    backlash,
    clock_skew,
    coulomb_friction,
    creep,
    cubic_nonlinearity,
    degradation,
    delay,
    drive_lag,
    electrostriction,
    gain_drift,
    lost_contact,
    mains_interference,
    minor_loop_memory,
    quantisation,
    resonance,
    saturation,
    second_mode,
    sensor_lag,
    sensor_nonlinearity,
    slew_rate_limit,
    thermal_drift,
    viscoelastic_layer,
)
from ._block import AbstractBlock as AbstractBlock
from ._block import AbstractLinearBlock as AbstractLinearBlock
from ._block import Inverse as Inverse
from ._block import LinearParallel as LinearParallel
from ._block import LinearSeries as LinearSeries
from ._block import Parallel as Parallel
from ._block import Series as Series
from ._block import linear_gains as linear_gains
from ._effect import Effect as Effect
from ._effect import Setting as Setting
from ._effect import Site as Site
from ._response import Bode as Bode
from ._response import bode as bode
from ._response import frequency_response as frequency_response
from ._response import poles as poles
from ._response import step_response as step_response
from .amplitude_dependence import AmplitudeDependence as AmplitudeDependence
from .backlash import Backlash as Backlash
from .bouc_wen import BoucWen as BoucWen
from .clock_skew import ClockSkew as ClockSkew
from .coulomb_friction import CoulombFriction as CoulombFriction
from .coulomb_friction import LuGreFriction as LuGreFriction
from .creep import Creep as Creep
from .creep import KelvinVoigtCreep as KelvinVoigtCreep
from .creep import LogarithmicCreep as LogarithmicCreep
from .cubic_nonlinearity import CubicNonlinearity as CubicNonlinearity
from .degradation import Degradation as Degradation
from .delay import Delay as Delay
from .drive_circuit import DriveCircuit as DriveCircuit
from .drive_lag import DriveLag as DriveLag
from .electrostriction import Electrostriction as Electrostriction
from .foh import FOH as FOH
from .foh_linear import FOHLinear as FOHLinear
from .foh_rate_term import FOHRateTerm as FOHRateTerm
from .gain import Gain as Gain
from .gain_drift import GainDrift as GainDrift
from .inverse_lfdh import InverseLFDH as InverseLFDH
from .lfdh import LFDH as LFDH
from .lost_contact import LostContact as LostContact
from .lost_contact import ThrownLoad as ThrownLoad
from .mains_interference import MainsInterference as MainsInterference
from .minor_loop_memory import DriveMemory as DriveMemory
from .minor_loop_memory import MinorLoopMemory as MinorLoopMemory
from .pea_dynamics import PEADynamics as PEADynamics
from .prandtl_ishlinskii import PrandtlIshlinskii as PrandtlIshlinskii
from .quantisation import Quantisation as Quantisation
from .quasi_static_force import QuasiStaticForce as QuasiStaticForce
from .resonance import Resonance as Resonance
from .saturation import Saturation as Saturation
from .second_mode import SecondMode as SecondMode
from .sensor_lag import SensorFilter as SensorFilter
from .sensor_lag import SensorLag as SensorLag
from .sensor_nonlinearity import SensorNonlinearity as SensorNonlinearity
from .single_operator import SingleOperator as SingleOperator
from .slew_rate_limit import SlewRateLimit as SlewRateLimit
from .thermal_drift import ThermalDrift as ThermalDrift
from .viscoelastic_layer import MaxwellLayer as MaxwellLayer
from .viscoelastic_layer import ViscoelasticLayer as ViscoelasticLayer

EFFECTS: dict[str, Effect] = {  # in the order in which the command line lists them
    module.EFFECT.name: module.EFFECT
    for module in (
        creep,
        drive_lag,
        sensor_lag,
        delay,
        resonance,
        second_mode,
        electrostriction,
        cubic_nonlinearity,
        minor_loop_memory,
        amplitude_dependence,
        backlash,
        coulomb_friction,
        lost_contact,
        saturation,
        slew_rate_limit,
        thermal_drift,
        gain_drift,
        degradation,
        sensor_nonlinearity,
        mains_interference,
        viscoelastic_layer,
        clock_skew,
        quantisation,
    )
}

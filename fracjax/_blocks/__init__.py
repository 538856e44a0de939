"""The blocks, one per file; a new effect is its file plus one line here."""

from . import (
    amplitude_dependence,
    backlash,
    clearance,
    clipping,
    clock_skew,
    coulomb_friction,
    creep,
    cubic_nonlinearity,
    cubic_stiffness,
    curvature,
    dead_zone,
    degradation,
    delay,
    diode,
    drive_lag,
    dry_friction,
    electrostriction,
    end_stop,
    gain_drift,
    hysteretic_spring,
    internal_saturation,
    lost_contact,
    mains_interference,
    minor_loop_memory,
    negative_stiffness,
    position_dependent_gain,
    quadratic_damping,
    quadratic_stiffness,
    quantisation,
    resonance,
    root_outflow,
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
from ._inside import AbstractForce as AbstractForce
from ._inside import AbstractInside as AbstractInside
from ._inside import InsideEffect as InsideEffect
from ._machine import AbstractMachine as AbstractMachine
from ._machine import Within as Within
from ._port import Motion as Motion
from ._port import Port as Port
from ._port import System as System
from ._response import Bode as Bode
from ._response import bode as bode
from ._response import frequency_response as frequency_response
from ._response import poles as poles
from ._response import step_response as step_response
from .amplitude_dependence import AmplitudeDependence as AmplitudeDependence
from .backlash import Backlash as Backlash
from .bouc_wen import BoucWen as BoucWen
from .clearance import Clearance as Clearance
from .clipping import Clipping as Clipping
from .clock_skew import ClockSkew as ClockSkew
from .coulomb_friction import CoulombFriction as CoulombFriction
from .coulomb_friction import LuGreFriction as LuGreFriction
from .creep import Creep as Creep
from .creep import KelvinVoigtCreep as KelvinVoigtCreep
from .creep import LogarithmicCreep as LogarithmicCreep
from .cubic_nonlinearity import CubicNonlinearity as CubicNonlinearity
from .cubic_stiffness import CubicStiffness as CubicStiffness
from .curvature import Curvature as Curvature
from .dead_zone import DeadZone as DeadZone
from .degradation import Degradation as Degradation
from .delay import Delay as Delay
from .diode import Diode as Diode
from .drive_circuit import DriveCircuit as DriveCircuit
from .drive_lag import DriveLag as DriveLag
from .dry_friction import DryFriction as DryFriction
from .dry_friction import LuGre as LuGre
from .electrostriction import Electrostriction as Electrostriction
from .end_stop import EndStop as EndStop
from .filters import Filters as Filters
from .foh import FOH as FOH
from .foh_linear import FOHLinear as FOHLinear
from .foh_rate_term import FOHRateTerm as FOHRateTerm
from .gain import Gain as Gain
from .gain_drift import GainDrift as GainDrift
from .hysteretic_spring import HystereticSpring as HystereticSpring
from .impedance import Impedance as Impedance
from .internal_saturation import InternalSaturation as InternalSaturation
from .inverse_lfdh import InverseLFDH as InverseLFDH
from .lag import Lag as Lag
from .lfdh import LFDH as LFDH
from .lost_contact import LostContact as LostContact
from .lost_contact import ThrownLoad as ThrownLoad
from .mains_interference import MainsInterference as MainsInterference
from .mass import Mass as Mass
from .minor_loop_memory import DriveMemory as DriveMemory
from .minor_loop_memory import MinorLoopMemory as MinorLoopMemory
from .modes import Modes as Modes
from .negative_stiffness import NegativeStiffness as NegativeStiffness
from .oscillator import Oscillator as Oscillator
from .pea_dynamics import PEADynamics as PEADynamics
from .position_dependent_gain import PositionDependentGain as PositionDependentGain
from .prandtl_ishlinskii import PrandtlIshlinskii as PrandtlIshlinskii
from .quadratic_damping import QuadraticDamping as QuadraticDamping
from .quadratic_stiffness import QuadraticStiffness as QuadraticStiffness
from .quantisation import Quantisation as Quantisation
from .quasi_static_force import QuasiStaticForce as QuasiStaticForce
from .resonance import Resonance as Resonance
from .root_outflow import RootOutflow as RootOutflow
from .saturation import Saturation as Saturation
from .second_mode import SecondMode as SecondMode
from .sensor_lag import SensorFilter as SensorFilter
from .sensor_lag import SensorLag as SensorLag
from .sensor_nonlinearity import SensorNonlinearity as SensorNonlinearity
from .single_operator import SingleOperator as SingleOperator
from .slew_rate_limit import SlewRateLimit as SlewRateLimit
from .static_curve import StaticCurve as StaticCurve
from .thermal_drift import ThermalDrift as ThermalDrift
from .viscoelastic import AbstractMaterial as AbstractMaterial
from .viscoelastic import FractionalKelvinVoigt as FractionalKelvinVoigt
from .viscoelastic import FractionalMaxwell as FractionalMaxwell
from .viscoelastic import FractionalZener as FractionalZener
from .viscoelastic import Springpot as Springpot
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

INSIDE: dict[str, InsideEffect] = {  # in the order in which the command line lists them
    module.INSIDE.name: module.INSIDE
    for module in (
        cubic_stiffness,
        quadratic_stiffness,
        clearance,
        end_stop,
        dry_friction,
        quadratic_damping,
        position_dependent_gain,
        root_outflow,
        internal_saturation,
        hysteretic_spring,
        negative_stiffness,
        diode,
        clipping,
        dead_zone,
        curvature,
    )
}
"""Physics inside machines, by name."""

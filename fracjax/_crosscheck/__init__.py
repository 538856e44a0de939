"""The gradient fit compared with bounded L-BFGS, particle swarm and differential evolution."""

from ._crosscheck import Crosscheck as Crosscheck
from ._crosscheck import Optimum as Optimum
from ._crosscheck import crosscheck as crosscheck

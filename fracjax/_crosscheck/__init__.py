"""The gradient fit beside bounded L-BFGS, particle swarm and evolution."""

from ._crosscheck import Crosscheck as Crosscheck
from ._crosscheck import Optimum as Optimum
from ._crosscheck import crosscheck as crosscheck

"""The optimum of a block on prepared recordings, from several starts."""

from ._compressed import Compressed as Compressed
from ._compressed import compress as compress
from ._elimination import eliminate as eliminate
from ._elimination import orthonormal_basis as orthonormal_basis
from ._least_squares import Linearised as Linearised
from ._least_squares import Objective as Objective
from ._least_squares import begin as begin
from ._least_squares import descend as descend
from ._least_squares import jacobian as jacobian
from ._least_squares import sensitivity as sensitivity
from ._least_squares import simulate as simulate
from ._least_squares import simulate_all as simulate_all
from ._numerics import LIMIT as LIMIT
from ._numerics import TARGET as TARGET
from ._numerics import discretisation_warnings as discretisation_warnings
from ._numerics import numerical_error as numerical_error
from ._numerics import refine_until_accurate as refine_until_accurate
from ._numerics import tolerated_error as tolerated_error
from ._programs import limit_compiled_programs as limit_compiled_programs
from ._result import Progress as Progress
from ._result import Solved as Solved
from ._result import silent as silent
from ._solve import fit_block as fit_block
from ._solve import solve_from as solve_from
from ._solve import solved_at as solved_at
from ._solve import starts_of as starts_of

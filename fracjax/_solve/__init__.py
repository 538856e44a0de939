"""From several starts to the optimum of a block on prepared recordings."""

from ._compressed import Compressed as Compressed
from ._compressed import compress as compress
from ._elimination import eliminated as eliminated
from ._elimination import orthonormal as orthonormal
from ._least_squares import Linearised as Linearised
from ._least_squares import Objective as Objective
from ._least_squares import begin as begin
from ._least_squares import descend as descend
from ._least_squares import jacobian as jacobian
from ._least_squares import sensitivity as sensitivity
from ._least_squares import simulate as simulate
from ._least_squares import simulate_all as simulate_all
from ._numerics import LIMIT as LIMIT
from ._numerics import fine_enough as fine_enough
from ._numerics import numerical_error as numerical_error
from ._numerics import tolerated as tolerated
from ._numerics import too_coarse as too_coarse
from ._programs import make_room as make_room
from ._result import Progress as Progress
from ._result import Solved as Solved
from ._result import silent as silent
from ._solve import fit_block as fit_block
from ._solve import solve_from as solve_from
from ._solve import solved_at as solved_at
from ._solve import starts_of as starts_of

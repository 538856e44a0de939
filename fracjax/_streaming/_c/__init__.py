"""A stream as C: its JAX program written operation by operation."""

from ._fmu import platforms as platforms
from ._fmu import write_fmu as write_fmu
from ._write import write_c as write_c

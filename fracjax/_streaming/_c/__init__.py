"""A stream as C: its JAX program written operation by operation."""

from ._write import write_c as write_c

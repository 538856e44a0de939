"""The command line: reads, calls the package, writes what it found, and says it plainly.

A file holds one command, and `_options` what several of them take.  Whatever takes long to import
is imported by the command that needs it, so that help is instant.
"""

from ._main import heed_interrupt as heed_interrupt
from ._main import main as main
from ._main import run as run

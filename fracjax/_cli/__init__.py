"""The command line: reads files, calls the package, writes the results and summarises them.

Each file holds one command; options of several commands are in `_options`.  Modules that take long
to import are imported inside the command that needs them, so that help is instant.
"""

from ._main import heed_interrupt as heed_interrupt
from ._main import main as main
from ._main import run as run

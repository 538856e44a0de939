"""The page for those who never open a shell: files to a diagnosis, on this machine alone."""

from ._server import serve as serve

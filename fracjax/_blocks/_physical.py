"""Checks of constructors that take physical quantities."""

from .._recording import InputError


def require_positive(where: str, **quantities: float) -> None:
    """Raise InputError, placed at `where`, for the first quantity that is not above zero."""
    for name, value in quantities.items():
        if not value > 0:
            raise InputError.at(
                f"{where}, {name}", "a positive number", f"{value:g}", "give a positive one"
            )

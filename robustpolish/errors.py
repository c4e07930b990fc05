"""The errors and the warning that robustpolish raises, and nothing else does.

Every message names the argument, the value that came, what was expected and
what to do next; :func:`robustpolish.base.checks.invalid` builds such messages.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = [
    "InfeasibleError",
    "InvalidInputError",
    "MissingDependencyError",
    "RobustPolishError",
    "RobustPolishWarning",
    "SolverError",
    "StorageError",
]


class RobustPolishError(Exception):
    """Base of all errors that the package raises on purpose."""


class InvalidInputError(RobustPolishError, ValueError):
    """An argument has the wrong shape, value, name or unit.

    Parameters
    ----------
    message : str
        Argument, value, expectation and remedy.
    key : sequence of str or int, optional
        Where the argument stands, from the outside in: ``("spring", 1, "stiffness")`` is the
        stiffness of the second spring.
    """

    def __init__(self, message: str, key: Sequence[str | int] = ()) -> None:
        super().__init__(message)
        self.key = tuple(key)


class MissingDependencyError(RobustPolishError, ImportError):
    """An optional solver is not installed; the message says what to install."""


class SolverError(RobustPolishError, RuntimeError):
    """No certified answer was found, though none was ruled out either."""


class StorageError(RobustPolishError, OSError):
    """The disk took no result: it is full, broken or not to be written to.

    What stood at the place before is as it was. `errno` is that of the system.
    """


class InfeasibleError(RobustPolishError):
    """No controller of the requested kind exists; the message names the cause.

    Parameters
    ----------
    message : str
        Cause and remedy.
    modes : sequence of complex, optional
        The eigenvalues, in rad/s (or of the discrete-time state matrix), that
        no controller can move.
    """

    def __init__(self, message: str, modes: Sequence[complex] = ()) -> None:
        super().__init__(message)
        self.modes = tuple(complex(mode) for mode in modes)


class RobustPolishWarning(UserWarning):
    """The one warning class of the package."""

"""The checks of arguments, the one form in which they complain, and the errors."""

import pickle

import pytest

from robustpolish import errors


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [
        (errors.InvalidInputError, ValueError),
        (errors.MissingDependencyError, ImportError),
        (errors.SolverError, RuntimeError),
        (errors.InfeasibleError, Exception),
    ],
)
def test_one_base_catches_all_and_each_is_what_python_calls_it(kind, builtin):
    assert issubclass(kind, errors.RobustPolishError)
    assert issubclass(kind, builtin)
    assert str(kind("a: got 1, expected 2. Change it.")) == "a: got 1, expected 2. Change it."


def test_keys_and_modes_travel():
    error = errors.InvalidInputError("bad", ["spring", 1, "stiffness"])
    lost = errors.InfeasibleError("no controller moves them", [2, -1j])
    again, moved = pickle.loads(pickle.dumps((error, lost)))
    assert (str(again), again.key) == ("bad", ("spring", 1, "stiffness"))
    assert moved.modes == lost.modes == (2 + 0j, -1j)
    assert all(isinstance(mode, complex) for mode in moved.modes)
    assert errors.InvalidInputError("bad").key == errors.InfeasibleError("none").modes == ()
    assert issubclass(errors.RobustPolishWarning, UserWarning)
    assert not issubclass(errors.RobustPolishWarning, errors.RobustPolishError)

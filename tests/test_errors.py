"""The errors: what they are, and what they carry from process to process."""

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


def test_a_key_is_kept_as_a_tuple_and_travels():
    error = errors.InvalidInputError("bad", ["spring", 1, "stiffness"])
    assert error.key == ("spring", 1, "stiffness")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.key) == ("bad", error.key)
    assert errors.InvalidInputError("bad").key == ()


def test_modes_are_complex_numbers_and_travel():
    error = errors.InfeasibleError("no controller moves them", [2, -1j])
    assert error.modes == (2 + 0j, -1j)
    assert all(isinstance(mode, complex) for mode in error.modes)
    assert pickle.loads(pickle.dumps(error)).modes == error.modes
    assert errors.InfeasibleError("none").modes == ()


def test_the_warning_is_no_error():
    assert issubclass(errors.RobustPolishWarning, UserWarning)
    assert not issubclass(errors.RobustPolishWarning, errors.RobustPolishError)

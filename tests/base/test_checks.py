"""The checks of arguments, the one form in which they complain, and the errors."""

import pickle

import control
import numpy as np
import pytest

from robustpolish import errors
from robustpolish.base.checks import closest_name_remedy, known_keys, matrix, state_space
from robustpolish.errors import InvalidInputError


@pytest.mark.parametrize(
    ("value", "shape", "told"),
    [
        ([[1j]], (None, None), "A: got complex entries, expected a real matrix."),
        ([["1j"]], (None, None), "Pass nested lists"),
        ([[None]], (None, None), "Pass nested lists|got nan"),
        ("text", (None, None), "A: got 'text', expected a real matrix."),
        ([[1, 2], [3]], (None, None), r"A: got \[\[1, 2\], \[3\]\], .* Pass nested lists"),
        ([1.0, 2.0], (None, None), r"got shape \(2,\)"),
        ([[1, 2]], (2, None), r"got shape \(1, 2\), expected a real matrix of shape \(2, any\)"),
        ([[0, 1], [np.inf, 2]], (2, 2), "got inf at row 1, column 0, expected finite numbers"),
    ],
)
def test_what_is_no_such_matrix_is_refused(value, shape, told):
    with pytest.raises(InvalidInputError, match=told):
        matrix("A", value, shape)


def test_systems_are_not_realised_silently():
    system = control.ss(-1, 1, 1, 0)
    assert state_space("system", system) is system
    told = r"system: got TransferFunction, expected a control\.StateSpace"
    with pytest.raises(InvalidInputError, match=told):
        state_space("system", control.tf([1], [1, 1]))
    system.B[0, 0] = np.nan
    with pytest.raises(InvalidInputError, match=r"system\.B: got nan at row 0, column 0"):
        state_space("system", system)


def test_unknown_keys_are_told_with_the_nearest_right_one():
    with pytest.raises(InvalidInputError, match=r"spring.1.\.stifness: got an unknown.*stiffness"):
        known_keys(("spring", 1), {"stifness": 3}, ("between", "stiffness"))
    with pytest.raises(InvalidInputError, match="no table dof"):
        known_keys((), {}, ("dof",), ("dof",))
    assert closest_name_remedy("quite else", ("dof", "spring")) == "Check its spelling."


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

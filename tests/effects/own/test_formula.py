import numpy as np
import pytest

from robustpolish.machines.effects.formula_language import read_formula


def test_a_formula_has_values_for_numbers_and_arrays():
    formula = read_formula("f = -k*max(abs(q) - g, 0)*sign(q) + min(q, 1, 2)/2", ["k", "g"])
    q = np.linspace(-2.0, 2.0, 41)
    wanted = -3.0 * np.maximum(np.abs(q) - 0.5, 0) * np.sign(q) + np.minimum(q, 1) / 2
    np.testing.assert_allclose(formula.value({"k": 3.0, "g": 0.5, "q": q}), wanted)
    assert formula.value({"k": 3.0, "g": 0.5, "q": -1.0}) == pytest.approx(1.0)


def test_where_it_has_no_value_it_is_not_finite():
    formula = read_formula("f = log(q) + 1/v", [])
    assert np.isnan(formula.value({"q": -1.0, "v": 1.0}))
    assert np.isinf(formula.value({"q": 1.0, "v": 0.0}))


def test_names_and_operations_are_told():
    formula = read_formula("f = -k*tanh(q)**2", ["k"])
    assert formula.names == {"k", "q"}
    assert formula.operations == {"negative", "*", "tanh", "**"}


def test_a_fold_walks_along_any_algebra():
    formula = read_formula("f = a*q + a*v", ["a"])
    written = formula.fold(str, lambda operation, *parts: f"({operation.join(parts)})")
    assert written == "((a*q)+(a*v))"

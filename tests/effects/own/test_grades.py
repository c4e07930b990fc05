import pytest

from robustpolish.machines.effects.formula_language import (
    Grade,
    graded,
    grows_with,
    linear_in,
    multiplied,
    read_formula,
)


def grade_of(text, loose=False, **powers):
    formula = read_formula(text, [name for name in powers if name not in "qvt"])
    grades = {name: Grade(p) for name, p in powers.items()}
    return graded(formula, grades, loose_numbers=loose)


def test_powers_that_cancel_are_gone():
    assert multiplied({"N": 1.0}, {"N": 0.5}, -2.0) == {}


@pytest.mark.parametrize(
    ("text", "powers"),
    [
        ("f = a*q/v", {"A": 1.0, "L": 1.0, "V": -1.0}),
        ("f = a*sqrt(q)*q**1.5", {"A": 1.0, "L": 2.0}),
        ("f = a*abs(q) + 0", {"A": 1.0, "L": 1.0}),
        ("f = a*sign(q)*tanh(v/v)", {"A": 1.0}),
        ("f = max(a*q, 0) - min(a*q, a*q)", {"A": 1.0, "L": 1.0}),
    ],
)
def test_units_are_counted(text, powers):
    names = {"a": {"A": 1.0}, "q": {"L": 1.0}, "v": {"V": 1.0}}
    assert grade_of(text, **names).powers == powers


@pytest.mark.parametrize("text", ["f = q + v", "f = tanh(q)", "f = 2**q", "f = max(q, v)"])
def test_what_does_not_fit_is_refused(text):
    with pytest.raises(ArithmeticError):
        grade_of(text, q={"L": 1.0}, v={"V": 1.0})


def test_numbers_may_have_a_unit():
    names = {"q": {"L": 1.0}, "v": {"V": 1.0}}
    assert grade_of("f = q*tanh(v/0.01)", loose=True, **names).powers == {"L": 1.0}
    assert grade_of("f = q - 0.5", loose=True, **names).powers == {"L": 1.0}
    assert grade_of("f = q + 2*v", loose=True, **names).powers == {"L": 1.0}
    assert grade_of("f = 2*q + 3*v", loose=True, **names).powers is None
    with pytest.raises(ArithmeticError):
        grade_of("f = q + v**2", loose=True, **names)


def test_an_unknown_exponent_makes_an_unknown_unit():
    assert grade_of("f = q**n", q={"L": 1.0}, n={}).powers is None


@pytest.mark.parametrize(
    ("text", "together", "grows"),
    [
        ("f = -F*tanh(k*q/F)", "Fk", True),
        ("f = -min(k*abs(q), F)*sign(q)", "Fk", True),
        ("f = -F*tanh(k*q)", "Fk", False),
        ("f = -k*q - F", "Fk", True),
        ("f = -k*q*F", "Fk", False),
        ("f = -sqrt(k*F)*q", "Fk", True),
    ],
)
def test_what_grows_together(text, together, grows):
    assert grows_with(read_formula(text, ["k", "F"]), together) == grows


@pytest.mark.parametrize(
    ("text", "names", "linear"),
    [
        ("f = -k*q - c*v", "kc", True),
        ("f = -k*q - c*v", "k", False),
        ("f = -k*q*c", "kc", False),
        ("f = -k*q*c", "k", True),
        ("f = -k*q/c", "k", True),
        ("f = -k*q/c", "c", False),
        ("f = -(k + c*v)*q", "kc", True),
        ("f = -abs(k)*q*c", "k", False),
        ("f = q*k - c*c", "kc", False),
    ],
)
def test_what_is_linear(text, names, linear):
    assert linear_in(read_formula(text, ["k", "c"]), names) == linear

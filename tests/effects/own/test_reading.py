"""What is no formula ends quickly and in words; nothing of it runs."""

import builtins
import time

import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects.formula_language import read_formula

HOSTILE = {
    "import": "f = __import__('os').system('true')",
    "attribute": "f = q.__class__",
    "dunder name": "f = __builtins__*q",
    "lambda": "f = (lambda: 1)()",
    "walrus": "f = (q := 1)",
    "comprehension": "f = sum([i for i in (1, 2)])",
    "subscript": "f = q[0]",
    "string": "f = 'a'*9**9",
    "formatted": "f = f'{q}'",
    "two statements": "f = q; import os",
    "two lines": "f = q\nimport os",
    "other target": "g = q",
    "item target": "f[0] = q",
    "two targets": "f = q = 1",
    "augmented": "f += q",
    "no target": "-k*q",
    "star": "f = min(*q)",
    "keyword": "f = sin(x=q)",
    "bool": "f = True*q",
    "complex": "f = 1j*q",
    "tuple": "f = q, v",
    "null byte": "f = q\0",
    "nothing": "",
    "blank": "   ",
    "comment": "# f = q",
    "function called by nothing": "f = sin()",
    "one argument for two": "f = max(q)",
    "unknown function": "f = eval(q)",
    "huge whole number": "f = " + "9" * 900 + "*q",
    "huge decimal": "f = 1e999*q",
    "tower of powers": "f = 10**10**10**10*q",
    "shifted": "f = 1 << 999999999",
    "floor": "f = q // 2",
    "modulo": "f = q % 2",
    "matrix product": "f = q @ v",
    "very deep brackets": "f = " + "(" * 400 + "q" + ")" * 400,
    "deep calls": "f = " + "sin(" * 150 + "q" + ")" * 150,
    "deep signs": "f = " + "-" * 900 + "q",
    "deep powers": "f = " + "q**" * 300 + "q",
    "very long": "f = " + "q+" * 5_000_000 + "q",
    "very long blanks": "f = q" + " " * 10_000_000,
    "no text": 3,
    "bytes": b"f = q",
    "nothing at all": None,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_no_formula_is_refused_at_once(name, monkeypatch):
    def forbidden(*_):
        raise AssertionError("text was executed")

    monkeypatch.setattr(builtins, "eval", forbidden)
    monkeypatch.setattr(builtins, "exec", forbidden)
    start = time.process_time()
    with pytest.raises(InvalidInputError) as caught:
        read_formula(HOSTILE[name], [])
    assert time.process_time() - start < 2.0
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("f = -k*q^5", r"\*\* for a power"),
        ("f = -k*q if q > 0 else 0", "min, max"),
        ("f = -k*np.tanh(q)", "name alone"),
        ("f = -k*|v|", "Correct it"),
        ("f = -k*(q > 0)", "min, max"),
        ("f = -kk*q", "parameters={'kk'"),
        ("-k*q", "Begin with 'f ='"),
        ("f = -k*cosh(q)", "Use one of these functions"),
    ],
)
def test_common_slips_get_a_hint(text, hint):
    with pytest.raises(InvalidInputError, match=hint):
        read_formula(text, ["k"])


@pytest.mark.parametrize(
    "name", ["q", "f", "tanh", "pi", "lambda", "2k", "a b", "__import__", "", 3]
)
def test_names_that_cannot_be_parameters_are_refused(name):
    with pytest.raises(InvalidInputError, match="Rename it"):
        read_formula("f = q", [name])


def test_a_declared_name_has_to_be_used():
    with pytest.raises(InvalidInputError, match="without c"):
        read_formula("f = -k*q", ["k", "c"])


def test_letters_of_other_alphabets_are_names():
    assert read_formula("f = -μ*sign(v)", ["μ"]).value({"μ": 2.0, "v": 1.0}) == -2.0
    with pytest.raises(InvalidInputError, match="plain letters"):
        read_formula("f = -µ*sign(v)", ["µ"])  # the micro sign, which Python turns into a mu


def test_numbers_are_put_together():
    formula = read_formula("f = q**(3/2) + 2*pi*v - -1", [])
    numbers = [item for kind, item in formula.program if kind == "number"]
    assert numbers == pytest.approx([1.5, 6.283185307179586, -1.0])


def test_long_sums_are_not_deep():
    text = "f = " + " + ".join(["q"] * 200)
    assert read_formula(text, []).value({"q": 1.0}) == 200.0


def test_the_text_is_kept_without_superfluous_blanks():
    assert read_formula("  f =\n  -k*q  ", ["k"]).text == "f = -k*q"

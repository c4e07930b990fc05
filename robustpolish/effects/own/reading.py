"""Read a formula that somebody typed; nothing of it is ever executed.

Python's own parser makes a tree of the text, of which only what stands in the tables below is
taken.
"""

from __future__ import annotations

import ast
import keyword
import math
import unicodedata
import warnings
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from robustpolish.effects.own.formula import FUNCTIONS, MOTION, Formula, result_of
from robustpolish.errors import InvalidInputError
from robustpolish.validation import Key, described, invalid

_OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
_CONSTANTS = {"pi": math.pi}
_LONGEST = 1000  # characters: a law of a machine is shorter
_DEEPEST = 60  # brackets within brackets
_EXAMPLE = "such as 'f = -k*q**5'"

_HINTS: Mapping[type, str] = {
    ast.BitXor: "Write ** for a power, as in q**5.",
    ast.BitOr: "Write abs(v) for |v|.",
    ast.Compare: "Write cases with min, max, abs or sign.",
    ast.BoolOp: "Write cases with min, max, abs or sign.",
    ast.IfExp: "Write cases with min, max, abs or sign.",
    ast.Attribute: "Write the function's name alone, as in tanh(v/w).",
}


def read_formula(text: str, declared: Iterable[str]) -> Formula:
    """Read a formula such as ``"f = -k*q**5"``.

    Parameters
    ----------
    text : str
        ``f =`` and an expression of numbers, ``+ - * / **``, brackets, ``pi``, the functions sin,
        cos, tan, exp, log, sqrt, abs, sign, tanh, arctan, min and max, and names.
    declared : iterable of str
        The names besides q, v and t; each has to be there.

    Returns
    -------
    Formula

    Raises
    ------
    InvalidInputError
        If it is anything else.

    Examples
    --------
    >>> read_formula("f = -k*q", ["k"]).program
    (('name', 'k'), ('negative', None), ('name', 'q'), ('*', None))
    """
    names = tuple(declared)
    for name in names:
        _check_name(name)
    tree = _tree(text)
    program: list[tuple[str, Any]] = []
    _append(program, tree, {*MOTION, *names}, 0)
    formula = Formula(" ".join(text.split()), tuple(program))
    for name in names:
        if name not in formula.names:
            raise invalid(
                "formula",
                described(f"{formula.text!r} without {name}"),
                f"every name that is declared, {name} too",
                "Use it in the formula, or leave it out of the declaration.",
            )
    return formula


def _check_name(name: Any) -> None:
    taken = {*MOTION, "f", *FUNCTIONS, "min", "max", *_CONSTANTS}
    plain = isinstance(name, str) and name.isidentifier() and len(name) <= 40
    if not plain or keyword.iskeyword(name) or name in taken or name.startswith("__"):
        raise invalid(
            "parameters",
            name,
            f"a name of letters and digits other than {', '.join(sorted(taken))}",
            "Rename it.",
        )
    if unicodedata.normalize("NFKC", name) != name:
        raise invalid("parameters", name, "a name of plain letters", "Rename it.")


def _tree(text: Any) -> ast.expr:
    if not isinstance(text, str):
        raise invalid("formula", text, f"text, {_EXAMPLE}", "Write it between quotation marks.")
    if len(text) > _LONGEST:
        shown = described(f"{len(text)} characters")
        raise invalid("formula", shown, f"at most {_LONGEST}", "Shorten it, or write a law.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # what Python finds doubtful is no formula
            body = ast.parse(" ".join(text.split())).body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else "too long or too deep"
        shown = described(f"{text[:60]!r} ({reason})")
        raise invalid("formula", shown, f"a formula, {_EXAMPLE}", "Correct it.") from None
    statement = body[0] if len(body) == 1 else None
    if isinstance(statement, ast.Assign) and len(statement.targets) == 1:
        target = statement.targets[0]
        if isinstance(target, ast.Name) and target.id == "f":
            return statement.value
    remedy = "Begin with 'f =': the force on the first coordinate, the second gets the opposite."
    raise invalid("formula", text, f"one formula, {_EXAMPLE}", remedy)


def _append(program: list[tuple[str, Any]], node: ast.AST, names: set[str], depth: int) -> None:
    """Append what computes a node."""
    if depth > _DEEPEST:
        shown = described("brackets or signs nested too deeply")
        raise invalid("formula", shown, f"at most {_DEEPEST} levels", "Simplify it.")
    if isinstance(node, ast.Constant):
        program.append(("number", _number(node.value)))
    elif isinstance(node, ast.Name):
        program.append(_named(node.id, names))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd | ast.USub):
        _append(program, node.operand, names, depth + 1)
        if isinstance(node.op, ast.USub):
            _apply(program, "negative", 1)
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        _append_sum(program, node, names, depth)
    elif isinstance(node, ast.Call):
        _append_call(program, node, names, depth)
    else:
        raise _refused(node.op if isinstance(node, ast.BinOp) else node)


def _apply(program: list[tuple[str, Any]], operation: str, count: int) -> None:
    """Append an operation, or what it makes of numbers."""
    operands = program[-count:]
    if any(kind != "number" for kind, _ in operands):
        program.append((operation, None))
        return
    with np.errstate(all="ignore"):
        result = float(result_of(operation, *(number for _, number in operands)))
    program[-count:] = [("number", _number(result))]


def _append_sum(program: list[tuple[str, Any]], node: ast.BinOp, names: set[str], d: int) -> None:
    """Append a chain of operators; a long sum leans to the left and is not deep."""
    chain: list[ast.BinOp] = [node]
    while isinstance(chain[-1].left, ast.BinOp) and type(chain[-1].left.op) in _OPERATORS:
        chain.append(chain[-1].left)
    _append(program, chain[-1].left, names, d + 1)
    for link in reversed(chain):
        _append(program, link.right, names, d + 1)
        _apply(program, _OPERATORS[type(link.op)], 2)


def _append_call(program: list[tuple[str, Any]], node: ast.Call, names: set[str], d: int) -> None:
    if not isinstance(node.func, ast.Name):
        raise _refused(node.func)
    name, count = node.func.id, len(node.args)
    if name not in FUNCTIONS and name not in ("min", "max"):
        known = f"one of {', '.join(FUNCTIONS)}, min, max"
        raise invalid("formula", described(f"{name}(...)"), known, "Use one of these functions.")
    if node.keywords or (count != 1 if name in FUNCTIONS else count < 2):
        want = "one argument" if name in FUNCTIONS else "two arguments or more"
        raise invalid("formula", described(f"{name} with {count}"), want, "Correct it.")
    for i, argument in enumerate(node.args):
        _append(program, argument, names, d + 1)
        if i or name in FUNCTIONS:
            _apply(program, name, 1 if name in FUNCTIONS else 2)


def _number(value: Any) -> float:
    real = isinstance(value, int | float) and not isinstance(value, bool)
    try:
        number = float(value) if real else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise invalid("formula", value, "finite numbers", "Correct it.")
    return number


def _named(name: str, names: set[str]) -> tuple[str, Any]:
    if name in _CONSTANTS:
        return ("number", _CONSTANTS[name])
    if name not in names:
        key: Key = ("formula", name)
        known = f"one of {', '.join(sorted(names))}"
        remedy = f"Declare it with its unit, parameters={{{name!r}: 'N/m'}}, or correct it."
        raise invalid("formula", name, known, remedy, key)
    return ("name", name)


def _refused(node: ast.AST) -> InvalidInputError:
    what = described(type(node).__name__.lower())
    hint = _HINTS.get(type(node), "Write it with what is allowed.")
    allowed = "numbers, names, + - * / **, brackets and functions of one line"
    return invalid("formula", what, allowed, hint)

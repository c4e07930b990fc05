"""What somebody wrote of an effect: the formula, units, and what else was said."""

from __future__ import annotations

import ast
import keyword
import math
import re
import unicodedata
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from robustpolish.base.checks import Key, described, invalid, misfit, one_of

# A formula as a list of operations.
#
# They stand in postfix order, so that whatever has to be known of a formula (its value, its units,
# how a parameter enters, its machine code) is one walk along the list: see :meth:`Formula.fold`.

T = TypeVar("T")

MOTION = ("q", "v", "t")
"""Relative displacement, relative velocity and time, which every formula may name."""
FUNCTIONS: Mapping[str, Any] = {
    name: getattr(np, name)
    for name in ["sin", "cos", "tan", "exp", "log", "sqrt", "abs", "sign", "tanh", "arctan"]
}
PAIRS: Mapping[str, Any] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power,
    "min": np.minimum, "max": np.maximum,
}  # fmt: skip
_OPERATIONS: Mapping[str, Any] = {**FUNCTIONS, **PAIRS, "negative": np.negative}


@dataclass(frozen=True)
class PostfixProgram:
    """A formula as a program in postfix order.

    Parameters
    ----------
    text : str
        As it was written.
    program : tuple of (str, float or str or None)
        ``("number", 2.0)`` and ``("name", "q")`` are put on a stack; ``("+", None)`` and the
        like take their operands off it and put the result there.
    """

    text: str
    program: tuple[tuple[str, Any], ...]

    def fold(self, leaf: Callable[[float | str], T], combine: Callable[..., T]) -> T:
        """Walk along the program.

        Parameters
        ----------
        leaf : callable
            ``leaf(number)`` and ``leaf(name)`` give what stands for them.
        combine : callable
            ``combine(operation, *operands)`` gives what an operation makes of them.

        Returns
        -------
        object
            What stands for the whole formula.
        """
        stack: list[T] = []
        for operation, argument in self.program:
            if argument is not None:
                stack.append(leaf(argument))
                continue
            count = 2 if operation in PAIRS else 1
            operands = stack[-count:]
            del stack[-count:]
            stack.append(combine(operation, *operands))
        return stack[0]

    def value(self, values: Mapping[str, Any]) -> Any:
        """Return the value of the formula.

        Parameters
        ----------
        values : mapping of str to float or ndarray
            Of every name in it.

        Returns
        -------
        float or ndarray
            Not finite where the formula has no value.

        Examples
        --------
        >>> twice = PostfixProgram("f = 2*q", (("number", 2.0), ("name", "q"), ("*", None)))
        >>> twice.value({"q": 3.0})
        6.0
        """

        def leaf(item: float | str) -> Any:
            return values[item] if isinstance(item, str) else item

        with np.errstate(all="ignore"):
            found = self.fold(leaf, lambda operation, *given: _OPERATIONS[operation](*given))
        return float(found) if np.ndim(found) == 0 else found

    @property
    def names(self) -> frozenset[str]:
        """The names in it."""
        return frozenset(item for kind, item in self.program if kind == "name")

    @property
    def operations(self) -> frozenset[str]:
        """The operations in it, such as ``"+"`` and ``"tanh"``."""
        return frozenset(kind for kind, item in self.program if item is None)


# What a formula is made of, counted: units, or how it grows with some of its names.
#
# A grade is a product of powers. Sums need one grade on both sides, products add them, sines need
# none: the rules of units. The same rules tell whether a force grows in proportion with a group of
# parameters, if these have the grade 1 and all others none.

Powers = dict[str, float]


@dataclass(frozen=True)
class Grade:
    """A product of powers.

    Parameters
    ----------
    powers : dict of str to float, or None
        None for what fits everything, such as zero.
    loose : bool, optional
        Whether a number in it may have a unit that nobody wrote.
    number : float, optional
        Its value, of a number.
    """

    powers: Powers | None
    loose: bool = False
    number: float | None = None


def multiplied(powers: Powers, others: Mapping[str, float], exponent: float = 1.0) -> Powers:
    """Return powers times others to an exponent.

    Examples
    --------
    >>> multiplied({"N": 1.0, "m": 1.0}, {"m": 1.0}, -1.0)
    {'N': 1.0}
    """
    result = dict(powers)
    for name, power in others.items():
        result[name] = round(result.get(name, 0.0) + exponent * power, 9)
    return {name: power for name, power in result.items() if power}


def graded(
    formula: PostfixProgram,
    grades: Mapping[str, Grade],
    loose_numbers: bool = False,
    shown: Callable[[Powers], str] = str,
) -> Grade:
    """Return the grade of a formula.

    Parameters
    ----------
    formula : PostfixProgram
    grades : mapping of str to Grade
        Of every name in it.
    loose_numbers : bool, optional
        Whether a number may have a unit: ``tanh(v/0.01)`` means 0.01 m/s.
    shown : callable, optional
        How powers are written in a message.

    Returns
    -------
    Grade

    Raises
    ------
    ArithmeticError
        If the grades do not fit together.
    """

    def leaf(item: float | str) -> Grade:
        if isinstance(item, str):
            return grades[item]
        return Grade({} if item else None, loose_numbers and item != 0, item)

    def combine(operation: str, *operands: Grade) -> Grade:
        one, other = operands[0], operands[-1]
        loose = one.loose or other.loose
        if operation in ("+", "-", "min", "max"):
            if one.powers is None or other.powers is None:
                return Grade(other.powers if one.powers is None else one.powers, loose)
            if one.powers == other.powers:
                return Grade(one.powers, one.loose and other.loose)
            if one.loose and other.loose:
                return Grade(None, True)
            if loose:  # what is known tells the unit of the number
                return Grade(other.powers if one.loose else one.powers)
            pair = f"{shown(one.powers)} and {shown(other.powers)}"
            raise ArithmeticError(f"{operation} joins {pair}")
        if operation in ("*", "/"):
            if one.powers is None or other.powers is None:
                return Grade(None, loose)
            sign = 1.0 if operation == "*" else -1.0
            return Grade(multiplied(one.powers, other.powers, sign), loose)
        if operation == "**":
            if other.powers and not other.loose:
                raise ArithmeticError(f"an exponent is in {shown(other.powers)}")
            if one.powers and other.number is None:  # how large is the exponent?
                return Grade(None, True)
            return Grade(one.powers and multiplied({}, one.powers, other.number or 0.0), one.loose)
        if operation in ("negative", "abs"):
            return Grade(one.powers, one.loose)
        if operation == "sqrt":
            return Grade(one.powers and multiplied({}, one.powers, 0.5), one.loose)
        if operation != "sign" and one.powers and not one.loose:
            raise ArithmeticError(f"{operation} is taken of something in {shown(one.powers)}")
        return Grade({})

    return formula.fold(leaf, combine)


def grows_with(formula: PostfixProgram, names: Collection[str]) -> bool:
    """Return whether the force is multiplied by what all of these names are multiplied by.

    Parameters
    ----------
    formula : PostfixProgram
    names : collection of str

    Returns
    -------
    bool

    Examples
    --------
    >>> from robustpolish.machines.effects.formula_language import read_formula
    >>> grows_with(read_formula("f = -F*tanh(k*q/F)", ["F", "k"]), ["F", "k"])
    True
    """
    grades = {name: Grade({"size": 1.0} if name in names else {}) for name in formula.names}
    try:
        whole = graded(formula, grades)
    except ArithmeticError:
        return False
    return whole.powers == {"size": 1.0}


def linear_in(formula: PostfixProgram, names: Collection[str]) -> bool:
    """Return whether the force is a sum of terms that each have one of these names as a factor.

    Parameters
    ----------
    formula : PostfixProgram
    names : collection of str

    Returns
    -------
    bool

    Examples
    --------
    >>> from robustpolish.machines.effects.formula_language import read_formula
    >>> linear_in(read_formula("f = -k*q - c*v", ["k", "c"]), ["k", "c"])
    True
    """

    def combine(operation: str, *degrees: float) -> float:
        if operation == "negative" or (operation == "/" and degrees[1] == 0):
            return degrees[0]
        if operation in ("+", "-"):
            return degrees[0] if degrees[0] == degrees[1] else math.nan  # of no degree
        if operation == "*":
            return sum(degrees) if sum(degrees) <= 1 else math.nan
        return math.nan if any(degrees) else 0.0

    return formula.fold(lambda item: float(item in names), combine) == 1


# Read a formula that somebody typed; nothing of it is ever executed.
#
# Python's own parser makes a tree of the text, of which only what stands in the tables below is
# taken.

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


def read_formula(
    text: str, declared: Iterable[str], motion: Iterable[str] | None = MOTION
) -> PostfixProgram:
    """Read a formula such as ``"f = -k*q**5"``.

    Parameters
    ----------
    text : str
        ``f =`` and an expression of numbers, ``+ - * / **``, brackets, ``pi``, the functions sin,
        cos, tan, exp, log, sqrt, abs, sign, tanh, arctan, min and max, and names.
    declared : iterable of str
        The names besides q, v and t; each has to be there.
    motion : iterable of str or None, optional
        Names that every formula may have; None if all of `declared` are such.

    Returns
    -------
    PostfixProgram

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
        check_name(name, motion or ())
    known = {*(motion or ()), *names}
    program: list[tuple[str, Any]] = []

    def apply(operation: str, count: int) -> None:
        """Append an operation, or what it makes of numbers."""
        operands = program[-count:]
        if any(kind != "number" for kind, _ in operands):
            program.append((operation, None))
            return
        with np.errstate(all="ignore"):
            result = float(_OPERATIONS[operation](*(number for _, number in operands)))
        program[-count:] = [("number", _number("formula", result))]

    def append(node: ast.AST, depth: int) -> None:
        """Append what computes a node."""
        if depth > _DEEPEST:
            shown = described("brackets or signs nested too deeply")
            raise invalid("formula", shown, f"at most {_DEEPEST} levels", "Simplify it.")
        if isinstance(node, ast.Constant):
            program.append(("number", _number("formula", node.value)))
        elif isinstance(node, ast.Name) and node.id in _CONSTANTS:
            program.append(("number", _CONSTANTS[node.id]))
        elif isinstance(node, ast.Name):
            if node.id not in known:
                want = f"one of {', '.join(sorted(known))}"
                declare = f"parameters={{{node.id!r}: 'N/m'}}"
                remedy = f"Declare it with its unit, {declare}, or correct it."
                raise invalid("formula", node.id, want, remedy, ("formula", node.id))
            program.append(("name", node.id))
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd | ast.USub):
            append(node.operand, depth + 1)
            if isinstance(node.op, ast.USub):
                apply("negative", 1)
        elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            chain = [node]  # a long sum leans to the left and is not deep
            while isinstance(node := chain[-1].left, ast.BinOp) and type(node.op) in _OPERATORS:
                chain.append(node)
            append(node, depth + 1)
            for link in reversed(chain):
                append(link.right, depth + 1)
                apply(_OPERATORS[type(link.op)], 2)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            name, single = node.func.id, node.func.id in FUNCTIONS
            if not single and name not in ("min", "max"):
                want = f"one of {', '.join(FUNCTIONS)}, min, max"
                raise misfit("formula", f"{name}(...)", want, "Use one of these functions.")
            if node.keywords or (len(node.args) != 1 if single else len(node.args) < 2):
                want = "one argument" if single else "two arguments or more"
                raise misfit("formula", f"{name} with {len(node.args)}", want, "Correct it.")
            for i, argument in enumerate(node.args):
                append(argument, depth + 1)
                if i or single:
                    apply(name, 1 if single else 2)
        else:
            called = node.func if isinstance(node, ast.Call) else node
            wrong = called.op if isinstance(called, ast.BinOp) else called
            allowed = "numbers, names, + - * / **, brackets and functions of one line"
            hint = _HINTS.get(type(wrong), "Write it with what is allowed.")
            raise invalid("formula", described(type(wrong).__name__.lower()), allowed, hint)

    append(_tree(text), 0)
    formula = PostfixProgram(" ".join(text.split()), tuple(program))
    for name in names if motion else ():
        if name not in formula.names:
            shown = described(f"{formula.text!r} without {name}")
            remedy = "Use it in the formula, or leave it out of the declaration."
            raise invalid("formula", shown, f"every name that is declared, {name} too", remedy)
    return formula


def check_name(name: Any, motion: Iterable[str] = ()) -> None:
    """Refuse what is no name of a number in a formula."""
    taken = {*motion, "f", *FUNCTIONS, "min", "max", *_CONSTANTS}
    plain = isinstance(name, str) and name.isidentifier() and len(name) <= 40
    if not plain or keyword.iskeyword(name) or name in taken or name.startswith("__"):
        want = f"a name of letters and digits other than {', '.join(sorted(taken))}"
        raise invalid("parameters", name, want, "Rename it.")
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
    match body:
        case [ast.Assign(targets=[ast.Name(id="f")], value=expression)]:
            return expression
    remedy = "Begin with 'f =': the force on the first coordinate, the second gets the opposite."
    raise invalid("formula", text, f"one formula, {_EXAMPLE}", remedy)


def _number(key: str | Key, value: Any, infinite: bool = False) -> float:
    if infinite and value in ("inf", "-inf"):  # as JSON has them
        value = float(value)
    real = isinstance(value, int | float) and not isinstance(value, bool)
    try:
        number = float(value) if real else math.nan
    except OverflowError:
        number = math.nan
    if math.isnan(number) or (math.isinf(number) and not infinite):
        raise invalid(key, value, "a finite number", "Check the value.")
    return number


# Units of parameters as text, and what a formula makes of them.
#
# A unit is read in two ways: for translation, and for rotation, where ``N m`` is a torque and
# ``rad`` a displacement. The way in which the formula gives a force (or a torque) is the one that
# was meant.

_TOKEN = r"\s*([A-Za-zµμΩ°%]+|(?:\^|\*\*)\s*-?\d+(?:\.\d+)?|[*·/()]|1)"
_LONGEST_UNIT, _DEEPEST_UNIT = 80, 5
_WORD = r"[A-Za-zµμΩ°%]{1,20}"
_TAKEN = ("F", "L", "T", "M", "signal")  # letters of `Parameter.dimension`

_TRANSLATION: Mapping[str, Powers] = {
    "N": {"F": 1.0}, "m": {"L": 1.0}, "s": {"T": 1.0}, "kg": {"M": 1.0}, "rad": {},
    "Hz": {"T": -1.0},
}  # fmt: skip
# A torque is a force times a length that is none of the machine's angles.
_ROTATION: Mapping[str, Powers] = _TRANSLATION | {
    "N": {"F": 1.0, "metre": -1.0},
    "m": {"metre": 1.0},
    "kg": {"M": 1.0, "metre": -2.0},
    "rad": {"L": 1.0},
}
_MOTION: Mapping[str, Powers] = {"q": {"L": 1.0}, "v": {"L": 1.0, "T": -1.0}, "t": {"T": 1.0}}
_FORCE: Powers = {"F": 1.0}


def read_unit(text: Any, key: Key, others: Iterable[str] = ()) -> Powers:
    """Read an SI unit such as ``"N s/m"``.

    Parameters
    ----------
    text : str
        Units of ``N m s kg rad Hz``, ``1`` for none, with powers ``^2``, products by blanks or
        ``*``, ``/`` and brackets.
    key : tuple of str
        Where it stands, for the message.
    others : iterable of str, optional
        Further units that are known, such as the ``"V"`` of a channel.

    Returns
    -------
    dict of str to float
        The power of each unit.

    Raises
    ------
    InvalidInputError
        If it is no such unit.

    Examples
    --------
    >>> read_unit("N s/m", ("units", "c"))
    {'N': 1.0, 's': 1.0, 'm': -1.0}
    >>> read_unit("N/(m/s)^2", ("units", "c"))
    {'N': 1.0, 'm': -2.0, 's': 2.0}
    """
    known = (*_TRANSLATION, *others)
    expected = f"an SI unit of {' '.join(dict.fromkeys(known))}, such as 'N/m^5', or '1'"
    remedy = "Write it without prefixes (m, not mm): values are in SI units."
    bad = invalid(key, text, expected, remedy)
    if not isinstance(text, str) or len(text) > _LONGEST_UNIT:
        raise bad
    if not re.fullmatch(rf"(?:{_TOKEN})+\s*", text):
        raise bad
    tokens = re.findall(_TOKEN, text)

    def product(depth: int) -> Powers:
        """Take a product off the front of the tokens."""
        result, divided = factor(depth), False
        while tokens and tokens[0] != ")":
            mark = tokens.pop(0) if tokens[0] in ("*", "·", "/") else "*"
            if divided and mark != "/":  # N/m s: who knows what is meant
                raise bad
            divided = mark == "/"
            result = multiplied(result, factor(depth), -1.0 if divided else 1.0)
        return result

    def factor(depth: int) -> Powers:
        token = tokens.pop(0) if tokens and depth <= _DEEPEST_UNIT else ""
        powers: Powers = {token: 1.0} if token in known else {}
        if token == "(":
            powers = product(depth + 1)
            if not tokens or tokens.pop(0) != ")":
                raise bad
        elif token not in (*known, "1"):
            raise bad
        exponent = re.fullmatch(r"[\^*]+\s*(.+)", tokens[0]) if tokens else None
        if exponent:
            tokens.pop(0)
            powers = multiplied({}, powers, float(exponent[1]))
        return powers

    powers = product(0)
    if tokens:
        raise bad
    return powers


def channel_unit(text: Any, key: Key) -> str:
    """Return the unit of a channel: an SI unit, or any other word, such as ``"V"``."""
    word = isinstance(text, str) and re.fullmatch(_WORD, text)
    if word and text not in _TAKEN:
        return text
    if text in _TAKEN:
        raise invalid(key, text, "another word", "Write it in full, such as tesla.")
    read_unit(text, key)
    return text


def dimensions(
    formula: PostfixProgram, units: Mapping[str, str], channels: Mapping[str, str]
) -> dict[str, Powers]:
    """Return the dimension of each parameter, as the formula needs it.

    Parameters
    ----------
    formula : PostfixProgram
    units, channels : mapping of str to str
        Units of the parameters and of the channels.

    Returns
    -------
    dict of str to dict
        Powers of F, L, T, M and of units of channels.

    Raises
    ------
    InvalidInputError
        If a unit is none, or the formula does not make a force of them.
    """
    words = {name: channel_unit(text, ("channels", name)) for name, text in channels.items()}
    others = [text for text in words.values() if re.fullmatch(_WORD, text)]
    read = {name: read_unit(text, ("units", name), others) for name, text in units.items()}
    signals = {name: read_unit(text, ("channels", name), others) for name, text in words.items()}
    best, why = None, ""
    for table in (_TRANSLATION, _ROTATION):
        letters = {name: _in_letters(powers, table) for name, powers in {**read, **signals}.items()}
        try:
            loose = _loose(formula, letters, table is _ROTATION)
        except ArithmeticError as error:
            rotational = any("rad" in powers for powers in read.values())
            why = str(error) if not why or rotational else why
            continue
        # what is no unit of a rotation, such as the length of a pendulum, stays as it is
        found = {n: read[n] if "metre" in letters[n] else letters[n] for n in read}
        if not loose:
            return found
        best = best or found
    if best is not None:
        return best
    shown, want = f"{formula.text!r}, where {why}", "a force in N, or a torque in N m"
    raise misfit("formula", shown, want, "Check the units of the parameters, and brackets.")


def _in_letters(powers: Powers, table: Mapping[str, Powers]) -> Powers:
    result: Powers = {}
    for unit, power in powers.items():
        result = multiplied(result, table.get(unit, {unit: 1.0}), power)
    return result


def _loose(formula: PostfixProgram, names: Mapping[str, Powers], rotation: bool) -> bool:
    """Return whether the formula is a force only if its numbers have units.

    Raises
    ------
    ArithmeticError
        If it is none. Its text says why.
    """
    grades = {}
    for name, powers in {**_MOTION, **names}.items():
        # a mass is a force by an acceleration
        rest = {letter: power for letter, power in powers.items() if letter != "M"}
        counted = multiplied(rest, {"F": 1.0, "T": 2.0, "L": -1.0}, powers.get("M", 0.0))
        if rotation:  # an angle is a number, of which a sine may be taken
            counted.pop("L", None)
        grades[name] = Grade(counted)

    def shown(powers: Powers) -> str:
        metres = {"L": powers.get("F", 0.0) + powers.get("metre", 0.0)} if rotation else {}
        rest = {name: power for name, power in powers.items() if name != "metre"}
        units = {"F": "N", "L": "m", "T": "s", "M": "kg"}
        named = {units.get(name, name): p for name, p in multiplied(rest, metres).items()}
        return dimension_text(named, " ")

    whole = graded(formula, grades, loose_numbers=True, shown=shown)
    if whole.powers is not None and whole.powers != _FORCE and not whole.loose:
        raise ArithmeticError(f"f comes out in {shown(whole.powers)}")
    return whole.powers is None or (whole.loose and whole.powers != _FORCE)


def dimension_text(powers: Powers, times: str = "*") -> str:
    """Return powers as `Parameter.dimension` has them, or as a unit with blanks.

    Examples
    --------
    >>> dimension_text({"F": 1.0, "L": -5.0})
    'F/L^5'
    """
    parts = {name: f"{name}^{abs(p):g}" if abs(p) != 1 else name for name, p in powers.items()}
    over = times.join(parts[name] for name, power in powers.items() if power > 0)
    under = [f"/{parts[name]}" for name, power in powers.items() if power < 0]
    return "".join([over or "1", *under])


OWN_KEYS = ("formula", "units", "name", "title", "domain", "bounds", "scan", "known", "channels")
DOMAINS = ("pair", "dof")
_LONGEST_TEXT = 60  # characters of a name: it stands in tables
_MOST = 10  # parameters


@dataclass(frozen=True)
class EffectSpecification:
    """An effect as it was written; all else follows from it.

    Parameters
    ----------
    formula : str
    units : tuple of (str, str)
        Parameters and their units, in the order of the law.
    name, title : str, optional
        The formula by default.
    domain : {"pair", "dof"}, optional
    bounds : tuple of (str, (float, float)), optional
        Parameters with their least and largest value.
    scan : tuple of (str, tuple of float), optional
        Parameters with the values that a screening tries.
    known : tuple of (str, float), optional
        Parameters whose value is known and not fitted.
    channels : tuple of (str, str), optional
        Data columns that the formula names, and their units.
    """

    formula: str
    units: tuple[tuple[str, str], ...] = ()
    name: str = ""
    title: str = ""
    domain: str = "pair"
    bounds: tuple[tuple[str, tuple[float, ...]], ...] = ()
    scan: tuple[tuple[str, tuple[float, ...]], ...] = ()
    known: tuple[tuple[str, float], ...] = ()
    channels: tuple[tuple[str, str], ...] = ()

    @cached_property
    def program(self) -> PostfixProgram:
        """The formula, read."""
        return read_formula(self.formula, (*dict(self.units), *dict(self.channels)))

    def table(self) -> dict[str, Any]:
        """Return what stands in a file.

        Returns
        -------
        dict
        """
        found: dict[str, Any] = {}
        for field in fields(self):
            value = getattr(self, field.name)
            if value != field.default:
                if isinstance(value, tuple):
                    value = {n: list(v) if isinstance(v, tuple) else v for n, v in value}
                found[field.name] = value
        return found


def specification_from(table: Mapping[str, Any]) -> EffectSpecification:
    """Check a table of a file or the arguments of a call.

    Parameters
    ----------
    table : mapping
        Some of `OWN_KEYS`, "formula" at least.

    Returns
    -------
    EffectSpecification

    Raises
    ------
    InvalidInputError
        If something is of the wrong sort; the key says what.

    Examples
    --------
    >>> written = specification_from({"formula": "f = -k*q**5", "units": {"k": "N/m^5"}})
    >>> written.table()
    {'formula': 'f = -k*q**5', 'units': {'k': 'N/m^5'}}
    """
    found: dict[str, Any] = {}
    for key in ("units", "channels", "bounds", "scan", "known"):
        found[key] = {} if table.get(key) is None else table[key]
        if not isinstance(found[key], Mapping):
            raise invalid((key,), found[key], "a table by name", "Write one: {'k': 'N/m'}.")
    units, channels = found["units"], found["channels"]
    formula = read_formula(table.get("formula"), (*units, *channels))  # type: ignore[arg-type]
    if len(units) > _MOST:
        shown = described(f"{len(units)} parameters")
        raise invalid(("units",), shown, f"at most {_MOST}", "No record determines so many.")
    for name in channels:
        if name in units:
            raise invalid(("channels", name), name, "a name that no parameter has", "Rename one.")
    for key, checked in (("bounds", _bounds), ("scan", _values), ("known", _number)):
        for name in found[key]:
            if name not in units:
                listed = ", ".join(units) or "the parameters, of which there are none"
                raise invalid((key, str(name)), name, f"one of {listed}", "Check the spelling.")
        found[key] = {name: checked((key, name), value) for name, value in found[key].items()}
    for name in found["known"]:
        if name in found["scan"]:
            raise invalid(("known", name), name, "no values to scan", "It is known or scanned.")
    return EffectSpecification(
        formula.text,
        name=_text("name", table.get("name")),
        title=_text("title", table.get("title")),
        domain=one_of(("domain",), table.get("domain") or "pair", DOMAINS),
        **{key: tuple(named.items()) for key, named in found.items()},
    )


def _text(key: str, value: Any) -> str:
    if value is None:
        return ""
    if not isinstance(value, str) or not value.strip() or len(value) > _LONGEST_TEXT:
        raise invalid((key,), value, f"text of at most {_LONGEST_TEXT} characters", "Shorten it.")
    return " ".join(value.split())


def _bounds(key: Key, value: Any) -> tuple[float, ...]:
    pair = list(value) if isinstance(value, list | tuple) else []
    ends = [
        _number(key, end if end is not None else limit, infinite=True)
        for end, limit in zip(pair, (-math.inf, math.inf), strict=False)
    ]
    if len(pair) != 2 or not ends[0] < ends[1]:
        remedy = "Write None, or inf in a file, where there is no limit."
        raise invalid(key, value, "the least and the largest value", remedy)
    return tuple(ends)


def _values(key: Key, value: Any) -> tuple[float, ...]:
    if not isinstance(value, list | tuple) or not 1 <= len(value) <= 50:
        raise invalid(key, value, "one to 50 values", "Write a list in SI units.")
    return tuple(_number(key, item) for item in value)

"""Effects of your own: a formula, read safely, as a kind of effect like any other."""

from __future__ import annotations

import ast
import itertools
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import FunctionType
from typing import Any, Literal

import numpy as np

from robustpolish.base.checks import described, invalid
from robustpolish.errors import InvalidInputError, RobustPolishWarning
from robustpolish.machines.effects.effect import built_in, register
from robustpolish.machines.effects.evaluate import machine_code
from robustpolish.machines.effects.formula_language import (
    FUNCTIONS,
    OWN_KEYS,
    PAIRS,
    EffectSpecification,
    PostfixProgram,
    Powers,
    dimension_text,
    dimensions,
    grows_with,
    linear_in,
    multiplied,
    specification_from,
)
from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan, Steepness, Values

# What a screening tries of a formula: which parameters are solved for, and which are scanned.
#
# - A force that is a sum of terms with one parameter each as a factor is linear in these: their
#   sizes follow from the data at once.
# - Any other parameter is scanned: over the values that were given, or over shares of the amplitude
#   and the speed of the motion, from which its unit can be made.
# - Where a force enters nonlinearly, as in ``-F*tanh(k*q/F)``, the whole law still grows with all
#   its forces together. One of them is solved for, the others are scanned in proportion to it.

_SHARES = (0.03, 0.1, 0.3, 0.8)
"""Of the amplitude or speed: thresholds and widths far below it do not show in the force."""
_OVER = (0.3, 1.25, 3.0, 10.0)
"""The same of what is divided by amplitude or speed: slopes over a force, for a knee at 1/10."""
_MOST = 200
"""Combinations of scanned values; each is filtered at each place."""


@dataclass(frozen=True)
class ScreeningPlan:
    """How a screening finds first values.

    Parameters
    ----------
    linear_in : tuple of str
        Parameters that are solved for.
    scan : tuple of Scan
        Values of the others.
    together : tuple of str
        Parameters that grow together and are therefore positive.
    missing : str
        Why nothing can be tried, or "".
    remedy : str
        What to do about it.
    unknown : tuple of str
        Parameters of which values have to be given.
    """

    linear_in: tuple[str, ...] = ()
    scan: tuple[Scan, ...] = ()
    together: tuple[str, ...] = ()
    missing: str = ""
    remedy: str = ""
    unknown: tuple[str, ...] = ()


def candidates(
    formula: PostfixProgram,
    powers: Mapping[str, Powers],
    given: Mapping[str, Sequence[float]],
) -> ScreeningPlan:
    """Return what a screening tries of a formula.

    Parameters
    ----------
    formula : PostfixProgram
    powers : mapping of str to dict
        Dimensions of the parameters, see :func:`dimensions`.
    given : mapping of str to sequence of float
        Values to try, by parameter, in SI units.

    Returns
    -------
    ScreeningPlan

    Raises
    ------
    InvalidInputError
        If there are too many values.
    """
    if not powers:
        return ScreeningPlan()
    by_force = {name: p.get("F", 0) + p.get("M", 0) for name, p in powers.items()}
    forces = [name for name in powers if by_force[name] == 1]
    free = [name for name in dict.fromkeys((*forces, *powers)) if name not in given]
    # the most parameters that the force is linear in together, the first ones first
    counts = range(len(free), 0, -1)
    sets = (names for count in counts for names in itertools.combinations(free, count))
    solved = next((names for names in sets if linear_in(formula, names)), ())
    together: list[str] = []
    bent = [name for name in powers if by_force[name] and name not in solved]
    if bent:
        together = forces
        if any(by_force[name] != 1 for name in bent) or not grows_with(formula, forces):
            why = f"{formula.text!r}, which is not proportional to {', '.join(bent)}"
            return ScreeningPlan(missing=why, remedy="Give it factors that it is proportional to.")
        half_given = [name for name in forces if name in given]
        solved = () if len(half_given) == len(forces) else (forces[0],)
        if half_given and solved:
            remedy = f"They grow together: give values of {', '.join(forces)}, or of none."
            return ScreeningPlan(missing=f"values of {', '.join(half_given)} alone", remedy=remedy)
    elif not solved:
        why = f"{formula.text!r}, which is proportional to no parameter"
        return ScreeningPlan(missing=why, remedy="Give it a factor in front.")
    scan, unknown = [], []
    for name in (name for name in powers if name not in solved):
        unit = powers[solved[0]] if solved and name in together else {}
        size = _size(multiplied(powers[name], unit, -1.0))
        if name in given:
            scan.append(Scan(name, "1", tuple(given[name])))
        elif size is not None:
            scan.append(Scan(name, size, _SHARES if sum(size) > 0 else _OVER))
        else:
            unknown.append(name)
    if unknown:
        example = ", ".join(f"{name!r}: (0.5, 1.0, 2.0)" for name in unknown)
        return ScreeningPlan(
            missing=f"{formula.text!r}, which is not proportional to {', '.join(unknown)}, "
            "and the motion gives no size for it",
            remedy=f"Say which values to try: scan={{{example}}}.",
            unknown=tuple(unknown),
        )
    combinations = math.prod(len(s.shares) for s in scan)
    if combinations > _MOST:
        shown = described(f"{combinations} combinations of {', '.join(s.parameter for s in scan)}")
        raise invalid("scan", shown, f"at most {_MOST}", "Give fewer values of each.")
    return ScreeningPlan(solved, tuple(scan), tuple(together))


def _size(powers: Powers) -> tuple[float, float] | None:
    """Return the powers of amplitude and speed that have a unit, None if none have."""
    F, L, T, M = (powers.get(letter, 0) for letter in "FLTM")
    length, time = L - M, T + 2 * M  # a mass is a force over an acceleration
    if F + M or not powers.keys() <= {*"FLTM"} or not (length or time):
        return None
    return length + time, -time


# The force law that a formula says: called from Python, or compiled to machine code.

_CORNERS = frozenset({"abs", "sign", "min", "max"})
_HIGHEST = 64  # whole powers up to this one are multiplied out, by repeated squaring
_ARITHMETIC = {"+": ast.Add, "-": ast.Sub, "*": ast.Mult, "/": ast.Div}
_SIGNALS = (-10.0, -1.0, 0.0, 1.0, 10.0)  # of a channel, in its unit: signals end at 10 V
_GRID = 33  # odd: with the middle, where friction is steepest


@dataclass(frozen=True)
class FormulaLaw(EffectSpecification):
    """The law of an effect that somebody wrote as a formula.

    It is equal to another one that says the same, and can be pickled.
    """

    def __call__(self, t: float, q: Any, v: Any, z: Any, p: Any, f: Any, dz: Any) -> None:
        """Write the force, as every law does."""
        f[0] = self.program.value(self._values(t, q, v, p))

    def _values(self, t: Any, q: Any, v: Any, p: Any) -> dict[str, Any]:
        values = {"t": t, "q": q[0], "v": v[0]}
        values.update((name, p[i]) for i, (name, _) in enumerate(self.units))
        values.update((name, q[1 + i]) for i, (name, _) in enumerate(self.channels))
        return values

    @property
    def sharp(self) -> bool:
        """Whether the force may have corners."""
        return bool(self.program.operations & _CORNERS)

    def steepness(self, values: Values, q: float, v: float) -> Steepness:
        """Return the largest stiffness and damping up to these amplitudes, and no rate."""
        grid = np.linspace(-1.0, 1.0, _GRID)
        along = {"q": q * grid[:, None], "v": v * grid[None, :], "t": 0.0, **values}
        largest = {"q": 0.0, "v": 0.0}
        for level in _SIGNALS if self.channels else (0.0,):
            along.update((name, level) for name, _ in self.channels)
            for name, amplitude in (("q", q), ("v", v)):
                if amplitude == 0 or name not in self.program.names:
                    continue
                step = 1e-6 * amplitude
                ends = [self.program.value({**along, name: along[name] + d}) for d in (-step, step)]
                with np.errstate(all="ignore"):
                    slopes = np.abs(np.asarray(ends[1]) - ends[0]) / (2 * step)
                found = float(np.max(slopes, where=np.isfinite(slopes), initial=0.0))
                largest[name] = max(largest[name], found)
        return largest["q"], largest["v"], 0.0

    def compiled(self) -> Any:
        """Return the law compiled to the signature of all laws.

        The operations that were read are put together as a syntax tree: no text is executed, and
        no file holds the result, which would be found again under the name of another formula.
        """
        return machine_code(_function(self), cache=False)


def operation_node(operation: str, *operands: ast.expr) -> ast.expr:
    """Return the syntax tree of an operation of a formula."""
    if operation == "negative":
        return ast.UnaryOp(ast.USub(), operands[0])
    if operation in _ARITHMETIC:
        return ast.BinOp(operands[0], _ARITHMETIC[operation](), operands[1])
    exponent: Any = getattr(operands[-1], "value", None)  # of a number
    whole = isinstance(exponent, float) and exponent.is_integer()
    if operation == "**" and whole and abs(exponent) <= _HIGHEST:
        power = ast.BinOp(operands[0], ast.Pow(), ast.Constant(abs(int(exponent))))
        return ast.BinOp(ast.Constant(1.0), ast.Div(), power) if exponent < 0 else power
    return ast.Call(ast.Name(operation, ast.Load()), list(operands), [])


def function_of(tree: ast.Module) -> Any:
    """Return the one function of a syntax tree, which knows the functions of formulas alone."""
    code = compile(ast.fix_missing_locations(tree), "<formula>", "exec").co_consts[0]
    return FunctionType(code, {**FUNCTIONS, **PAIRS, "__name__": __name__})


def _function(law: FormulaLaw) -> Callable[..., None]:
    """Return the law as a Python function, made of the operations that were read and no others."""
    places = {"t": "t", "q": "q[0]", "v": "v[0]"}
    places.update((name, f"p[{i}]") for i, (name, _) in enumerate(law.units))
    places.update((name, f"q[{1 + i}]") for i, (name, _) in enumerate(law.channels))

    def leaf(item: float | str) -> ast.expr:
        if isinstance(item, str):
            return ast.parse(places[item], mode="eval").body
        return ast.Constant(item)

    tree = ast.parse("def law(t, q, v, z, p, f, dz):\n    f[0] = 0.0")
    tree.body[0].body[0].value = law.program.fold(leaf, operation_node)  # type: ignore[attr-defined]
    return function_of(tree)


# Effects of your own: a kind made of a formula, offered to a diagnosis, read from files.

Range = tuple[float | None, float | None]


def effect(
    formula: str,
    parameters: Mapping[str, str] | None = None,
    *,
    name: str | None = None,
    title: str | None = None,
    domain: Literal["pair", "dof"] = "pair",
    bounds: Mapping[str, Range] | None = None,
    scan: Mapping[str, Sequence[float]] | None = None,
    known: Mapping[str, float] | None = None,
    channels: Mapping[str, str] | None = None,
) -> EffectKind:
    """Define a physical effect by a formula, and offer it to every later diagnosis.

    The formula is read, never executed. Calling it again replaces an effect of the same name;
    models that were made with the former one keep it.

    Parameters
    ----------
    formula : str
        ``"f = ..."``: the force in N (torque in N m) on the first coordinate of a place, the second
        gets the opposite; a spring is ``"f = -k*q"``. It may name the relative displacement q and
        velocity v, the time t and the parameters, and use numbers, ``+ - * / **``, brackets, pi,
        sin, cos, tan, exp, log, sqrt, abs, sign, tanh, arctan, min and max.
    parameters : mapping of str to str, optional
        SI units of the parameters by name, such as ``{"k": "N/m^5"}``; ``"1"`` for none. At a
        rotation N is read as N m and m as rad.
    name : str, optional
        What it is called in models and tables; the formula by default.
    title : str, optional
        For people; the name by default.
    domain : {"pair", "dof"}, optional
        Whether it acts between two coordinates (or one and ground), or on one.
    bounds : mapping of str to (float or None, float or None), optional
        Least and largest value of parameters, None where there is no limit.
    scan : mapping of str to sequence of float, optional
        Values in SI units that a screening tries of parameters to which the force is not
        proportional. By default shares of the amplitude, of the speed, or of what their unit makes
        of these two; only a parameter without unit needs its values.
    known : mapping of str to float, optional
        Values in SI units of parameters that are known: they are neither scanned nor fitted.
    channels : mapping of str to str, optional
        Data columns that the formula names, with their units, such as ``{"u": "V"}``. Between
        samples they are straight lines. A diagnosis tries the effect in models that have them,
        see :meth:`MechanicalModel.with_channel`.

    Returns
    -------
    EffectKind
        For ``model.with_effect(kind, at, {"k": 3.0})``; its name does as well.

    Raises
    ------
    InvalidInputError
        If the formula is none or makes no force of the units, if the name belongs to the catalogue,
        or if `scan` lacks a parameter. The message says what to do.

    Warns
    -----
    RobustPolishWarning
        If the force is proportional to no parameter, so that a diagnosis cannot try it.

    Examples
    --------
    >>> import robustpolish as rp
    >>> fifth = rp.effect("f = -k*q**5", parameters={"k": "N/m^5"})
    >>> model = rp.MechanicalModel([rp.Dof("x", 2.0)], outputs=[rp.Output("x", ("x", "ground"))])
    >>> model = model.with_effect(fifth, ("x", "ground"), {"k": 3.0})
    >>> model.effects[0].kind, rp.MechanicalModel.from_toml(model.to_toml()) == model
    ('f = -k*q**5', True)

    To withdraw it from later diagnoses:

    >>> from robustpolish.effects import unregister
    >>> unregister(fifth.kind)
    """
    given = {
        "formula": formula,
        "units": parameters,
        "name": name,
        "title": title,
        "domain": domain,
        "bounds": bounds,
        "scan": scan,
        "known": known,
        "channels": channels,
    }
    try:
        kind, tried = _build_kind(given)
    except InvalidInputError as error:
        if error.key[:1] != ("units",):
            raise
        text = str(error).replace("units", "parameters", 1)  # as the argument is called here
        raise InvalidInputError(text, ("parameters", *error.key[1:])) from None
    if tried.unknown:
        raise invalid("scan", described(tried.missing), "values to try", tried.remedy)
    if tried.missing:
        warnings.warn(
            f"A diagnosis cannot try {tried.missing}; simulation and refit can. {tried.remedy}",
            RobustPolishWarning,
            stacklevel=2,
        )
    return register(kind)


def own_kind(table: Mapping[str, Any]) -> EffectKind:
    """Return the kind that a table of a file describes, without offering it to anybody.

    Parameters
    ----------
    table : mapping
        As :func:`own_table` gives it.

    Returns
    -------
    EffectKind

    Raises
    ------
    InvalidInputError
        As :func:`effect`, but a law that could not be screened is welcome. The key of the error
        says where in the table.

    Examples
    --------
    >>> kind = own_kind({"formula": "f = -c*v**3", "units": {"c": "N s^3/m^3"}})
    >>> kind.parameter("c").unit(), own_table(kind)
    ('N s^3/m^3', {'formula': 'f = -c*v**3', 'units': {'c': 'N s^3/m^3'}})
    """
    for key in table:
        if key not in OWN_KEYS:
            raise invalid((key,), described("an unknown key"), ", ".join(OWN_KEYS), "Correct it.")
    return _build_kind(table)[0]


def own_table(kind: EffectKind) -> dict[str, Any] | None:
    """Return the table that describes a kind made of a formula, or None for any other.

    Parameters
    ----------
    kind : EffectKind

    Returns
    -------
    dict or None
    """
    return kind.law.table() if isinstance(kind.law, FormulaLaw) else None


def _build_kind(table: Mapping[str, Any]) -> tuple[EffectKind, ScreeningPlan]:
    """Return the kind, and what a screening tries of it."""
    law = FormulaLaw(**vars(specification_from(table)))
    name = law.name or law.formula
    if name in built_in():
        raise invalid(("name",), name, "a name that the catalogue does not have", "Rename it.")
    units, known, limits = dict(law.units), dict(law.known), dict(law.bounds)
    given = {**dict(law.scan), **{symbol: (value,) for symbol, value in known.items()}}
    powers = dimensions(law.program, units, dict(law.channels))
    tried = candidates(law.program, powers, given)
    finished = []
    for symbol in units:
        least = 0.0 if symbol in tried.together else -math.inf
        lower, upper = limits.get(symbol, (least, math.inf))
        default = given.get(symbol, (0.0 if symbol in tried.linear_in else 1.0,))[0]
        default, free = min(max(default, lower), upper), symbol not in known
        unit, meaning = dimension_text(powers[symbol]), f"{symbol} in {law.formula}"
        finished.append(Parameter(symbol, unit, meaning, lower, upper, default, free))
    kind = EffectKind(
        kind=name,
        title=law.title or name,
        domain=law.domain,  # type: ignore[arg-type]  # checked by specification_from
        parameters=tuple(finished),
        law=law,
        linear_in=tried.linear_in,
        scan=tried.scan,
        channels=law.channels,
        sharp=law.sharp,
        looks_like=f"A force that follows {law.formula}.",
    )
    return kind, tried

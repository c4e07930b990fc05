"""Effects of your own: a kind made of a formula, offered to a diagnosis, read from files."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from robustpolish.effects.effect import BUILT_IN, register
from robustpolish.effects.kind import EffectKind, Parameter
from robustpolish.effects.own.candidates import Candidates, candidates
from robustpolish.effects.own.law import FormulaGains, FormulaLaw
from robustpolish.effects.own.units import dimension_text, dimensions
from robustpolish.effects.own.written import OWN_KEYS, Written, written_from
from robustpolish.errors import InvalidInputError, RobustPolishWarning
from robustpolish.validation import described, invalid

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
        kind, tried = _made(written_from(given))
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
    return _made(written_from(table))[0]


def own_table(kind: EffectKind) -> dict[str, Any] | None:
    """Return the table that describes a kind made of a formula, or None for any other.

    Parameters
    ----------
    kind : EffectKind

    Returns
    -------
    dict or None
    """
    return kind.law.written.table() if isinstance(kind.law, FormulaLaw) else None


def _made(written: Written) -> tuple[EffectKind, Candidates]:
    """Return the kind, and what a screening tries of it."""
    name = written.name or written.formula
    if name in BUILT_IN:
        raise invalid(("name",), name, "a name that the catalogue does not have", "Rename it.")
    law = FormulaLaw(written)
    units, known = dict(written.units), dict(written.known)
    given = {**dict(written.scan), **{symbol: (value,) for symbol, value in known.items()}}
    powers = dimensions(law.formula, units, dict(written.channels))
    parameters = [
        Parameter(symbol, dimension_text(powers[symbol]), f"{symbol} in {written.formula}")
        for symbol in units
    ]
    tried = candidates(law.formula, parameters, given)
    limits = {symbol: (lower, upper) for symbol, lower, upper in written.bounds}
    finished = []
    for p in parameters:
        least = 0.0 if p.name in tried.together else -math.inf
        lower, upper = limits.get(p.name, (least, math.inf))
        default = given.get(p.name, (0.0 if p.name in tried.linear_in else 1.0,))[0]
        default = min(max(default, lower), upper)
        free = p.name not in known
        finished.append(replace(p, lower=lower, upper=upper, default=default, fitted=free))
    kind = EffectKind(
        kind=name,
        title=written.title or name,
        domain=written.domain,  # type: ignore[arg-type]  # checked by written_from
        parameters=tuple(finished),
        law=law,
        linear_in=tried.linear_in,
        scan=tried.scan,
        gains=FormulaGains(law),
        channels=written.channels,
        sharp=law.sharp,
        looks_like=f"A force that follows {written.formula}.",
    )
    return kind, tried

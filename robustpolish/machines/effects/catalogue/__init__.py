"""The built-in kinds of effects: what a file declares of them, and the functions of a family."""

from collections.abc import Callable, Mapping
from typing import Any

from robustpolish.base.texts import tables
from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan

_DECLARED = tables(__file__, "kinds.toml")


def declared(
    kind: str,
    *,
    fit_bounds: Mapping[str, Callable[..., Any]] | None = None,
    fit_size: Mapping[str, Callable[..., Any]] | None = None,
    **functions: Any,
) -> EffectKind:
    """Return a kind of the file with the functions by which it acts.

    Parameters
    ----------
    kind : str
    fit_bounds, fit_size : mapping of str to callable, optional
        Of parameters, by their names; see :class:`Parameter`.
    functions : callable
        Of the kind; see :class:`EffectKind`.
    """
    fields = {name: _frozen(value) for name, value in _DECLARED[kind].items()}
    own = {"fit_bounds": fit_bounds or {}, "fit_size": fit_size or {}}
    for parameter in fields["parameters"]:
        name = parameter["name"]
        parameter |= {field: given[name] for field, given in own.items() if name in given}
    fields["parameters"] = tuple(Parameter(**each) for each in fields["parameters"])
    fields["scan"] = tuple(Scan(**each) for each in fields.get("scan", ()))
    return EffectKind(kind, **fields, **functions)


def _frozen(value: Any) -> Any:
    """Return lists, within lists and tables too, as tuples."""
    if isinstance(value, dict):
        return {key: _frozen(item) for key, item in value.items()}
    return tuple(map(_frozen, value)) if isinstance(value, list) else value

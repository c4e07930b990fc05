"""The built-in kinds of effects: what a file declares of them, and the functions of a family."""

from collections.abc import Mapping
from typing import Any

from robustpolish.base.results import tables
from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan

_DECLARED = tables(__file__, "kinds.toml")


def declared(functions: Mapping[str, Any]) -> tuple[EffectKind, ...]:
    """Return the kinds of the file that a family has functions for, in the order of the file.

    Parameters
    ----------
    functions : mapping of str to callable
        The globals of the family's module. A function ``_KIND_FIELD`` gives that field of
        :class:`EffectKind`, and ``_KIND_PARAMETER_FIELD`` that of a :class:`Parameter`, as in
        ``_dahl_friction_law`` and ``_contact_stop_gap_fit_bounds``.
    """
    kinds = []
    for kind, table in _DECLARED.items():
        start = f"_{kind}_"
        own = {n.removeprefix(start): f for n, f in functions.items() if n.startswith(start)}
        if own:
            fields = {name: _frozen(value) for name, value in table.items()}
            for parameter in fields["parameters"]:
                ways = {way: f"{parameter['name']}_{way}" for way in ("fit_bounds", "fit_size")}
                parameter |= {way: own.pop(name) for way, name in ways.items() if name in own}
            fields["parameters"] = tuple(Parameter(**each) for each in fields["parameters"])
            fields["scan"] = tuple(Scan(**each) for each in fields.get("scan", ()))
            kinds.append(EffectKind(kind, **fields, **own))
    return tuple(kinds)


def _frozen(value: Any) -> Any:
    """Return lists, within lists and tables too, as tuples."""
    if isinstance(value, dict):
        return {key: _frozen(item) for key, item in value.items()}
    return tuple(map(_frozen, value)) if isinstance(value, list) else value

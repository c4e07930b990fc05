"""The catalogue: built-in kinds and those of installed packages."""

from __future__ import annotations

import warnings
from functools import lru_cache
from importlib import import_module
from importlib.metadata import entry_points

from robustpolish.effects.kind import EffectKind
from robustpolish.errors import RobustPolishWarning
from robustpolish.validation import invalid

ENTRY_POINT_GROUP = "robustpolish.effects"
BUILT_IN = (
    "coulomb_friction",
    "stribeck_friction",
    "elastic_coulomb_friction",
    "lugre_friction",
    "quadratic_damping",
    "displacement_dependent_damping",
    "bouc_wen_hysteresis",
    "cubic_stiffness",
    "quadratic_stiffness",
    "backlash",
    "contact_stop",
    "pendulum_gravity",
    "constant_force",
    "harmonic_force",
    "unbalance",
    "parametric_stiffness",
    "gyroscopic_coupling",
    "cross_stiffness",
    "attached_resonator",
    "input_delay",
    "input_gain",
    "input_hold",
    "sensor_offset",
    "sensor_gain",
)
_registered: dict[str, EffectKind] = {}


def register(kind: EffectKind) -> EffectKind:
    """Add a kind of effect to the catalogue of this process.

    A package that is installed does the same without a call, with an entry
    point in the group ``robustpolish.effects`` that names an `EffectKind`.

    Parameters
    ----------
    kind : EffectKind

    Returns
    -------
    EffectKind

    Raises
    ------
    InvalidInputError
        If it is no EffectKind, or the name is taken by another.
    """
    if not isinstance(kind, EffectKind):
        raise invalid("kind", kind, "an EffectKind", "Build one, see 'How to add an effect'.")
    present = _catalogue().get(kind.kind)
    if present is not None and present != kind:
        raise invalid("kind.kind", kind.kind, "a name that is not taken", "Choose another name.")
    _registered[kind.kind] = kind
    return kind


def kinds() -> dict[str, EffectKind]:
    """Return the catalogue, by name.

    Examples
    --------
    >>> kinds()["cubic_stiffness"].parameter("stiffness").unit()
    'N/m^3'
    """
    return {**_catalogue(), **_registered}


def lookup(name: str) -> EffectKind:
    """Return the kind called `name`.

    Parameters
    ----------
    name : str

    Returns
    -------
    EffectKind

    Raises
    ------
    InvalidInputError
        If the catalogue has none of that name.
    """
    kind = _registered.get(name) or _catalogue().get(name)
    if kind is None:
        raise invalid(
            ("effect", "kind"), name, f"one of {', '.join(kinds())}", "Check the spelling."
        )
    return kind


@lru_cache(maxsize=1)
def _catalogue() -> dict[str, EffectKind]:
    found: dict[str, EffectKind] = {
        name: import_module(f"robustpolish.effects.catalogue.{name}").KIND for name in BUILT_IN
    }
    for point in entry_points(group=ENTRY_POINT_GROUP):
        try:
            kind = point.load()
        except Exception as error:  # a broken plug-in must not take the catalogue down
            warnings.warn(
                f"effect {point.name!r} of {point.value} cannot be loaded: {error}",
                RobustPolishWarning,
                stacklevel=2,
            )
            continue
        if isinstance(kind, EffectKind):
            found.setdefault(kind.kind, kind)
    return found

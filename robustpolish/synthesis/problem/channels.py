"""Parts of a plant's disturbances and performance outputs, by name."""

from __future__ import annotations

from collections.abc import Sequence

from robustpolish.models import GeneralizedPlant
from robustpolish.validation import invalid

Channel = tuple[Sequence[str] | str, Sequence[str] | str]


def channel(
    plant: GeneralizedPlant, disturbances: Sequence[str] | str, performance: Sequence[str] | str
) -> GeneralizedPlant:
    """Return the plant with only the named w and z; x, u and y stay.

    Parameters
    ----------
    plant : GeneralizedPlant
    disturbances, performance : sequence of str, or str
        Names of the disturbances and performance outputs to keep, in this order.

    Returns
    -------
    GeneralizedPlant

    Raises
    ------
    InvalidInputError
        If a name is unknown or repeated.

    Examples
    --------
    >>> import robustpolish as rp
    >>> channel(rp.air_bearing(), "F_x", ["x", "y"]).performance_names
    ('x', 'y')
    """
    w = _places("disturbances", disturbances, plant.disturbance_names)
    z = _places("performance", performance, plant.performance_names)
    return plant.part(disturbances=w, performance=z)


def _places(argument: str, names: Sequence[str] | str, known: Sequence[str]) -> list[int]:
    wanted = [names] if isinstance(names, str) else list(names)
    if any(name not in known for name in wanted) or len(set(wanted)) != len(wanted) or not wanted:
        listed = ", ".join(known)
        raise invalid(argument, names, f"different names out of {listed}", "Check their spelling.")
    return [list(known).index(name) for name in wanted]

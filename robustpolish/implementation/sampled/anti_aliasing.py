"""Analogue filters before the samplers, which stay continuous in every check."""

from __future__ import annotations

import control
import numpy as np

from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.elements import lag
from robustpolish.models.plant.given_system import as_state_space
from robustpolish.validation import described, invalid, positive, state_space

AntiAliasing = (
    float | int | tuple[int, float] | control.StateSpace | control.TransferFunction | None
)
"""None, a corner in Hz (Butterworth, second order), (order, corner in Hz), or a filter."""

_REMEDY = "Pass a corner in Hz, (order, corner in Hz), or a stable continuous system."


def filter_system(anti_aliasing: AntiAliasing, measurements: int) -> control.StateSpace | None:
    """Return the filter of all measurements as one system.

    Parameters
    ----------
    anti_aliasing : number, (int, number), control system or None
        A corner in Hz: a Butterworth filter of second order, or of the order given, for each
        measurement. A system with one input and output filters each measurement alike.
    measurements : int
        Number of signals to filter.

    Returns
    -------
    control.StateSpace or None

    Raises
    ------
    InvalidInputError
        If it is no such filter, or not stable.
    """
    if anti_aliasing is None:
        return None
    if isinstance(anti_aliasing, control.TransferFunction):
        anti_aliasing = as_state_space("anti_aliasing", anti_aliasing)
    if isinstance(anti_aliasing, control.StateSpace):
        return _repeated(_checked(anti_aliasing, measurements), measurements)
    if isinstance(anti_aliasing, tuple | list):
        if len(anti_aliasing) != 2:
            raise invalid("anti_aliasing", anti_aliasing, "(order, corner in Hz)", _REMEDY)
        order, corner = anti_aliasing
    else:
        order, corner = 2, anti_aliasing
    if isinstance(corner, bool | str) or isinstance(order, bool):
        raise invalid("anti_aliasing", anti_aliasing, "a filter or its corner in Hz", _REMEDY)
    if not isinstance(order, int | np.integer) or not 1 <= order <= 8:
        raise invalid("anti_aliasing", order, "a whole order from 1 to 8", _REMEDY)
    corner = positive("anti_aliasing", corner, "Hz")
    return _repeated(lag(corner, int(order), None, 0), measurements)


def with_filter(plant: GeneralizedPlant, found: control.StateSpace | None) -> GeneralizedPlant:
    """Return the plant whose measurements have passed the filter; w that acts on y does so too.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous.
    found : control.StateSpace or None

    Returns
    -------
    GeneralizedPlant
        With the delays of the plant, which stand before the filter.
    """
    if found is None:
        return plant
    wiring = plant.wiring
    return plant.rewired(wiring.matrix_series(wiring.nz, found, "filter"))


def _checked(found: control.StateSpace, measurements: int) -> control.StateSpace:
    state_space("anti_aliasing", found)
    if found.dt not in (0, None):
        shown = described(f"a discrete system, dt = {found.dt}")
        raise invalid("anti_aliasing", shown, "a continuous filter", _REMEDY)
    if (found.ninputs, found.noutputs) not in ((1, 1), (measurements, measurements)):
        shown = described(f"{found.ninputs} inputs and {found.noutputs} outputs")
        raise invalid("anti_aliasing", shown, f"1 or {measurements} of each", _REMEDY)
    if found.nstates and np.linalg.eigvals(found.A).real.max() >= 0:
        raise invalid("anti_aliasing", described("an unstable filter"), "a stable one", _REMEDY)
    return found


def _repeated(found: control.StateSpace, measurements: int) -> control.StateSpace:
    if found.ninputs == measurements:
        return found
    one = np.eye(measurements)
    return control.StateSpace(
        *(np.kron(one, np.asarray(M)) for M in (found.A, found.B, found.C, found.D)),
        0,
        remove_useless_states=False,
    )

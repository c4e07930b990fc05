"""Analogue filters before the samplers, which stay continuous in every check."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from scipy import signal

from robustpolish.arrays import Matrix
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import named_system
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
        anti_aliasing = _realised(anti_aliasing)
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
    rate = 2 * np.pi * positive("anti_aliasing", corner, "Hz")
    poles = signal.buttap(int(order))[1]
    return _repeated(control.StateSpace(*_sections(poles * rate), 0), measurements)


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

    Raises
    ------
    InvalidInputError
        If there is a filter, and the plant has delays that it would have to stand behind.
    """
    if found is None:
        return plant
    if plant.delays:
        named = ", ".join(plant.delays)
        remedy = "Put the filter into the plant: plant.with_filter(measurement, filter)."
        shown = described(f"a filter beside a plant with delays of {named}")
        raise invalid("anti_aliasing", shown, "none, or a plant without delays", remedy)
    F, n, nf = found, plant.nx, found.nstates
    A = np.block([[plant.A, np.zeros((n, nf))], [F.B @ plant.C2, F.A]])
    B = np.block([[plant.B1, plant.B2], [F.B @ plant.D21, F.B @ plant.D22]])
    C = np.block([[plant.C1, np.zeros((plant.nz, nf))], [F.D @ plant.C2, F.C]])
    D = np.block([[plant.D11, plant.D12], [F.D @ plant.D21, F.D @ plant.D22]])
    whole = plant.system
    states = [*plant.states, *(f"filter_{i + 1}" for i in range(nf))]
    system = named_system((A, B, C, D), 0, whole.input_labels, whole.output_labels, states)
    kept = {*whole.input_labels, *whole.output_labels, *plant.states}
    units = {name: unit for name, unit in plant.units.items() if name in kept}
    return GeneralizedPlant(system, plant.measurements, plant.controls, units)


def _sections(poles: Any) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Realise a low-pass of gain one by its poles, section after section, alike in size."""
    A, B, C = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    direct = np.eye(1)
    rising = [p for p in poles if p.imag > 1e-9 * abs(p)]
    real = [p for p in poles if abs(p.imag) <= 1e-9 * abs(p)]
    parts = []
    for p in rising:
        size = abs(p)
        parts.append((np.array([[0.0, size], [-size, 2 * p.real]]), np.array([[0.0], [size]])))
    parts += [(np.array([[p.real]]), np.array([[-p.real]])) for p in real]
    for a, b in parts:
        n, k = A.shape[0], a.shape[0]
        c = np.eye(1, k)
        A = np.block([[A, np.zeros((n, k))], [b @ C, a]])
        B = np.vstack([B, b @ direct])
        C, direct = np.hstack([np.zeros((1, n)), c]), np.zeros((1, 1))
    return A, B, C, direct


def _realised(found: control.TransferFunction) -> control.StateSpace:
    try:
        with np.errstate(all="ignore"):
            realised: Any = control.ss(found)
            return realised
    except Exception:
        shown = described(f"a transfer function that has no realisation: {found.num}/{found.den}")
        raise invalid("anti_aliasing", shown, "a proper transfer function", _REMEDY) from None


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

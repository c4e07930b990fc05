"""A linear system under the listing's forces, integrated the way the thesis did it."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from robustpolish.brush.dataset import (
    parameters_from_attributes,
    quantity,
    time_coordinate,
)
from robustpolish.brush.dormand_prince import NODES, STAGES, inside_step, stage_state
from robustpolish.brush.listing import ode45
from robustpolish.brush.listing.defects import ListingDefects
from robustpolish.brush.listing.equations import (
    BEARING_GATE,
    FORCE_P,
    GRAVITY_TERMS,
    INTERPOLATION_WEIGHT,
    MASS,
    POLISHING_FORCE_DROPPED,
    impact,
    listing_constants,
)
from robustpolish.brush.listing.motion import forces_of_contact
from robustpolish.brush.listing.run import force_divisor
from robustpolish.compiling import njit
from robustpolish.errors import SolverError
from robustpolish.validation import described, invalid, matrix, positive

_GRAVITY = 9.81
_REFINE = 4  # ode45 shows four values per step; the largest deviation is read from them
_BEARING_VELOCITY, _BEARING_HEIGHT, _BRUSH_HEIGHT = 1, 8, 10  # w(2), w(9), w(11) of D.2


def listing_response(
    A: ArrayLike,
    B1: ArrayLike,
    C: ArrayLike,
    brush: xr.Dataset,
    *,
    bearing_mass: float | None = None,
    tolerance: float = 1e-3,
    sample_rate: float = 20e3,
) -> xr.Dataset:
    r"""Simulate x' = A x + B1 F(t, x), y = C x from rest under the listing's forces.

    The forces are evaluated inside the right-hand side from the stored brush states, which the
    listings interpolate wrongly (`ListingDefects.interpolation_weight`), so that they jump from
    one evaluation to the next. The answer therefore belongs to this integrator, ode45, and
    its tolerance; it is a reproduction, not a simulation. For any other purpose use an exact linear
    response to a `physical` run.

    Parameters
    ----------
    A : array_like, shape (12, 12)
        Closed or open loop; states (x_m, x_m', x, x', y_m, ..., z, z').
    B1 : array_like, shape (12, 4)
        How F_x, F_y, F_z, F_p [N] enter; the thesis has (10.39) with a controller, where F_y
        drives x, and (8.47) without.
    C : array_like, shape (p, 12)
        Outputs. The tables of chapter 11 show the total displacements x_m + x, y_m + y, z_m + z.
    brush : xarray.Dataset
        From ``simulate_brush("listing", ...)``; its attributes tell the mistakes and the
        workaround. The tables need its default sample rate, 1e5 Hz.
    bearing_mass : float, optional
        m_z [kg]: follow D.2, the loop without controller, where F_p and F_z change when the
        brush is up. Without it follow D.3, the loop with one.
    tolerance : float
        Relative tolerance of ode45; the thesis's is 1e-3.
    sample_rate : float
        Samples of the result per second [Hz].

    Returns
    -------
    xarray.Dataset
        `response` along `time` [s] and `output`, and `largest`, the largest magnitude of each
        output, read at the samples and at four points of every step of the solver.

    Raises
    ------
    InvalidInputError
        If a shape is wrong or `brush` comes from the other simulator.
    SolverError
        If the steps become too small, as for an unstable loop.

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> from robustpolish.brush import listing_response
    >>> brush = rp.simulate_brush("listing", run=1, duration=0.01)
    >>> A = np.kron(np.eye(6), [[0.0, 1.0], [-1e4, -20.0]])
    >>> B1 = np.zeros((12, 4))
    >>> B1[11, 2] = 1.0
    >>> answer = listing_response(A, B1, np.eye(12)[[10]], brush)
    >>> answer.response.sizes["time"], bool(answer.largest[0] > 0)
    (201, True)
    """
    A = matrix("A", A, (12, 12))
    B1 = matrix("B1", B1, (12, 4))
    C = matrix("C", C, (None, 12))
    relative = positive("tolerance", tolerance)
    rate = positive("sample_rate", sample_rate, "Hz")
    if brush.attrs.get("simulator") != "listing":
        raise invalid(
            "brush",
            described(f"simulator {brush.attrs.get('simulator')!r}"),
            "a dataset of the listing simulator",
            'Make it with simulate_brush("listing", ...).',
        )
    mass = 0.0 if bearing_mass is None else positive("bearing_mass", bearing_mass, "kg")
    parameters = parameters_from_attributes(brush.attrs)
    defects = ListingDefects.none(but=tuple(brush.attrs["defects"].split()))
    stored = np.stack(
        [brush[name].values for name in ("theta", "theta_rate", "psi", "psi_rate")], axis=1
    )
    spacing = float(brush.time[1] - brush.time[0])
    duration = float(brush.time[-1])
    samples = np.linspace(0.0, duration, max(1, round(duration * rate)) + 1)
    response, largest = np.empty((samples.size, len(C))), np.zeros(len(C))
    done = _integrate(
        A, B1, C, relative, samples,
        stored, spacing, listing_constants(parameters, defects), defects.as_flags(),
        force_divisor(parameters, brush.attrs["workaround"]), mass, response, largest,
    )  # fmt: skip
    if done < duration:
        raise SolverError(
            f"The loop could not be followed beyond {done:.4g} s. Check that it is stable."
        )
    outputs = ("time", "output")
    return xr.Dataset(
        {
            "response": quantity(response, "unit of C x", "outputs", outputs),
            "largest": quantity(largest, "unit of C x", "largest magnitude", "output"),
        },
        {"time": time_coordinate(samples)},
        {"tolerance": relative, "workaround": brush.attrs["workaround"]},
    )


@njit(cache=True)
def _slope(
    t, x, A, B1, stored, spacing, constants, flags, divisor, mass, room, result
):  # pragma: no cover - compiled
    """Right-hand side of D.2 (if `mass` is positive) or D.3."""
    w, force = room[0], room[1]
    i = int(t / spacing)
    while spacing * i > t:
        i -= 1
    while spacing * (i + 1) <= t:  # on a stored time the later interval wins
        i += 1
    i = min(i, stored.shape[0] - 2)
    later = (t - spacing * i) / spacing
    meant = 1.0 if flags[INTERPOLATION_WEIGHT] else spacing
    earlier = (meant - t + spacing * i) / spacing
    for j in range(4):
        w[j] = later * stored[i + 1, j] + earlier * stored[i, j]
    contact = impact(t, w[0], w[1], w[2], w[3], constants, flags)
    force_p = constants[FORCE_P]
    force[0], force[1], force[2] = forces_of_contact(contact, force_p, divisor)
    if flags[BEARING_GATE] and x[_BEARING_VELOCITY] == 0.0:
        force[2] -= abs(contact[4]) * np.cos(contact[2]) / divisor
        force[1] = 0.0
    if mass > 0.0 and x[_BRUSH_HEIGHT] > 0.0:
        if flags[GRAVITY_TERMS]:
            force_p += mass * _GRAVITY * x[_BEARING_HEIGHT]
            force[2] -= constants[MASS] * _GRAVITY * x[_BRUSH_HEIGHT]
        if flags[POLISHING_FORCE_DROPPED]:
            force[2] -= force_p
    force[3] = force_p
    for row in range(x.size):
        total = 0.0
        for column in range(x.size):
            total += A[row, column] * x[column]
        for column in range(4):
            total += B1[row, column] * force[column]
        result[row] = total


@njit(cache=True)
def _outputs(C, x, result, largest):  # pragma: no cover - compiled
    for row in range(result.size):
        total = 0.0
        for column in range(x.size):
            total += C[row, column] * x[column]
        result[row] = total
        largest[row] = max(largest[row], abs(total))


@njit(cache=True, error_model="numpy")
def _integrate(
    A, B1, C, relative, samples, stored, spacing, constants, flags, divisor, mass, response, largest
):  # pragma: no cover - compiled
    """Run ode45 from rest over all samples; time reached."""
    order = A.shape[0]
    slopes = np.zeros((STAGES, order))
    state, stage, scale = np.zeros(order), np.zeros(order), np.zeros(order)
    inside, output, room = np.zeros(order), np.zeros(C.shape[0]), np.zeros((2, 4))
    end = samples[-1]
    longest = 0.1 * end
    forcing = (stored, spacing, constants, flags, divisor, mass, room)
    _slope(0.0, state, A, B1, *forcing, slopes[0])
    step = ode45.first_step(slopes[0], state, longest, relative)
    time, following = 0.0, 1
    response[0] = 0.0
    while time < end:
        step = min(longest, max(ode45.shortest(time), step))
        last = 1.1 * step >= end - time
        step = end - time if last else step
        attempts = 0
        while True:
            for s in range(1, STAGES):
                stage_state(slopes, s, state, step, stage)
                _slope(time + NODES[s] * step, stage, A, B1, *forcing, slopes[s])
            error = ode45.relative_error(slopes, step, state, stage, relative, scale)
            if error <= relative:
                break
            if step <= ode45.shortest(time):
                return time
            attempts += 1
            last = False
            step = ode45.shorter(step, error, relative, attempts > 1)
            step = max(ode45.shortest(time), step)
        reached = end if last else time + step
        while following < samples.size and samples[following] <= reached:
            inside_step(slopes, state, step, (samples[following] - time) / step, 0, inside)
            _outputs(C, inside, response[following], largest)
            following += 1
        for part in range(1, _REFINE + 1):
            inside_step(slopes, state, step, part / _REFINE, 0, inside)
            _outputs(C, inside, output, largest)
        time = reached
        state[:] = stage
        slopes[0] = slopes[STAGES - 1]
        if attempts == 0:
            step = ode45.longer(step, error, relative)
    return time

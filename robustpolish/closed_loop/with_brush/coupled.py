"""A loop and the brush that feels it: contact where the tool is, not where it should be."""

from __future__ import annotations

import numpy as np
import xarray as xr

from robustpolish.brush.coupled.run import guided_brush, run_coupled
from robustpolish.brush.physical.dataset import physical_dataset
from robustpolish.closed_loop.with_brush.carrier import PLACES, Loop, carrier
from robustpolish.long_calls import working
from robustpolish.validation import instance_of, invalid, positive


def simulate_coupled(
    design: Loop, brush: xr.Dataset, *, tolerance: float = 2e-3, max_passes: int = 5
) -> xr.Dataset:
    r"""Simulate a loop and the brush that hangs on it, each of which feels the other.

    :func:`robustpolish.simulate` replays forces that the brush made on a rigid machine. Here the
    contact is where the machine has yielded to:

    .. math:: p(t) = p_{rigid}(t) + q(t) - q(0), \qquad \dot x = A x + B F(p, \dot p, k, \omega)

    with the joint's place p, the loop's displacement q of the brush, and the free tilts of the
    disc. The robot leads the joint as it went on the rigid machine, height included, under the
    first load; accelerations of the path, 0.5 m/s² here, do not act on the machine, as in (8.45).

    Parameters
    ----------
    design : Design, GeneralizedPlant or control.StateSpace
        A closed or open loop in continuous time with inputs F_x, F_y, F_z and perhaps F_p (N),
        signs as in (8.45), and outputs x, y, z, the displacements of the brush (m).
    brush : xarray.Dataset
        What the physical brush did on a rigid machine, from
        :func:`robustpolish.simulate_brush`; tells parameters, path, start and samples.
    tolerance : float, optional
        Largest difference of the contact impulse over 10 ms between the last two passes,
        relative to that of the polishing force.
    max_passes : int, optional
        At least 2; each takes half the steps of the one before.

    Returns
    -------
    xarray.Dataset
        All outputs of the loop, and what :func:`~robustpolish.simulate_brush` returns: the forces
        F_x, F_y, F_z that act between brush and machine, tilts, contacts. `tool_x`, `tool_y` and
        `tool_z` are where the joint is, `surface_height` and `elevation` are those of the path.
        The loop begins at rest under the first load.

    Raises
    ------
    InvalidInputError
        If the loop lacks a signal, is sampled, or has a pole at zero; if the brush is a run of the
        listing.
    SolverError
        If brush and machine swing up until the disc tips over.

    Warns
    -----
    RobustPolishWarning
        If the passes do not agree.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, section 9.4, which calculates the
    disc and the air bearing one after the other.

    Examples
    --------
    >>> import robustpolish as rp
    >>> brush = rp.simulate_brush(run=1, duration=0.05)
    >>> coupled = rp.simulate_coupled(rp.air_bearing(), brush)
    >>> coupled["y"].attrs["units"], coupled.sizes["time"] == brush.sizes["time"]
    ('m', True)
    """
    remedy = "Make it with simulate_brush(run=..., duration=...)."
    instance_of("brush", brush, xr.Dataset, "an xarray.Dataset", remedy)
    limit = positive("tolerance", tolerance)
    if not isinstance(max_passes, int) or max_passes < 2:
        raise invalid("max_passes", max_passes, "an integer of at least 2", "Allow more passes.")
    guided = guided_brush(brush)
    parameters = guided.parameters
    carried = carrier(design, parameters.polishing_force)
    with working(f"Simulating brush and machine for {guided.time[-1]:g} s"):
        run, states, check = run_coupled(
            guided, carried.machine, tolerance=limit, max_passes=max_passes
        )
    signals = physical_dataset(run, check, parameters, guided.three_angles)
    inputs = carried.inputs(run.forces, parameters.polishing_force)
    shown, through = np.asarray(carried.system.C), np.asarray(carried.system.D)
    outputs = states @ shown.T + inputs @ through.T
    yielded = (states - states[0]) @ carried.machine.C.T
    for i, axis in enumerate(PLACES[:2]):
        tool = signals[f"tool_{axis}"]
        signals[f"tool_{axis}"] = tool.copy(data=guided.place[:, i] + yielded[:, i])
    loop = carried.labelled(guided.time, outputs)
    return signals.merge(loop).assign_attrs({**signals.attrs, "simulator": "coupled"})

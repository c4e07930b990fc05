"""A loop meets a disturbance."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from concurrent.futures import Executor
from typing import Any, Literal

import control
import numpy as np
import xarray as xr

from robustpolish.implementation import SampledDesign
from robustpolish.models import GeneralizedPlant
from robustpolish.simulation import linear_response
from robustpolish.sweeps import sweep
from robustpolish.synthesis.design.design import Design
from robustpolish.validation import described, instance_of, invalid


def simulate(
    design: Design | SampledDesign | GeneralizedPlant | control.StateSpace, disturbance: xr.Dataset
) -> xr.Dataset:
    """Simulate a closed or open loop under a disturbance, exactly for first-order hold.

    Parameters
    ----------
    design : Design, SampledDesign, GeneralizedPlant or control.StateSpace
        A design gives its closed loop with the control effort; a sampled design what its method
        :meth:`~robustpolish.SampledDesign.simulate` gives, on a finer grid and within the limits
        that its plant knows; a plant its open loop, u = 0; a state-space system is simulated as
        it is.
    disturbance : xarray.Dataset
        Variables over `time` (s, uniform) named as disturbances w, such as the forces of
        :func:`robustpolish.simulate_brush`; other variables are ignored, and disturbances that are
        not given are zero, as in :meth:`~robustpolish.SampledDesign.simulate`. One has to be given.

    Returns
    -------
    xarray.Dataset
        Every performance output z and, for a design, every control u over `time`, with
        ``units`` in their attributes where the plant knows them. The loop starts at rest.

    Raises
    ------
    InvalidInputError
        If no disturbance is given, one is misspelt (in case or separators), has another unit than
        the plant's or is not finite, or if the time grid is not uniform.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> import robustpolish as rp
    >>> time = np.arange(2001) / 20e3
    >>> push = xr.Dataset(
    ...     {"F_y": ("time", np.full(time.size, 10.0), {"units": "N"})}, coords={"time": time}
    ... )
    >>> response = rp.simulate(rp.air_bearing(), push)
    >>> response["y"].attrs["units"], bool(response["x"].max() == 0)
    ('m', True)
    """
    remedy = "Build one with a variable per disturbance, or take simulate_brush(...)."
    instance_of("disturbance", disturbance, xr.Dataset, "an xarray.Dataset over time", remedy)
    if isinstance(design, SampledDesign):
        return design.simulate(disturbance)
    return _simulated(*loop_with_units(design), disturbance)


def _simulated(
    system: control.StateSpace, units: Mapping[str, str], disturbance: xr.Dataset
) -> xr.Dataset:
    if "time" not in disturbance.coords:
        raise invalid(
            "disturbance",
            described("no coordinate 'time'"),
            "samples over 'time', in s",
            "Add the coordinate with .assign_coords(time=...).",
        )
    if system.input_labels and not any(name in disturbance for name in system.input_labels):
        raise invalid(
            "disturbance",
            described(f"variables {', '.join(map(str, disturbance.data_vars)) or 'none'}"),
            f"one of {', '.join(map(repr, system.input_labels))} or several",
            "Rename the variables; those that are left out are zero.",
        )
    inputs = [_column(disturbance, name, units.get(name)) for name in system.input_labels]
    time = disturbance["time"].to_numpy()
    outputs, _ = linear_response(
        system, time, np.column_stack(inputs) if inputs else np.zeros((time.size, 0))
    )
    return _labelled(system, units, time, outputs.T)


def _labelled(
    system: control.StateSpace, units: Mapping[str, str], time: np.ndarray, outputs: np.ndarray
) -> xr.Dataset:
    return xr.Dataset(
        {
            name: ("time", outputs[i], {"units": units[name]} if name in units else {})
            for i, name in enumerate(system.output_labels)
        },
        coords={"time": ("time", time, {"units": "s"})},
    )


def simulate_all(
    loops: Mapping[str, Design | GeneralizedPlant],
    disturbance: xr.Dataset,
    executor: Executor | Literal["serial"] | None,
) -> dict[str, xr.Dataset]:
    """Simulate several loops under one disturbance, on workers, to the bits of :func:`simulate`.

    Parameters
    ----------
    loops : mapping of str to Design or GeneralizedPlant
    disturbance : xarray.Dataset
    executor : concurrent.futures.Executor, "serial" or None
        As for :func:`robustpolish.sweep`.

    Returns
    -------
    dict of str to xarray.Dataset
    """
    if executor == "serial":
        return {name: simulate(loop, disturbance) for name, loop in loops.items()}
    known = {name: loop_with_units(loop) for name, loop in loops.items()}
    run = functools.partial(_outputs, tuple(known.values()), disturbance)
    found = sweep(run, {"loop": range(len(known))}, executor=executor)
    for i in np.flatnonzero(found["failure"].values != "")[:1]:
        run(int(i))  # raises here what it raised there
    responses = {}
    for i, (name, (system, units)) in enumerate(known.items()):
        outputs = found["outputs"].values[i, : system.noutputs]
        responses[name] = _labelled(system, units, disturbance["time"].to_numpy(), outputs)
    return responses


def _outputs(
    loops: tuple[tuple[control.StateSpace, dict[str, str]], ...], disturbance: xr.Dataset, loop: int
) -> dict[str, np.ndarray]:
    """Return the outputs of one loop, with rows of zeros up to the number that the most have."""
    response = _simulated(*loops[loop], disturbance)
    most = max(system.noutputs for system, _ in loops)
    outputs = np.zeros((most, response.sizes["time"]))
    for row, name in enumerate(loops[loop][0].output_labels):
        outputs[row] = response[name].to_numpy()
    return {"outputs": outputs}


def loop_with_units(
    design: Design | GeneralizedPlant | control.StateSpace,
) -> tuple[control.StateSpace, dict[str, str]]:
    """Return the system from w to z (and u) and the units of its signals."""
    if isinstance(design, GeneralizedPlant):
        return design.open_loop, dict(design.units)
    if isinstance(design, control.StateSpace):
        return design, {}
    expected = "a Design, a SampledDesign, a GeneralizedPlant or a control.StateSpace"
    remedy = "Pass what state_feedback(...) or air_bearing(...) returned."
    plant = instance_of("design", design, Design, expected, remedy).plant
    return plant.with_control_outputs().closed_loop(design.controller), dict(plant.units)


def _bare(name: Any) -> str:
    """Return a name without case and separators, by which misspelt ones are known."""
    return "".join(c for c in str(name).lower() if c.isalnum())


def _column(disturbance: xr.Dataset, name: str, unit: str | None) -> np.ndarray:
    if name not in disturbance:
        meant = [str(other) for other in disturbance.data_vars if _bare(other) == _bare(name)]
        if meant:
            shown = described(f"a variable {meant[0]!r}")
            raise invalid("disturbance", shown, f"one named {name!r}", "Rename the variable.")
        return np.zeros(disturbance.sizes["time"])
    variable = disturbance[name]
    if variable.dims != ("time",):
        raise invalid(
            f"disturbance[{name!r}]",
            described(f"dimensions {variable.dims}"),
            "('time',)",
            "Select one trajectory.",
        )
    found = variable.attrs.get("units")
    if unit is not None and found is not None and found != unit:
        raise invalid(
            f"disturbance[{name!r}]",
            described(f"unit {found}"),
            f"{unit}, as in the plant",
            "Convert the variable and its units attribute.",
        )
    return variable.to_numpy()

"""A controller as a MAT file, for MATLAB and Simulink."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from robustpolish.base.atomic_writes import new_file
from robustpolish.base.saved import write_saved
from robustpolish.implementation.export.c import CodeSpec, identifier, target

# A controller as JSON, for whatever reads that.


def json_content(spec: CodeSpec) -> dict[str, Any]:
    """Return a controller as plain values, every entry of its matrices exact."""
    limits = None if spec.limits is None else [list(side) for side in spec.limits]
    names = (*spec.measurements, *spec.controls)
    return {
        "period": spec.period,
        "delay": spec.delay,
        "sign": "u[k] = +K y[k]",
        **spec.matrices,
        "measurements": list(spec.measurements),
        "controls": list(spec.controls),
        "units": {name: spec.units[name] for name in names if name in spec.units},
        "limits": limits,
        "about": list(spec.about),
    }


def write_json(
    spec: CodeSpec, path: str | os.PathLike[str], name: str, *, force: bool = False
) -> Path:
    """Write the file; see `SampledDesign.export_json`.

    Parameters
    ----------
    spec : CodeSpec
    path : path
        A folder, or a file that ends in ``.json``.
    name : str
    force : bool, optional

    Returns
    -------
    pathlib.Path
    """
    identifier(name)
    place = target(path, name, ".json")
    write_saved(place, "controller", json_content(spec), force)
    return place


def write_mat(
    spec: CodeSpec, path: str | os.PathLike[str], name: str, *, force: bool = False
) -> Path:
    """Write the file; see `SampledDesign.export_mat`.

    Parameters
    ----------
    spec : CodeSpec
    path : path
        A folder, or a file that ends in ``.mat``.
    name : str
    force : bool, optional

    Returns
    -------
    pathlib.Path
    """
    identifier(name)
    place = target(path, name, ".mat")
    none = np.full(len(spec.controls), np.inf)
    low, high = spec.limits if spec.limits is not None else (-none, none)
    content = {
        **spec.matrices,
        "Ts": spec.period,
        "delay": spec.delay,
        "InputName": _cells(spec.measurements),
        "OutputName": _cells(spec.controls),
        "InputUnit": _cells(tuple(spec.units.get(n, "") for n in spec.measurements)),
        "OutputUnit": _cells(tuple(spec.units.get(n, "") for n in spec.controls)),
        "low": low[:, None],
        "high": high[:, None],
        "sign": "u[k] = +K y[k]",
        "about": " ".join(spec.about),
        "use": "K = ss(A, B, C, D, Ts, 'InputName', InputName, 'OutputName', OutputName);",
    }
    with new_file(place, force, (".mat",)) as draft:
        savemat(draft, content, oned_as="column")
    return place


def _cells(names: tuple[str, ...]) -> np.ndarray:
    """Return texts as a column of MATLAB's cells."""
    cells = np.empty((len(names), 1), dtype=object)
    cells[:, 0] = names
    return cells

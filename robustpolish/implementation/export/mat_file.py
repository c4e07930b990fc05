"""A controller as a MAT file, for MATLAB and Simulink."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from scipy.io import savemat

from robustpolish.implementation.export.code_spec import CodeSpec, identifier, target
from robustpolish.saving import new_file


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

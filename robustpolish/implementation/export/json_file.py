"""A controller as JSON, for whatever reads that."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from robustpolish.implementation.export.code_spec import CodeSpec, identifier, target
from robustpolish.saved_file import write_saved


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

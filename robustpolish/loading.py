"""Whatever was saved, loaded by one name."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from robustpolish.base.checks import described, invalid
from robustpolish.base.saved import Fields, read_saved
from robustpolish.identification.diagnosis import Diagnosis, diagnosis_from
from robustpolish.implementation.sampled_design import SampledDesign, sampled_from
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plants.plant import GeneralizedPlant, plant_from
from robustpolish.synthesis.design import Design, design_from

_READERS: Mapping[str, Callable[[Fields], Any]] = {
    "design": design_from,
    "diagnosis": diagnosis_from,
    "plant": plant_from,
    "sampled design": sampled_from,
}


def load(
    path: str | os.PathLike[str], *, max_bytes: float | None = None
) -> Design | SampledDesign | Diagnosis | GeneralizedPlant | MechanicalModel:
    """Read what was saved: a design, sampled or not, a diagnosis, a plant or a mechanical model.

    Parameters
    ----------
    path : path
        A JSON file, or the TOML file of a mechanical model.
    max_bytes : float, optional
        Largest size of the file in bytes: by default 2e8, of a model 1e7.

    Returns
    -------
    Design, SampledDesign, Diagnosis, GeneralizedPlant or MechanicalModel
        A design is certified again; see :meth:`Design.load`.

    Raises
    ------
    InvalidInputError
        If the file cannot be read or holds nothing of the kind; the message names the key.

    Examples
    --------
    >>> import os, tempfile
    >>> import robustpolish as rp
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     rp.air_bearing().save(os.path.join(folder, "plant.json"))
    ...     rp.load(os.path.join(folder, "plant.json")).nu
    6
    """
    if isinstance(path, str | os.PathLike) and Path(path).suffix == ".toml":
        return MechanicalModel.from_toml(Path(path), max_bytes=max_bytes)
    fields = read_saved(path, max_bytes=max_bytes)
    if fields.kind not in _READERS:
        shown = described(f"a {fields.kind}")
        raise invalid("path", shown, f"one of {', '.join(_READERS)}", "Update robustpolish.")
    return _READERS[fields.kind](fields)

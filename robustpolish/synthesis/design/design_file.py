"""What the file of a design holds: plant and controller are read, the rest is proven again.

It lies below the design, which writes and reads itself with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, get_args

import control
import numpy as np

from robustpolish.models.plant.file import (
    check_size,
    plant_content,
    system_content,
    system_from,
)
from robustpolish.models.plant.plant import plant_from
from robustpolish.saved_file import SAME_NORM, Fields, confirm_norm, plain
from robustpolish.synthesis.blocks.tuned import TunedBlocks
from robustpolish.synthesis.certificate.certificate import certify
from robustpolish.synthesis.design.status import Status
from robustpolish.synthesis.problem.passive_element import PassiveElement
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane, Sector
from robustpolish.validation import described, invalid

_REGIONS = {"HalfPlane": HalfPlane, "Disk": Disk, "Sector": Sector}


def design_content(design: Any) -> dict[str, Any]:
    """Return what is written of a :class:`robustpolish.Design`."""
    certificate = design.certificate
    return {
        "norm": design.norm,
        "status": design.status,
        "message": design.message,
        "method": design.method,
        "backend": design.backend,
        "elapsed": design.elapsed,
        "achieved": certificate.achieved,
        "claimed": certificate.claimed,
        "lower_bound": design.lower_bound,
        "plant": plant_content(design.plant),
        "controller": system_content(design.controller),
        "details": _told(design.details),
        "history": [_told(entry) for entry in design.history],
    }


def design_fields(fields: Fields) -> dict[str, Any]:
    """Return the fields of the design in a file, with a new certificate.

    Raises
    ------
    InvalidInputError
        If a key is missing or wrong, if the controller does not earn a certificate, or if its
        loop has another norm than the file says.
    """
    plant = plant_from(fields.table("plant"))
    controller = system_from(fields.table("controller"))
    check_size(fields, plant.system, controller)
    norm = fields.text("norm", ("hinf", "h2"))
    claimed = None if fields.raw("claimed") is None else fields.number("claimed")
    certificate = certify(plant, controller, "h2" if norm == "h2" else "hinf", claimed)
    told = confirm_norm(fields, certificate, _REMEDY)
    known = "lower_bound" in fields and fields.raw("lower_bound") is not None
    bound = fields.number("lower_bound") if known else None
    if bound is not None and bound > told * (1 + SAME_NORM):
        shown = described(f"{bound:.6g} for a loop that has {told:.6g}")
        raise invalid(f"{fields.where}: lower_bound", shown, "at most the norm", _REMEDY)
    details = _heard(fields.table("details"))
    for region in details.get("pole_regions", ()):
        if not region.contains(certificate.poles):
            shown = described(f"a closed-loop pole outside {region}")
            raise invalid(f"{fields.where}: details", shown, "poles in their region", _REMEDY)
    return {
        "plant": plant,
        "controller": controller,
        "closed_loop": plant.closed_loop(controller),
        "norm": certificate.norm,
        "status": fields.text("status", get_args(Status)),
        "message": fields.text("message"),
        "certificate": certificate,
        "method": fields.text("method"),
        "backend": fields.text("backend"),
        "elapsed": fields.number("elapsed"),
        "history": tuple(_heard(entry) for entry in fields.tables("history")),
        "details": details,
        "lower_bound": bound,
    }


_REMEDY = "Plant or controller were changed after saving; design it anew."


def _told(details: Mapping[str, Any]) -> dict[str, Any]:
    """Return what can be written; certificates and the like can be computed again."""
    written = {key: _write(value) for key, value in details.items()}
    return {key: value for key, value in written.items() if value is not _LEFT_OUT}


_LEFT_OUT = object()


def _write(value: Any) -> Any:
    if value is None or isinstance(value, str | bool | int | float | np.generic):
        return plain(value) if not isinstance(value, np.complexfloating) else _write(complex(value))
    if isinstance(value, complex):
        return {"complex": plain([value.real, value.imag])}
    if isinstance(value, np.ndarray):
        if np.iscomplexobj(value):
            return {"complex": plain([value.real, value.imag])}
        return {"array": plain(value)} if value.dtype.kind in "biuf" else _LEFT_OUT
    if isinstance(value, control.StateSpace):
        return {"system": plain(system_content(value))}
    if isinstance(value, PassiveElement):
        return {"element": [value.kind, list(value.between), value.coefficient, value.unit]}
    if isinstance(value, TunedBlocks):
        return {"blocks": value.content()}
    if type(value).__name__ in _REGIONS:
        return {"region": [type(value).__name__, *map(float, vars(value).values())]}
    if isinstance(value, list | tuple):
        items = [_write(item) for item in value]
        return _LEFT_OUT if any(item is _LEFT_OUT for item in items) else items
    if isinstance(value, Mapping):
        return {"table": _told(value)}
    return _LEFT_OUT


def _heard(table: Fields) -> Mapping[str, Any]:
    return MappingProxyType({key: _read(table, key, table.raw(key)) for key in table})


def _read(table: Fields, key: str, value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_read(table, key, item) for item in value)
    if value in ("inf", "-inf", "nan"):
        return float(value)
    if not isinstance(value, dict):
        return value
    own = Fields(value, f"{table.where}: {key}")
    body: Any
    kind, body = next(iter(value.items()), ("nothing", None))
    try:
        if kind == "array":
            return np.array(body, dtype=float)
        if kind == "complex":
            real, imaginary = np.array(body, dtype=float)
            joined = real + 1j * imaginary
            return joined if np.ndim(joined) else complex(joined)
        if kind == "element":
            return PassiveElement(body[0], (body[1][0], body[1][1]), float(body[2]), body[3])
        if kind == "blocks":
            return TunedBlocks.of_content(body)
        if kind == "region":
            return _REGIONS[body[0]](*map(float, body[1:]))
    except (TypeError, ValueError, KeyError, IndexError):
        raise invalid(own.where, value, f"a description of {kind}", "Save it again.") from None
    if kind == "system":
        return system_from(own.table(kind))
    if kind == "table":
        return _heard(own.table(kind))
    raise invalid(own.where, kind, "a known kind of detail", "Update robustpolish.")

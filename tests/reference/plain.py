"""Answers as plain JSON that keeps every bit, and the differences between two of them."""

from __future__ import annotations

import enum
import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import control
import numpy as np
import xarray as xr

LONGEST = 12
"""Arrays of more numbers are stored as shape, norm and a hash of their bits."""

# What a loose comparison leaves out: texts with numbers in them, and hashes.
UNSTABLE = {"message", "messages", "text", "bits", "repr", "reason", "reasons", "warnings"}
UPPER = {"achieved", "claimed", "bound", "upper"}
LOWER = {"lower", "lower_bound"}


def digest(content: bytes | str) -> str:
    """Return a short hash."""
    raw = content.encode() if isinstance(content, str) else content
    return hashlib.sha256(raw).hexdigest()[:20]


def array(values: Any) -> Any:
    """Return shape, norm and a hash of the bits; a short real vector as it is."""
    found = np.asarray(values)
    if found.dtype.kind in "OUSM":
        return {"shape": list(found.shape), "bits": digest(repr(found.tolist()))}
    if found.dtype.kind in "biu":
        found = found.astype(np.int64)
    if found.ndim <= 1 and found.size <= LONGEST and found.dtype.kind != "c":
        return found.tolist()
    finite = np.where(np.isfinite(found), found, 0)
    bits = digest(np.ascontiguousarray(found).tobytes())
    norm = float(np.linalg.norm(finite.ravel()))
    return {"shape": list(found.shape), "norm": norm, "bits": bits}


def plain(value: Any) -> Any:
    """Return what JSON can hold. Python writes floats so that they come back to the bit."""
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value)
    if isinstance(value, complex | np.complexfloating):
        return [float(value.real), float(value.imag)]
    if isinstance(value, np.ndarray):
        return array(value)
    if isinstance(value, control.StateSpace):
        return {name: array(getattr(value, name)) for name in "ABCD"} | {"dt": plain(value.dt)}
    if isinstance(value, xr.DataArray):
        return array(value.values)
    if isinstance(value, xr.Dataset):
        return {str(name): array(value[name].values) for name in sorted(value.variables)}
    if isinstance(value, Path):
        return value.name
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        if len(value) > LONGEST and all(type(entry) in (int, float) for entry in value):
            return array(np.array(value, dtype=float))
        return [plain(entry) for entry in value]
    raise TypeError(f"no plain form of a {type(value).__name__}")


def fields(value: Any, names: str) -> dict[str, Any]:
    """Return some attributes of an object."""
    return {name: getattr(value, name) for name in names.split()}


def keys(content: Any, path: str = "") -> list[str]:
    """Return the structure of JSON content: all paths, with [] for the places of lists."""
    found = {path} if path else set()
    if isinstance(content, Mapping):
        for name, entry in content.items():
            found |= set(keys(entry, f"{path}.{name}" if path else str(name)))
    elif isinstance(content, list):
        for entry in content:
            found |= set(keys(entry, f"{path}[]"))
    return sorted(found)


def leaves(content: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield every number, text or truth value with the way to it."""
    if isinstance(content, Mapping) and content:
        for name, entry in content.items():
            yield from leaves(entry, (*path, str(name)))
    elif isinstance(content, list) and content:
        for i, entry in enumerate(content):
            yield from leaves(entry, (*path, str(i)))
    else:
        yield path, content


def differences(before: Any, now: Any, tolerance: float | None = None) -> list[str]:
    """Return a line for each difference.

    Without a tolerance, everything has to be equal to the bit. With one, relative to each number:
    what is bounded from above may get better but not worse, brackets not looser, all other numbers
    stay within it, and texts with numbers in them and hashes are not looked at.
    """
    first, second = dict(leaves(before)), dict(leaves(now))
    found = []
    for path in [*first, *(p for p in second if p not in first)]:
        old, new = first.get(path, "(nothing)"), second.get(path, "(nothing)")
        if not same(path, old, new, tolerance):
            found.append(f"{' / '.join(path)}: {shown(old)} -> {shown(new)}")
    return found


def shown(leaf: Any) -> str:
    """Return a leaf as it is told, cut where it is long."""
    text = json.dumps(leaf)
    return text if len(text) <= 160 else f"{text[:160]}..."


def same(path: tuple[str, ...], old: Any, new: Any, tolerance: float | None) -> bool:
    """Say whether two leaves agree; numbers by their repr, in which nan is itself and -0 not 0."""
    if type(old) is type(new) and repr(old) == repr(new):
        return True
    if tolerance is None:
        return False
    if UNSTABLE & set(path):
        return True
    if not all(isinstance(v, float | int) and not isinstance(v, bool) for v in (old, new)):
        return False
    if old == new:
        return True
    if not (math.isfinite(old) and math.isfinite(new)):
        return False
    room = tolerance * max(abs(old), 1e-300)
    if path[-1] in UPPER:
        return new <= old + room
    if path[-1] in LOWER:
        return new >= old - room
    return abs(new - old) <= room

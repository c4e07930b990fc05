"""A function as bytes for other processes, with the systems of control that are bound to it."""

from __future__ import annotations

import io
import pickle
import re
from types import MappingProxyType
from typing import Any

import control
import numpy as np

_GENERATED = re.compile(r"sys\[\d+\]")
"""Names that control counts up: they depend on what else a process has made."""


def as_bytes(value: Any) -> bytes:
    """Pickle a function and what is bound to it.

    State-space systems and read-only mappings, which pickle refuses, are taken apart: a plant or a
    controller can be bound to a function, and the same matrices give the same bytes everywhere.

    Raises
    ------
    Exception
        Whatever pickle has to say about a value that no other process could build.
    """
    stream = io.BytesIO()
    _Pickler(stream, protocol=5).dump(value)
    return stream.getvalue()


class _Pickler(pickle.Pickler):
    def reducer_override(self, obj: Any) -> Any:
        if type(obj) is control.StateSpace:
            return _state_space, _parts(obj)
        if type(obj) is MappingProxyType:
            return _read_only, (dict(obj),)
        return NotImplemented


def _read_only(mapping: dict[Any, Any]) -> Any:
    return MappingProxyType(mapping)  # which pickle does not find by its own name


def _parts(system: control.StateSpace) -> tuple[Any, ...]:
    name = "" if _GENERATED.fullmatch(system.name) else system.name
    matrices = tuple(np.ascontiguousarray(M) for M in (system.A, system.B, system.C, system.D))
    labels = (system.input_labels, system.output_labels, system.state_labels)
    return matrices, system.dt, *map(tuple, labels), name


def _state_space(
    matrices: tuple[np.ndarray, ...],
    dt: Any,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    states: tuple[str, ...],
    name: str,
) -> control.StateSpace:
    return control.StateSpace(
        *matrices,
        dt,
        remove_useless_states=False,
        inputs=list(inputs),
        outputs=list(outputs),
        states=list(states),
        **({"name": name} if name else {}),
    )

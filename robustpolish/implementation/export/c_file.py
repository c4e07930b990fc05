"""The C file of a controller, and test vectors beside it."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from robustpolish.arrays import Array
from robustpolish.implementation.export.c_text import c_text
from robustpolish.implementation.export.code_spec import CodeSpec, identifier, target
from robustpolish.implementation.realization.float32 import SAMPLES, RoundoffBound
from robustpolish.implementation.realization.stepping import controller_outputs
from robustpolish.saving import new_file, write_file
from robustpolish.validation import invalid, is_whole, one_of

SEED = 20_240_229
"""Of the random measurements, so that every export of a controller has the same ones."""


def write_c(
    spec: CodeSpec,
    path: str | os.PathLike[str],
    name: str,
    precision: str,
    bound: RoundoffBound | None,
    *,
    test_vectors: int = 0,
    force: bool = False,
) -> Path:
    """Write the file; see `SampledDesign.export_c`.

    Parameters
    ----------
    spec : CodeSpec
    path : path
        A folder, or a file that ends in ``.c``.
    name : str
    precision : {"double", "float"}
    bound : RoundoffBound or None
        For "float".
    test_vectors : int, optional
        So many random samples are written to ``<file>_vectors.csv``.
    force : bool, optional

    Returns
    -------
    pathlib.Path
        Of the C file.
    """
    identifier(name)
    one_of("precision", precision, ("double", "float"))
    if not is_whole(test_vectors) or test_vectors < 0:
        raise invalid("test_vectors", test_vectors, "a number of samples", "Pass 10000, or 0.")
    place = target(path, name, ".c")
    write_file(place, c_text(spec, name, precision, _facts(spec, bound)), force)
    if test_vectors:
        y, u = vectors(spec, test_vectors)
        with new_file(place.with_name(f"{place.stem}_vectors.csv"), force) as draft:
            head = ",".join((*spec.measurements, *spec.controls))
            np.savetxt(draft, np.hstack([y, u]), delimiter=",", header=head, comments="")
    return place


def vectors(spec: CodeSpec, samples: int) -> tuple[Array, Array]:
    """Return random measurements, of at most one unit each, and the controls that they bring.

    Where that reaches limits, the first half is so small that it stays within half of them: a
    control that is at its limit all the time would tell nothing of the controller.
    """
    y = np.random.default_rng(SEED).uniform(-1, 1, (samples, len(spec.measurements)))
    if spec.limits is not None:
        half = y[: samples // 2]
        free = np.abs(controller_outputs(spec.controller, half)).max(axis=0, initial=0.0)
        room = np.minimum(-spec.limits[0], spec.limits[1])
        times = float((free / np.where(room > 0, room, np.inf)).max(initial=0.0))
        half /= max(1.0, 2 * times)
    return y, controller_outputs(spec.controller, y, spec.limits, spec.feedback)


def _facts(spec: CodeSpec, bound: RoundoffBound | None) -> tuple[str, ...]:
    if bound is None:
        return ()
    each = "; ".join(
        f"{name}: {sample:.3g} per sample, {total:.3g} in all, of at most {size:.3g}"
        for name, sample, total, size in zip(
            spec.controls, bound.per_sample, bound.outputs, bound.size, strict=True
        )
    )
    limited = " It holds while no limit is reached." if spec.limits is not None else ""
    return (
        "Single precision. For measurements of at most one unit each, and in proportion to them, "
        f"the outputs differ from those in double precision over {SAMPLES} samples by at most: "
        f"{each}.{limited}",
    )

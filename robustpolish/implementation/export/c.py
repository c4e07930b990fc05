"""The C file of a controller, and test vectors beside it."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import control
import numpy as np

from robustpolish.base.arrays import Array, Matrix, Vector
from robustpolish.base.atomic_writes import new_file, write_file
from robustpolish.base.checks import invalid, is_whole, one_of
from robustpolish.base.versions import __version__
from robustpolish.implementation.realization import SAMPLES, SinglePrecision, controller_outputs

# What any export writes of a controller: matrices, names, units, limits, and words about it.


@dataclass(frozen=True, eq=False)
class CodeSpec:
    """A controller as other programs see it.

    Attributes
    ----------
    controller : control.StateSpace
        Discrete; u[k] = K y[k].
    period, delay : float
        In s.
    units : mapping of str to str
        Of the signals that have one.
    limits : (ndarray, ndarray) or None
        Lowest and highest controls.
    feedback : ndarray, shape (nk, nu)
        L of the anti-windup; zero if there is none.
    about : tuple of str
        Sentences on plant, filter and certificate.
    """

    controller: control.StateSpace
    period: float
    delay: float
    units: Mapping[str, str]
    limits: tuple[Vector, Vector] | None
    feedback: Matrix
    about: tuple[str, ...]

    @property
    def matrices(self) -> dict[str, Matrix]:
        """A, B, C, D and L by name."""
        K = self.controller
        named = {"A": K.A, "B": K.B, "C": K.C, "D": K.D, "L": self.feedback}
        return {name: np.array(M, dtype=float) for name, M in named.items()}

    @property
    def measurements(self) -> tuple[str, ...]:
        """Names of y, in order."""
        return tuple(self.controller.input_labels)

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of u, in order."""
        return tuple(self.controller.output_labels)

    def with_unit(self, name: str) -> str:
        """Return a name followed by its unit."""
        unit = self.units.get(name, "")
        return f"{name} [{unit}]" if unit else name


_KEYWORDS = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline
    int long register restrict return short signed sizeof static struct switch typedef union
    unsigned void volatile while main
    """.split()  # noqa: SIM905 a list of forty words in quotation marks is hard to read
)


def identifier(name: str) -> str:
    """Return a name if it can be one in C and in MATLAB.

    Raises
    ------
    InvalidInputError
        If it cannot.
    """
    fits = isinstance(name, str) and re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,47}", name)
    if not fits or name in _KEYWORDS:
        want = "a letter, then letters, digits and underscores, no word of C"
        raise invalid("name", name, want, 'Choose one such as "controller".')
    return name


def target(path: str | os.PathLike[str], name: str, suffix: str) -> Path:
    """Return the file for a path: itself if it ends so, or the file of that name in the folder."""
    place = Path(path)
    return place if place.suffix == suffix else place / f"{name}{suffix}"


# A controller as one C99 file without allocation, from a template.


def rendered(template: str, **values: Any) -> str:
    """Return a template of this folder, filled in."""
    import jinja2  # needed by exports only

    environment = jinja2.Environment(
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "comment": _comment, "numbers": _numbers, "plain": _plain, "quoteattr": quoteattr
    }  # fmt: skip
    text = resources.files(__package__).joinpath("templates", template).read_text("utf-8")
    return environment.from_string(text).render(values)


def c_text(spec: CodeSpec, name: str, precision: str, facts: tuple[str, ...] = ()) -> str:
    """Return the file.

    Parameters
    ----------
    spec : CodeSpec
    name : str
        Before every name in the file.
    precision : {"double", "float"}
    facts : tuple of str, optional
        Sentences for the head, besides those of `spec`.

    Returns
    -------
    str
    """
    M = spec.matrices
    n = len(M["A"])
    winds = bool(M["L"].any()) and spec.limits is not None
    wanted = ("A", "B", "C") * bool(n) + ("D",) + ("L",) * winds
    return rendered(
        "controller.c.jinja",
        spec=spec,
        name=name,
        version=__version__,
        real=precision,
        zero="0.0f" if precision == "float" else "0.0",
        n=n,
        stored=max(n, 1),  # C has no empty arrays
        nu=len(spec.controls),
        ny=len(spec.measurements),
        period=repr(spec.period),
        late=f"{spec.delay:.6g} s later" if spec.delay else "at once",
        facts=(*spec.about, *facts),
        matrices={key: M[key] for key in wanted},
        limits=dict(zip(("low", "high"), spec.limits or (), strict=False)),
        winds=winds,
    )


def _comment(sentence: str) -> str:
    """Wrap a sentence as lines of a comment."""
    words = " ".join(_plain(sentence).split())
    return textwrap.fill(
        words, 93, initial_indent=" * ", subsequent_indent=" *   ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _plain(text: str) -> str:
    """Return a text that neither ends a comment nor leaves the character set of C."""
    plain = text.replace("*/", "* /").replace("/*", "/ *").replace("\\", "/").replace("??", "? ?")
    return "".join(c if " " <= c <= "~" else " " if c.isspace() else "_" for c in plain)


def _numbers(values: Vector, precision: str) -> str:
    return ", ".join(number(value, precision) for value in values)


def number(value: float, precision: str) -> str:
    """Return a number so that C reads exactly this one, or its single-precision neighbour."""
    largest = float(np.finfo(np.float32).max) if precision == "float" else np.finfo(float).max
    value = float(np.clip(value, -largest, largest))
    text = f"{float(np.float32(value)):.9g}" if precision == "float" else repr(value)
    text = text if any(c in text for c in ".en") else text + ".0"
    return text + ("f" if precision == "float" else "")


SEED = 20_240_229
"""Of the random measurements, so that every export of a controller has the same ones."""


def write_c(
    spec: CodeSpec,
    path: str | os.PathLike[str],
    name: str,
    precision: str,
    loss: SinglePrecision | None,
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
    loss : SinglePrecision or None
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
    write_file(place, c_text(spec, name, precision, _facts(spec, loss)), force)
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


def _facts(spec: CodeSpec, loss: SinglePrecision | None) -> tuple[str, ...]:
    if loss is None:
        return ()
    each = "; ".join(
        f"{name}: {sample:.3g} per sample, {total:.3g} in all, of at most {size:.3g}"
        for name, sample, total, size in zip(
            spec.controls, loss.per_sample, loss.outputs, loss.size, strict=True
        )
    )
    limited = " It holds while no limit is reached." if spec.limits is not None else ""
    return (
        "Single precision. For measurements of at most one unit each, and in proportion to them, "
        f"the outputs differ from those in double precision over {SAMPLES} samples by at most: "
        f"{each}.{limited}",
    )

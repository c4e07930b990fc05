"""A sampled controller in the files of other programs: C, FMU, JSON and MAT."""

from __future__ import annotations

import math
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import control
import numpy as np
from scipy.io import savemat

from robustpolish.base.arrays import Array, Matrix, Vector
from robustpolish.base.atomic_writes import new_file, write_file
from robustpolish.base.checks import invalid, one_of, whole_number
from robustpolish.base.results import templates
from robustpolish.base.saved import write_saved
from robustpolish.base.versions import __version__
from robustpolish.errors import MissingDependencyError, SolverError
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


# A controller as one C99 file without allocation, from a template; test vectors beside it.


def rendered(template: str, spec: CodeSpec, name: str, **values: Any) -> str:
    """Return a jinja2 template of the folder `templates`, filled in for a controller."""
    filters = {"comment": _comment, "numbers": _numbers, "plain": _plain, "quote": quoteattr}
    style = dict.fromkeys(("trim_blocks", "lstrip_blocks", "keep_trailing_newline"), True)
    text = templates(f"{__package__}.templates", filters, **style).get_template(template)
    ny, nu = len(spec.measurements), len(spec.controls)
    own = {"version": __version__, "ny": ny, "nu": nu, "period": repr(float(spec.period))}
    return text.render(spec=spec, name=name, **own, **values)


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
        "controller.c.jinja", spec, name,
        real=precision,
        zero="0.0f" if precision == "float" else "0.0",
        n=n,
        stored=max(n, 1),  # C has no empty arrays
        late=f"{spec.delay:.6g} s later" if spec.delay else "at once",
        facts=(*spec.about, *facts),
        matrices={key: M[key] for key in wanted},
        limits=dict(zip(("low", "high"), spec.limits or (), strict=False)),
        winds=winds,
    )  # fmt: skip


def _comment(sentence: str) -> str:
    """Wrap a sentence as lines of a comment."""
    words = " ".join(_plain(sentence).split())
    indents = {"initial_indent": " * ", "subsequent_indent": " *   "}
    return textwrap.fill(words, 93, **indents, break_long_words=False, break_on_hyphens=False)  # pyright: ignore[reportArgumentType]


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

_SIGN = "u[k] = +K y[k]"


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
    place = target(path, identifier(name), ".c")
    one_of("precision", precision, ("double", "float"))
    whole_number("test_vectors", test_vectors, 0, remedy="Pass a number of samples, such as 10000.")
    write_file(place, c_text(spec, name, precision, _facts(spec, loss)), force)
    if test_vectors:
        with new_file(place.with_name(f"{place.stem}_vectors.csv"), force) as draft:
            head = ",".join((*spec.measurements, *spec.controls))
            samples = np.hstack(vectors(spec, test_vectors))
            np.savetxt(draft, samples, delimiter=",", header=head, comments="")
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


# An FMU for co-simulation (FMI 2.0), compiled here.


def _texts(spec: CodeSpec, name: str) -> tuple[str, str]:
    """Return modelDescription.xml, and the controller with the functions of FMI 2.0 around it."""
    core = c_text(spec, name, "double")
    signals = (*spec.measurements, *spec.controls)
    values = {
        # The same controller has the same identity, wherever and whenever it is exported.
        "guid": f"{{{uuid.uuid5(uuid.NAMESPACE_URL, core)}}}",
        "signals": signals,
        "units": sorted({spec.units[n] for n in signals if spec.units.get(n)}),
        "delay": repr(float(spec.delay)),
        "queue": math.floor(spec.delay / spec.period) + 3,
    }
    description = rendered("modelDescription.xml.jinja", spec, name, **values)
    return description, core + rendered("fmu.c.jinja", spec, name, **values)


_FLAGS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared")
_WORDS = {"linux": ("linux", "so"), "darwin": ("darwin", "dylib"), "win32": ("win", "dll")}


def write_fmu(
    spec: CodeSpec, path: str | os.PathLike[str], name: str, *, force: bool = False
) -> Path:
    """Write the FMU; see `SampledDesign.export_fmu`.

    Parameters
    ----------
    spec : CodeSpec
    path : path
        A folder, or a file that ends in ``.fmu``.
    name : str
    force : bool, optional

    Returns
    -------
    pathlib.Path

    Raises
    ------
    MissingDependencyError
        If there is no C compiler.
    SolverError
        If the compiler refuses the source, which a working one does not.
    """
    place = target(path, identifier(name), ".fmu")
    description, source = _texts(spec, name)
    with new_file(place, force, (".fmu",)) as draft, zipfile.ZipFile(draft, "w") as archive:
        folder, suffix = _platform()
        contents = {
            "modelDescription.xml": description.encode(),
            f"sources/{name}.c": source.encode(),
            f"binaries/{folder}/{name}.{suffix}": _compiled(source, name),
        }
        for inside, content in contents.items():
            # with a fixed date, so that the same controller gives the same bytes
            entry = zipfile.ZipInfo(inside, (1980, 1, 1, 0, 0, 0))
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return place


def _platform() -> tuple[str, str]:
    word, suffix = _WORDS.get(sys.platform, ("linux", "so"))
    bits = "64" if sys.maxsize > 2**32 else "32"
    machine = platform.machine().lower()
    if word == "linux" and machine not in ("x86_64", "amd64", "i686", "i386"):
        return f"{machine}-linux", suffix  # as FMI 3.0 and most importers call it
    return word + bits, suffix


def _compiled(source: str, name: str) -> bytes:
    compiler = shutil.which(os.environ.get("CC") or "cc") or shutil.which("gcc")
    if compiler is None:
        raise MissingDependencyError(
            "path: there is no C compiler to build the FMU with. Install gcc or clang, or set CC; "
            "export_c needs none."
        )
    with tempfile.TemporaryDirectory() as folder:
        file, library = Path(folder, f"{name}.c"), Path(folder, f"{name}.bin")
        file.write_text(source, encoding="utf-8")
        command = [compiler, *_FLAGS, "-o", str(library), str(file), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            line = (done.stderr.strip().splitlines() or ["no message"])[0]
            raise SolverError(f"path: {compiler} refused the source: {line}. Try another CC.")
        return library.read_bytes()


# A controller as JSON, and as a MAT file for MATLAB and Simulink.


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
    place = target(path, identifier(name), ".json")
    names = (*spec.measurements, *spec.controls)
    content = {
        "period": spec.period,
        "delay": spec.delay,
        "sign": _SIGN,
        **spec.matrices,
        "measurements": list(spec.measurements),
        "controls": list(spec.controls),
        "units": {name: spec.units[name] for name in names if name in spec.units},
        "limits": None if spec.limits is None else [list(side) for side in spec.limits],
        "about": list(spec.about),
    }
    write_saved(place, "controller", content, force)
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
    place = target(path, identifier(name), ".mat")
    none = np.full(len(spec.controls), np.inf)
    low, high = spec.limits if spec.limits is not None else (-none, none)
    content = {
        **spec.matrices,
        "Ts": spec.period,
        "delay": spec.delay,
        "InputName": _cells(spec.measurements),
        "OutputName": _cells(spec.controls),
        "InputUnit": _cells([spec.units.get(n, "") for n in spec.measurements]),
        "OutputUnit": _cells([spec.units.get(n, "") for n in spec.controls]),
        "low": low[:, None],
        "high": high[:, None],
        "sign": _SIGN,
        "about": " ".join(spec.about),
        "use": "K = ss(A, B, C, D, Ts, 'InputName', InputName, 'OutputName', OutputName);",
    }
    with new_file(place, force, (".mat",)) as draft:
        savemat(draft, content, oned_as="column")
    return place


def _cells(names: Sequence[str]) -> np.ndarray:
    """Return texts as a column of MATLAB's cells."""
    return np.array([[name] for name in names], dtype=object)

"""The C file of a controller, and test vectors beside it."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import control
import numpy as np

from robustpolish.base.arrays import Array, Matrix, Vector
from robustpolish.base.atomic_writes import new_file, write_file
from robustpolish.base.checks import invalid, is_whole, one_of
from robustpolish.base.versions import __version__
from robustpolish.implementation.realization import SAMPLES, RoundoffBound, controller_outputs

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


# A controller as one C99 file without allocation.

_HEAD = """\
/*
 * {name}: a discrete-time controller, u[k] = K y[k] with positive sign.
 * Written by robustpolish {version}; C99, no allocation, no global state.
 *
{facts}
 *
 * Measurements y[], in this order and in these units:
{measurements}
 * Controls u[], in this order and in these units:
{controls}
 *
 * Use:  {name}_state s;
 *       {name}_init(&s);
 *       every {period!r} s:  {name}_step(&s, y, u);
 * Call _step right after y was sampled and put u out {late}. A y that is not a number
 * would stay in the states: check the sensors before.
 *
 * Compiled with -D{upper}_MAIN it is a program that reads lines of measurements from
 * standard input and writes lines of controls.
 */
"""

_BODY = """\
#ifdef {upper}_MAIN
#include <stdio.h>
#endif

#define {upper}_STATES {n}
#define {upper}_MEASUREMENTS {ny}
#define {upper}_CONTROLS {nu}

typedef struct {{
    {real} x[{n1}];
}} {name}_state;

void {name}_init({name}_state *s);
void {name}_step({name}_state *s, const {real} y[{ny}], {real} u[{nu}]);

{tables}
/* Bring the controller to rest. */
void {name}_init({name}_state *s)
{{
    int i;
    for (i = 0; i < {n1}; i++) {{
        s->x[i] = {zero};
    }}
}}

/* Take a sample: y in, u out. */
void {name}_step({name}_state *s, const {real} y[{ny}], {real} u[{nu}])
{{
{step}}}
{main}"""

_DIRECT = """\
    for (i = 0; i < {nu}; i++) {{
        {real} sum = {zero};
{on_x}        for (j = 0; j < {ny}; j++) {{
            sum += {name}_D[i][j] * y[j];
        }}
{limit}    }}
"""

_ON_X = """\
        for (j = 0; j < {n}; j++) {{
            sum += {name}_C[i][j] * s->x[j];
        }}
"""

_LIMIT = """\
        u[i] = sum;
        if (u[i] < {name}_low[i]) {{
            u[i] = {name}_low[i];
        }}
        if (u[i] > {name}_high[i]) {{
            u[i] = {name}_high[i];
        }}
"""

_UPDATE = """\
    for (i = 0; i < {n}; i++) {{
        {real} sum = {zero};
        for (j = 0; j < {n}; j++) {{
            sum += {name}_A[i][j] * s->x[j];
        }}
        for (j = 0; j < {ny}; j++) {{
            sum += {name}_B[i][j] * y[j];
        }}
{windup}        next[i] = sum;
    }}
    for (i = 0; i < {n}; i++) {{
        s->x[i] = next[i];
    }}
"""

_WINDUP = """\
        for (j = 0; j < {nu}; j++) {{
            sum += {name}_L[i][j] * excess[j];
        }}
"""

_MAIN = """
#ifdef {upper}_MAIN
int main(void)
{{
    {name}_state s;
    {real} y[{ny}];
    {real} u[{nu}];
    double value;
    int i;
    {name}_init(&s);
    for (;;) {{
        for (i = 0; i < {ny}; i++) {{
            if (scanf("%lf%*[ ,]", &value) != 1) {{
                return 0;
            }}
            y[i] = ({real})value;
        }}
        {name}_step(&s, y, u);
        for (i = 0; i < {nu}; i++) {{
            printf("%.17g%c", (double)u[i], i + 1 < {nu} ? ' ' : '\\n');
        }}
    }}
}}
#endif
"""


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
    n, nu, ny = len(M["A"]), len(spec.controls), len(spec.measurements)
    single = precision == "float"
    winds = bool(M["L"].any()) and spec.limits is not None
    fill = {
        "name": name,
        "upper": name.upper(),
        "version": __version__,
        "real": precision,
        "zero": "0.0f" if single else "0.0",
        "n": n,
        "n1": max(n, 1),
        "nu": nu,
        "ny": ny,
        "period": spec.period,
        "late": f"{spec.delay:.6g} s later" if spec.delay else "at once",
    }
    limit = _LIMIT.format(**fill) if spec.limits is not None else "        u[i] = sum;\n"
    if winds:
        limit += "        excess[i] = u[i] - sum;\n"
    declared = "    int i, j;\n"
    declared += f"    {precision} next[{n}];\n" if n else ""
    declared += f"    {precision} excess[{nu}];\n" if winds else ""
    step = declared + _DIRECT.format(**fill, on_x=_ON_X.format(**fill) if n else "", limit=limit)
    if n:
        step += _UPDATE.format(**fill, windup=_WINDUP.format(**fill) if winds else "")
    else:
        step += "    (void)s;\n"
    wanted = (["A", "B", "C"] if n else []) + ["D"] + (["L"] if winds else [])
    tables = "".join(_table(f"{name}_{key}", M[key], precision) for key in wanted)
    if spec.limits is not None:
        for word, values in zip(("low", "high"), spec.limits, strict=True):
            tables += _row(f"{name}_{word}", values, precision)
    head = _HEAD.format(
        **fill,
        facts="\n".join(_commented(line) for line in (*spec.about, *facts)),
        measurements=_listed(spec, spec.measurements),
        controls=_listed(spec, spec.controls),
    )
    return head + _BODY.format(**fill, tables=tables, step=step, main=_MAIN.format(**fill))


def _listed(spec: CodeSpec, names: tuple[str, ...]) -> str:
    return "\n".join(f" *   {i}: {_safe(spec.with_unit(name))}" for i, name in enumerate(names))


def _commented(sentence: str) -> str:
    """Wrap a sentence as lines of a comment."""
    lines, line = [], " *"
    for word in _safe(sentence).split():
        if len(line) + len(word) > 92:
            lines.append(line)
            line = " *  "
        line += " " + word
    return "\n".join([*lines, line])


def _safe(text: str) -> str:
    """Return a text that neither ends a comment nor leaves the character set of C."""
    plain = text.replace("*/", "* /").replace("/*", "/ *").replace("\\", "/").replace("??", "? ?")
    return "".join(c if " " <= c <= "~" else " " if c.isspace() else "_" for c in plain)


def number(value: float, precision: str) -> str:
    """Return a number so that C reads exactly this one, or its single-precision neighbour."""
    largest = float(np.finfo(np.float32).max) if precision == "float" else np.finfo(float).max
    value = float(np.clip(value, -largest, largest))
    text = f"{float(np.float32(value)):.9g}" if precision == "float" else repr(value)
    text = text if any(c in text for c in ".en") else text + ".0"
    return text + ("f" if precision == "float" else "")


def _table(name: str, M: Matrix, precision: str) -> str:
    rows = ",\n".join(
        "    {" + ", ".join(number(v, precision) for v in row) + "}" for row in np.atleast_2d(M)
    )
    return f"static const {precision} {name}[{M.shape[0]}][{M.shape[1]}] = {{\n{rows}\n}};\n\n"


def _row(name: str, values: Matrix, precision: str) -> str:
    inside = ", ".join(number(v, precision) for v in values)
    return f"static const {precision} {name}[{len(values)}] = {{{inside}}};\n\n"


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

"""A controller as one C99 file without allocation."""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.implementation.export.code_spec import CodeSpec
from robustpolish.versions import __version__

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

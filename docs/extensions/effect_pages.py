"""The catalogue of effects as a page, written from the catalogue itself.

The pictures are the candidate forces that screening tries: the force of each kind along one and
the same swelling motion, for several choices of whatever enters nonlinearly.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from sphinx.application import Sphinx
from sphinx.config import Config

from robustpolish.machines.effects.effect import kinds
from robustpolish.machines.effects.evaluate import shapes_along
from robustpolish.machines.effects.kind import EffectKind, Motion

FOLDER = "effects"
PLACES = {
    "pair": "Between two coordinates, or one and ground",
    "dof": "On one coordinate",
    "axes": "On two axes at once",
    "input": "On a measured input",
    "output": "On a sensor",
}
STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#0072b2", "linestyle": "-"},
    {"color": "#d55e00", "linestyle": "--"},
    {"color": "#009e73", "linestyle": ":"},
)
INTRO = """# Catalogue of effects

Every kind that the installed robustpolish knows, with what it does to a residual and what to check
on the machine. `rp.diagnose` tries each at every place where it could act;
`model.with_effect(kind, at, parameters)` adds one by hand. To add your own, see
[How to add an effect](../how_to_add_an_effect.md).

Units are those of a translation; at a rotation read N m for N and rad for m. The pictures show the
force on the first coordinate along a swelling vibration, largest value 1: what screening
compares with the force that is missing, one line for each of up to three guesses of the parameters
that enter nonlinearly.
"""


def swelling_motion() -> Motion:
    """Return a vibration of 1 Hz that swells to an amplitude of 1."""
    time = np.linspace(0.0, 2.0, 2401)
    q = (0.4 + 0.6 * time / time[-1]) * np.sin(2 * np.pi * time)
    q /= np.abs(q).max()
    context = {"spring_stiffness": 1.0, "mobility": 1e-3}
    return Motion(time, q[None], np.gradient(q, time)[None], context)


def picture(kind: EffectKind) -> Figure | None:
    """Draw the candidate forces of a kind over the displacement, or nothing if it has none."""
    motion = swelling_motion()
    if kind.domain != "pair" or kind.law is None:
        return None
    # a unit of each coefficient; three guesses are enough for the eye
    forces = [shape.columns.sum(axis=0)[0] for shape in shapes_along(kind, motion)]
    if not forces:
        return None
    chosen = forces[:: max(len(forces) // 3, 1)][:3]
    figure = Figure(figsize=(4.2, 2.4), layout="constrained")
    ax = figure.subplots()
    for force, style in zip(chosen, STYLES, strict=False):
        largest = float(np.abs(force).max()) or 1.0
        ax.plot(motion.q[0], force / largest, lw=1.2, **style)
    ax.axhline(0.0, color="0.7", lw=0.5, zorder=0)
    ax.axvline(0.0, color="0.7", lw=0.5, zorder=0)
    ax.set_xticks([-1, 0, 1])
    ax.set_yticks([-1, 0, 1])
    ax.set_ylim(-1.1, 1.1)
    ax.set_xlabel("displacement / amplitude")
    ax.set_ylabel("force / largest")
    return figure


def bounds(lower: float, upper: float) -> str:
    """Return a range as text."""
    if np.isinf(lower) and np.isinf(upper):
        return "any"
    if np.isinf(upper):
        return f"at least {lower:g}"
    return f"at most {upper:g}" if np.isinf(lower) else f"{lower:g} to {upper:g}"


def section(kind: EffectKind, has_picture: bool) -> list[str]:
    """Return the section of one kind."""
    lines = [f"({kind.kind})=", f"### {kind.title}", "", f"`{kind.kind}`", "", kind.looks_like, ""]
    if has_picture:
        lines += [f"![Force of {kind.title} over displacement]({kind.kind}.svg)", ""]
    lines += ["| parameter | unit | meaning | range | fitted |", "|---|---|---|---|---|"]
    lines += [
        f"| `{p.name}` | {p.unit()} | {p.meaning} | {bounds(p.lower, p.upper)} | "
        f"{'yes' if p.fitted else 'on request'} |"
        for p in kind.parameters
    ]
    lines += ["", "What to check:", "", *(f"- {check}" for check in kind.checks), ""]
    if kind.references:
        lines += ["Read: " + "; ".join(kind.references) + ".", ""]
    return lines


def write(folder: Path) -> None:
    """Write the page and its pictures."""
    folder.mkdir(exist_ok=True)
    lines = [INTRO]
    for domain, where in PLACES.items():
        chosen = [kind for kind in kinds().values() if kind.domain == domain]
        lines += [f"## {where}", ""]
        for kind in chosen:
            figure = picture(kind)
            if figure is not None:
                with mpl.rc_context({"svg.hashsalt": kind.kind}):
                    figure.savefig(folder / f"{kind.kind}.svg", metadata={"Date": None})
            lines += section(kind, figure is not None)
    text, page = "\n".join(lines), folder / "index.md"
    if not page.exists() or page.read_text(encoding="utf-8") != text:
        page.write_text(text, encoding="utf-8")


def _write(app: Sphinx, config: Config) -> None:
    write(Path(app.srcdir) / FOLDER)


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the page before Sphinx looks for sources."""
    app.connect("config-inited", _write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""`robustpolish export`."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from robustpolish.app.cli.options import choice, option, repeatable, result_options
from robustpolish.base.atomic_writes import check_new_file
from robustpolish.base.budget import progress_bar
from robustpolish.base.checks import invalid
from robustpolish.implementation.export.files import target
from robustpolish.implementation.realization import FORMS, METHODS
from robustpolish.synthesis.design import Design

_KINDS = click.Choice(("c", "mat", "json", "fmu"))
_OUT = "Existing folder for the files; here by default."
_FOLDER = click.Path(file_okay=False, exists=True)


@click.command()
@option("--design file", "A saved design (.json).", click.Path(), required=True)
@option("--period", "Seconds between samples.", float, required=True)
@option("--delay", "Seconds from a sample until it acts.", default=0.0)
@choice("--method", METHODS, "How the controller is imitated at the samples.")
@option("--prewarp-hz", "Where tustin is exact.", float)
@option("--anti-aliasing", "Corner of a Butterworth filter, in Hz.", float)
@option("--order", "Reduce the controller to so many states first.", int)
@option("--tolerance", "Or: to as few as cost this part of the norm, 0.05.", float)
@option("--form", "Coordinates in which it is computed.", click.Choice(FORMS))
@repeatable("--limit limits", "NAME=SIZE", "Limit of a control, or NAME=LOW:HIGH; once for each.")
@choice("--precision", ("double", "float"), "Of the C file.")
@option("--name", "Of files and functions.", default="controller")
@option("--to kinds", "What to write; once for each.", _KINDS, ("c",), multiple=True)
@click.option("--test-vectors", default=0, help="Random samples to write beside the C file.")
@click.option("--out", type=_FOLDER, default=".", help=_OUT)
@result_options
def export(
    file: str, order: int | None, tolerance: float | None, form: str | None,
    limits: tuple[str, ...], precision: str, name: str, kinds: tuple[str, ...], test_vectors: int,
    out: str, force: bool, period: float, delay: float, method: str, **sampling: Any,
) -> tuple[Any, ...]:  # fmt: skip
    """Turn a saved design into code: sampled, certified, and written for other programs.

    The loop is certified with sampler, hold, delay and filter before anything is written. The exit
    code is 1 if it is unstable, with the longest period that keeps it stable.
    """
    for kind in kinds:
        check_new_file(target(out, name, f".{kind}"), force)
    if test_vectors and "c" in kinds:
        check_new_file(Path(out) / f"{name}_vectors.csv", force)
    design, said = Design.load(Path(file)), []
    if order is not None or tolerance is not None:
        with progress_bar("Reducing the controller"):
            design = design.reduce(order=order, tolerance=tolerance)
        said.append(design.message)
    with progress_bar("Certifying the sampled loop"):
        sampled = design.discretize(period, delay, method, **sampling)
    if form is not None:
        sampled = sampled.realization(form)
    how: dict[str, Any] = {"limits": dict(map(_limit, limits)) or None, "force": force}
    written = []
    for kind in dict.fromkeys(kinds):
        own = {"precision": precision, "test_vectors": test_vectors} if kind == "c" else {}
        written.append(str(getattr(sampled, f"export_{kind}")(out, name, **how, **own)))
    c = sampled.certificate
    content = {
        "files": written,
        "period": sampled.period,
        "delay": sampled.delay,
        "states": sampled.controller.nstates,
        "norm": {"kind": sampled.norm, "lower": c.lower, "upper": c.bound},
        "continuous_norm": sampled.continuous_norm,
        "messages": [*said, sampled.message, *c.notes],
    }
    lines = [*said, repr(sampled), *(f"wrote {path}" for path in written)]
    return content, "\n".join(lines)


def _limit(text: str) -> tuple[str, tuple[float, float]]:
    """Read NAME=SIZE or NAME=LOW:HIGH."""
    name, _, value = text.rpartition("=")
    with suppress(ValueError):
        numbers = [float(part) for part in value.split(":")]
        if name and len(numbers) in (1, 2):
            return name, (numbers[0] if len(numbers) == 2 else -numbers[0], numbers[-1])
    raise invalid("limit", text, "NAME=SIZE or NAME=LOW:HIGH", "Such as F=10 or F=-1:2.")

"""`robustpolish export`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from robustpolish.app.cli.options import choice, result_options
from robustpolish.base.atomic_writes import check_new_file
from robustpolish.base.budget import progress_bar
from robustpolish.base.checks import invalid
from robustpolish.implementation.emulation import METHODS
from robustpolish.implementation.export.files import target
from robustpolish.implementation.realization import FORMS
from robustpolish.synthesis.design import Design

_KINDS = ("c", "mat", "json", "fmu")


@click.command()
@click.option("--design", "file", required=True, type=click.Path(), help="A saved design (.json).")
@click.option("--period", required=True, type=float, help="Seconds between samples.")
@click.option(
    "--delay", default=0.0, show_default=True, help="Seconds from a sample until it acts."
)
@choice("--method", METHODS, "How the controller is imitated at the samples.")
@click.option("--prewarp-hz", type=float, help="Where tustin is exact.")
@click.option("--anti-aliasing", type=float, help="Corner of a Butterworth filter, in Hz.")
@click.option("--order", type=int, help="Reduce the controller to so many states first.")
@click.option("--tolerance", type=float, help="Or: to as few as cost this part of the norm, 0.05.")
@click.option("--form", type=click.Choice(FORMS), help="Coordinates in which it is computed.")
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="NAME=SIZE",
    help="Limit of a control, or NAME=LOW:HIGH; once for each.",
)
@choice("--precision", ("double", "float"), "Of the C file.")
@click.option("--name", default="controller", show_default=True, help="Of files and functions.")
@click.option(
    "--to",
    "kinds",
    multiple=True,
    type=click.Choice(_KINDS),
    default=("c",),
    show_default=True,
    help="What to write; once for each.",
)
@click.option("--test-vectors", default=0, help="Random samples to write beside the C file.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, exists=True),
    default=".",
    help="Existing folder for the files; here by default.",
)
@result_options
def export(
    file: str,
    period: float,
    delay: float,
    method: str,
    prewarp_hz: float | None,
    anti_aliasing: float | None,
    order: int | None,
    tolerance: float | None,
    form: str | None,
    limits: tuple[str, ...],
    precision: str,
    name: str,
    kinds: tuple[str, ...],
    test_vectors: int,
    out: str,
    force: bool,
) -> tuple[Any, ...]:
    """Turn a saved design into code: sampled, certified, and written for other programs.

    The loop is certified with sampler, hold, delay and filter before anything is written. The exit
    code is 1 if it is unstable, with the longest period that keeps it stable.
    """
    for kind in kinds:
        check_new_file(target(out, name, f".{kind}"), force)
    if test_vectors and "c" in kinds:
        check_new_file(Path(out) / f"{name}_vectors.csv", force)
    design = Design.load(Path(file))
    said = []
    if order is not None or tolerance is not None:
        with progress_bar("Reducing the controller"):
            design = design.reduce(order=order, tolerance=tolerance)
        said.append(design.message)
    with progress_bar("Certifying the sampled loop"):
        sampled = design.discretize(
            period, delay, method, prewarp_hz=prewarp_hz, anti_aliasing=anti_aliasing
        )
    if form is not None:
        sampled = sampled.realization(form)
    bounds = dict(_limit(text) for text in limits) or None
    writers = {
        "c": partial(sampled.export_c, precision=precision, test_vectors=test_vectors),
        "mat": sampled.export_mat,
        "json": sampled.export_json,
        "fmu": sampled.export_fmu,
    }
    written = [
        str(writers[kind](out, name, limits=bounds, force=force)) for kind in dict.fromkeys(kinds)
    ]
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
    try:
        numbers = [float(part) for part in value.split(":")]
    except ValueError:
        numbers = []
    if not name or len(numbers) not in (1, 2):
        raise invalid("limit", text, "NAME=SIZE or NAME=LOW:HIGH", "Such as F=10 or F=-1:2.")
    return name, (-numbers[0], numbers[0]) if len(numbers) == 1 else (numbers[0], numbers[1])

"""`robustpolish tell-apart`."""

from __future__ import annotations

from pathlib import Path

import click

from robustpolish.cli.measurement import (
    Reading,
    load_data,
    measurement_options,
    pairs,
    replaceable,
)
from robustpolish.cli.options import (
    PICTURES,
    check_json,
    options,
    result_options,
    show,
    stages,
    to_json,
)
from robustpolish.identification import Diagnosis
from robustpolish.identification import tell_apart as tell_machines_apart
from robustpolish.identification.record import over_time
from robustpolish.models import MechanicalModel
from robustpolish.saving import check_new_file, new_file
from robustpolish.validation import described, invalid, positive

_conditions = options(
    click.option(
        "--noise",
        "noises",
        multiple=True,
        metavar="OUTPUT=SIZE",
        help="Standard deviation in SI units, as in x=2e-6; repeatable.",
    ),
    click.option(
        "--limit",
        "limits",
        multiple=True,
        metavar="SIGNAL=SIZE",
        help="Largest value of an input or output in SI units, as in F=50; repeatable.",
    ),
)


@click.command("tell-apart")
@click.argument("data", type=click.Path())
@click.argument("machines", nargs=-1, required=True, type=click.Path())
@click.option("--pair", default=1, show_default=True, help="Which of a diagnosis's pairs.")
@_conditions
@click.option("--fit/--no-fit", default=True, help="Fit the machines to DATA first, or not.")
@measurement_options
@click.option("--plot", type=click.Path(dir_okay=False), help="Save the picture (.png, .svg).")
@result_options
def tell_apart(
    data: str,
    machines: tuple[str, ...],
    pair: int,
    noises: tuple[str, ...],
    limits: tuple[str, ...],
    fit: bool,
    reading: Reading,
    plot: str | None,
    json_out: str | None,
    force: bool,
) -> None:
    """Find the experiment that tells two machines apart which DATA does not.

    MACHINES is a diagnosis, as `robustpolish diagnose --save found.json` writes it, or two models
    (TOML). Both machines are simulated in some twenty experiments, at 0.3 to 10 times the
    amplitudes of DATA. The exit code is 0 whether one tells them apart or none does, and 2 for
    bad input.
    """
    replace = force or replaceable(json_out, data, *machines)
    check_json(json_out, replace)
    if plot is not None:
        check_new_file(plot, force, PICTURES)
    given = _machines(machines)
    model = given.model if isinstance(given, Diagnosis) else given[0]
    over_time(data)
    record = load_data(data, model, reading)
    with stages("Trying experiments") as tell:
        found = tell_machines_apart(
            given,
            record,
            pair=pair - 1,
            noise=_sizes("--noise", noises, "--noise x=2e-6"),
            limits=_sizes("--limit", limits, "--limit F=50"),
            fit=fit,
            progress=tell,
        )
    content = found.to_dict()
    to_json(content)  # nothing is written if anything fails
    if plot is not None:
        with new_file(plot, force, PICTURES) as draft:
            found.plot_panels().savefig(draft, dpi=150)
    show(content, repr(found), json_out, replace)


def _machines(paths: tuple[str, ...]) -> Diagnosis | tuple[MechanicalModel, MechanicalModel]:
    """Load a diagnosis, or two models."""
    if len(paths) == 1 and Path(paths[0]).suffix == ".json":
        return Diagnosis.load(paths[0])
    if len(paths) != 2:
        shown = described(f"{len(paths)} files: {', '.join(paths)}")
        raise invalid(
            "MACHINES", shown, "one diagnosis (.json), or two models (.toml)", "Add the other one."
        )
    first, second = (MechanicalModel.from_toml(Path(path)) for path in paths)
    return first, second


def _sizes(option: str, items: tuple[str, ...], example: str) -> dict[str, float]:
    given = pairs(option, items, "NAME=SIZE", example)
    return {name: positive(option, value, "SI units") for name, value in given.items()}

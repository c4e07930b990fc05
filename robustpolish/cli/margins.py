"""`robustpolish margins`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import matplotlib.pyplot as plt

from robustpolish.cli.options import PICTURES, check_json, choice, result_options, show, to_json
from robustpolish.long_calls import working
from robustpolish.loops import LoopRequirements, loop_analysis
from robustpolish.machine_design import read_design_task
from robustpolish.models import GeneralizedPlant, MechanicalModel
from robustpolish.saving import check_new_file, new_file
from robustpolish.synthesis import Design
from robustpolish.validation import described, invalid

_KINDS = ("nyquist", "bode", "nichols", "sigma", "step")


@click.command()
@click.option(
    "--design",
    "design_file",
    required=True,
    type=click.Path(dir_okay=False),
    help="A design that was saved (JSON).",
)
@click.option("--plant", type=click.Path(dir_okay=False), help="Try it on this plant (JSON).")
@click.option("--model", type=click.Path(dir_okay=False), help="Or on this machine (TOML).")
@click.option(
    "--sample-rate",
    type=float,
    default=LoopRequirements.sample_rate_hz,
    show_default=True,
    help="Sampling in Hz that can be bought.",
)
@click.option(
    "--delay",
    type=float,
    default=LoopRequirements.delay_s,
    show_default=True,
    help="Seconds that measurement and drive take besides sampling.",
)
@choice("--kind", _KINDS, "What --plot shows.")
@click.option("--plot", type=click.Path(dir_okay=False), help="Save a picture (.png, .svg, .pdf).")
@result_options
def margins(
    design_file: str,
    plant: str | None,
    model: str | None,
    sample_rate: float,
    delay: float,
    kind: Any,
    plot: str | None,
    json_out: str | None,
    force: bool,
) -> None:
    """Show margins, bandwidths, noise, effort and sampling of a design, and what limits it.

    The controller is that of the design; the plant too, unless another one is given. The exit code
    is 0 however small the margins are, and 2 for bad input.
    """
    if plant is not None and model is not None:
        shown = described("--plant and --model")
        raise invalid("--model", shown, "one of the two", "Leave one out.")
    check_json(json_out, force)
    if plot is not None:
        check_new_file(plot, force, PICTURES)
    asked = LoopRequirements(sample_rate_hz=sample_rate, delay_s=delay)
    design = Design.load(design_file)
    machine = _machine(design, plant, model)
    with working("Analysing the loop"):
        analysis = loop_analysis(machine, design.controller, requirements=asked)
    content = {
        **analysis.to_dict(),
        "buildable": analysis.buildable,
        "problems": list(analysis.problems),
        "words": analysis.explain(),
    }
    to_json(content)  # nothing is written if anything fails
    if plot is not None:
        with new_file(plot, force, PICTURES) as draft:
            figure: Any = analysis.plot(kind=kind).figure
            figure.savefig(draft, dpi=150)
            plt.close(figure)
    lines = str(analysis).splitlines()
    text = "\n".join([*lines[:-1], "", click.wrap_text(analysis.explain(), 88)])
    show(content, text, json_out, force)


def _machine(design: Design, plant: str | None, model: str | None) -> GeneralizedPlant:
    """Return the plant that measures what the design does."""
    wanted = design.plant
    if plant is not None:
        given = GeneralizedPlant.load(plant)
    elif model is not None:
        given = _as_wired(Path(model), wanted)
    else:
        return wanted
    found = [given] if given.delays else [given, given.with_full_state()]
    for candidate in found:
        if candidate.measurement_names == wanted.measurement_names:
            return candidate
    return next((candidate for candidate in found if candidate.ny == wanted.ny), given)


def _as_wired(model: Path, wanted: GeneralizedPlant) -> GeneralizedPlant:
    """Return a machine with its actuators, sensors and delays, measured as a design wants it."""
    machine = MechanicalModel.from_toml(model)
    known = {*machine.output_names, *machine.free, *(f"d{name}" for name in machine.free)}
    names = [name.removeprefix("measured_") for name in wanted.measurement_names]
    task = read_design_task(
        model,
        controls=wanted.control_names,
        measurements=names if known.issuperset(names) else (),
        weights={},
        full_state=False,
    )
    return task.plant

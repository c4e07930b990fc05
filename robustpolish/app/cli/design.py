"""Commands on designs: `design`, `margins`, `modes` and `norms`, of the robot or any machine."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
import control
import numpy as np

import robustpolish
from robustpolish.app.cli.options import (
    READINGS,
    brush_options,
    choice,
    claimed_places,
    machine_options,
    options,
    place_options,
    result_options,
    save_picture,
    stages,
    to_json,
)
from robustpolish.app.design_task import METHODS, machine_plant
from robustpolish.app.documents import (
    brush_design_report,
    brush_design_summary,
    brush_design_text,
    machine_design_report,
    save_brush_design,
    save_machine_design,
)
from robustpolish.app.html import render_html
from robustpolish.app.machine_design import design_machine, read_design_task
from robustpolish.base.budget import progress_bar
from robustpolish.base.checks import described, invalid, positive
from robustpolish.linear.modes import modes as modes_of
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.loops.analysis import loop_analysis
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.air_bearing import air_bearing
from robustpolish.polishing.design import design_against_brush
from robustpolish.signals.frequency_response import ratio_unit
from robustpolish.synthesis.design import Design

# A command that hands over to another one where a machine is named.

_NAMES = ("--model", "--plant")


def command_with_any_machine(other: click.Command) -> type[click.Command]:
    """Return the class of a command of the polishing robot with a sibling for any machine.

    Parameters
    ----------
    other : click.Command
        What is called where ``--model`` or ``--plant`` stands among the arguments.

    Returns
    -------
    type
        To be passed to ``click.command(cls=...)``.
    """

    class Either(click.Command):
        def make_context(
            self,
            info_name: str | None,
            args: list[str],
            parent: click.Context | None = None,
            **extra: Any,
        ) -> click.Context:
            named = any(arg.partition("=")[0] in _NAMES for arg in args)
            try:
                if named:
                    return other.make_context(info_name, args, parent, **extra)
                return super().make_context(info_name, args, parent, **extra)
            except click.NoSuchOption as error:
                if not named and error.option_name in _options(other):
                    raise _explained(error, "It needs --model or --plant.") from None
                if named and error.option_name in _options(self):
                    raise _explained(error, "It is one of the polishing robot.") from None
                raise

        def invoke(self, ctx: click.Context) -> Any:
            return other.invoke(ctx) if ctx.command is other else super().invoke(ctx)

        def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
            super().format_epilog(ctx, formatter)
            with formatter.section("For any other machine"):
                formatter.write_text(f"{ctx.command_path} --model machine.toml, see")
                formatter.write_text(f"{ctx.command_path} --model machine.toml --help")

    return Either


def _options(command: click.Command) -> set[str]:
    return {name for option in command.params for name in option.opts}


def _explained(error: click.NoSuchOption, why: str) -> click.NoSuchOption:
    return click.NoSuchOption(error.option_name, f"{error.message} {why}", ctx=error.ctx)


# The options that name a machine and its signals.

given_machine_options = options(
    click.option("--model", type=click.Path(), help="Mechanical model, a TOML file."),
    click.option("--plant", type=click.Path(), help="Or a plant that was saved (.json)."),
)
"""Which machine: --model or --plant."""

channel_options = options(
    click.option("--performance", multiple=True, metavar="NAME", help="What is kept small."),
    click.option("--disturbance", multiple=True, metavar="NAME", help="What disturbs."),
)
"""From where to where: --disturbance and --performance, each repeatable."""


def named_machine(model: str | None, plant: str | None) -> MechanicalModel | GeneralizedPlant:
    """Return the machine in a file, which exactly one of two options names."""
    if model is not None and plant is not None:
        shown = described("--model and --plant")
        raise invalid("--plant", shown, "one of the two", "Leave one out.")
    if plant is not None:
        return GeneralizedPlant.load(plant)
    return MechanicalModel.from_toml(Path(model or ""))


DEFAULT_OUT = "robustpolish-results"

_controller_options = options(
    click.option("--control", multiple=True, metavar="NAME", help="What acts; repeatable."),
    click.option("--measure", multiple=True, metavar="NAME", help="What is measured; repeatable."),
    channel_options,
    click.option("--full-state", is_flag=True, default=None, help="Measure all states."),
    click.option("--norm", type=click.Choice(("hinf", "h2")), help="Minimised; hinf by default."),
    click.option("--method", type=click.Choice(METHODS), help="auto by default."),
    click.option("--order", type=int, help="States of the controller; as many as it takes."),
    click.option(
        "--control-weight",
        multiple=True,
        metavar="[NAME=]SIZE",
        help="Price of a unit of control in units of what is kept small.",
    ),
    click.option(
        "--noise",
        multiple=True,
        metavar="[NAME=]SIZE",
        help="Noise on measurements in their units, per unit of a disturbance.",
    ),
    click.option("--sample-rate", type=float, help="Sample the controller so often, in Hz."),
    click.option("--delay", type=float, help="Seconds from a sample until its control acts."),
    click.option("--anti-aliasing", type=float, help="Corner of a Butterworth filter, in Hz."),
)


@click.command("design")
@given_machine_options
@click.option(
    "--weights",
    type=click.Path(),
    help="TOML file with the sections [design] and [weights], instead of those of the model.",
)
@_controller_options
@place_options("Folder for design, plant, table and figure.")
@result_options
def machine_design(
    model: str | None,
    plant: str | None,
    weights: str | None,
    out: str | None,
    report: str | None,
    force: bool,
    **given: Any,
) -> tuple[Any, ...]:
    """Design a controller for a machine, certify it and tell what its loop is like.

    The machine is a mechanical model (TOML), effects linearised about the state of rest, or a
    plant (JSON). What its sections [design] and [weights] say counts unless an option says
    otherwise. `robustpolish margins` and `export` read the design.json of the folder.
    """
    if report == "" and out is None:
        out = DEFAULT_OUT
    machine = named_machine(model, plant)
    source = Path(model) if model is not None and weights is None else machine
    section = None if weights is None else Path(weights)
    task = read_design_task(source, section, **_changes(given))
    with claimed_places(out, report, force) as (folder, page):
        for note in task.notes:
            click.echo(f"... {note}", err=True)
        with stages("Designing") as tell:
            found = design_machine(task)
            content = found.to_dict()
            to_json(content)  # nothing is written if anything fails
            if page is not None:
                tell("writing the report")
                html = render_html(machine_design_report(found), robustpolish.__version__)
                page.write_text(html, encoding="utf-8")
            if folder is not None:
                save_machine_design(found, folder)
    words = [click.wrap_text(text, 88) for text in (*found.notes, found.analysis.explain())]
    lines = repr(found).splitlines()[: -len(words)]
    return content, "\n".join([*lines, "", *words]), out, report


def _changes(given: dict[str, Any]) -> dict[str, Any]:
    """Return what was said on the command line, by the names of a task."""
    names = {
        "controls": given["control"],
        "measurements": given["measure"],
        "performance": given["performance"],
        "disturbances": given["disturbance"],
        "control_weight": _sizes("--control-weight", given["control_weight"]),
        "measurement_noise": _sizes("--noise", given["noise"]),
        "sample_rate_hz": given["sample_rate"],
        "computation_delay": given["delay"],
        "anti_aliasing_hz": given["anti_aliasing"],
        **{name: given[name] for name in ("full_state", "norm", "method", "order")},
    }
    return {name: value for name, value in names.items() if value not in (None, ())}


def _sizes(option: str, items: tuple[str, ...]) -> float | dict[str, float] | None:
    """Read one number for all, or NAME=SIZE for each."""
    found: dict[str, float] = {}
    for item in items:
        name, equals, size = item.rpartition("=")
        value = positive(option, size, zero=True)
        if not equals:
            if len(items) > 1:
                shown, want = described(f"{item} besides others"), "one number, or NAME=SIZE each"
                raise invalid(option, shown, want, "Name the signals.")
            return value
        found[name] = value
    return found or None


# `robustpolish modes` for any machine.


@click.command("modes")
@given_machine_options
@result_options
def machine_modes(model: str | None, plant: str | None, force: bool) -> tuple[Any, ...]:
    """Show natural frequencies, damping ratios and the state that carries each mode.

    Effects of a mechanical model are linearised about the state of rest.
    """
    machine = named_machine(model, plant)
    given = machine.linearize() if isinstance(machine, MechanicalModel) else machine
    return shown_modes(given.open_loop)


def shown_modes(system: control.StateSpace) -> tuple[dict[str, Any], str]:
    """Return the modes of a system as plain values and as text."""
    found = modes_of(system)
    return {"modes": [asdict(mode) for mode in found]}, str(found)


# `robustpolish norms` for any machine, and how norms are shown.


@click.command("norms")
@given_machine_options
@channel_options
@result_options
def machine_norms(
    model: str | None,
    plant: str | None,
    performance: tuple[str, ...],
    disturbance: tuple[str, ...],
    force: bool,
) -> tuple[Any, ...]:
    """Show the H-infinity and H2 norms from disturbances to performance outputs, uncontrolled.

    Of a mechanical model all inputs disturb and all free coordinates are outputs, unless some are
    named; effects are linearised about the state of rest.
    """
    machine = named_machine(model, plant)
    pushed = machine.free if isinstance(machine, MechanicalModel) else ()
    given = machine_plant(machine, pushed, (), performance, disturbance)
    units = {
        ratio_unit(given.units.get(z, ""), given.units.get(w, ""))
        for z in given.performance_names
        for w in given.disturbance_names
    }
    content, text = shown_norms(given.open_loop, units.pop() if len(units) == 1 else "")
    names = f"from {', '.join(given.disturbance_names)} to {', '.join(given.performance_names)}"
    content |= {"disturbances": given.disturbance_names, "performance": given.performance_names}
    return content, f"{names}\n{text}"


def shown_norms(system: control.StateSpace, unit: str) -> tuple[dict[str, Any], str]:
    """Return both norms of a system as plain values and as text."""
    hinf, h2 = hinf_norm(system), h2_norm(system)
    peak_hz = hinf.frequency / (2 * np.pi)
    content = {
        "hinf": {
            "value": hinf.value,
            "lower": hinf.lower,
            "upper": hinf.upper,
            "frequency_hz": peak_hz,
            "reason": hinf.reason,
        },
        "h2": {"value": h2.value, "reason": h2.reason},
        "unit": {"hinf": unit, "h2": f"{unit} s^-0.5" if unit else ""},
    }
    own, squared = (f" {unit}", f" {unit} s^-1/2") if unit else ("", "")
    lines = (
        f"H-infinity  {hinf.value:.7g}{own} at {peak_hz:.6g} Hz",
        f"            certified between {hinf.lower:.10g} and {hinf.upper:.10g}",
        f"H2          {h2.value:.7g}{squared}",
        *filter(None, (hinf.reason, h2.reason)),
    )
    return content, "\n".join(lines)


# `robustpolish design`, the main job.


@click.command(cls=command_with_any_machine(machine_design))
@brush_options
@click.option(
    "--ideal",
    is_flag=True,
    help="The thesis's state feedback of twelve states and six ideal forces, instead of what can "
    "be built; so do the options of it below.",
)
@click.option(
    "--actuation",
    type=click.Choice(("force", "displacement")),
    help="Of the ideal, where the control enters: forces (10.41), the default, or (10.40).",
)
@click.option("--norm", type=click.Choice(("hinf", "h2")), help="Of the ideal; hinf by default.")
@click.option("--method", type=click.Choice(("lmi", "riccati")), help="Of the ideal.")
@click.option("--backend", type=click.Choice(("cvxpy", "picos")), help="Of the ideal.")
@click.option(
    "--control-weight",
    type=float,
    help="Of the ideal: price of a unit of control in metres; 1e-7 for forces and 1e-8 for "
    "velocities, unless a gain bound is given.",
)
@click.option(
    "--gain-bound", type=float, help="Of the ideal: largest singular value that the gain may have."
)
@machine_options
@place_options("Folder for table, figure, code and signals.")
@result_options
def design(
    ideal: bool,
    reading: str,
    dissipation: float,
    out: str | None,
    report: str | None,
    force: bool,
    **options: Any,
) -> tuple[Any, ...]:
    """Design a controller for the polishing robot, certify it and try it on the brush.

    By default one that can be built: two gap sensors, two actuators, a computer at 20 kHz. The
    same forces drive the machine with and without control; the table shows the largest deviations.
    """
    if report == "" and out is None:
        out = DEFAULT_OUT
    with claimed_places(out, report, force) as (folder, page), stages("Designing") as tell:
        job = design_against_brush(
            realisation="ideal" if ideal else None,
            parameters=READINGS[reading](),
            dissipation=dissipation,
            tell=tell,
            **options,
        )
        summary = brush_design_summary(job)
        if page is not None:
            tell("Writing the report ...")
            html = render_html(brush_design_report(job), robustpolish.__version__)
            page.write_text(html, encoding="utf-8")
        if folder is not None:
            save_brush_design(job, folder)
            (folder / "design.json").write_text(to_json(summary) + "\n", encoding="utf-8")
    return summary, brush_design_text(job), out, report


# `robustpolish margins`.

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
    force: bool,
) -> tuple[Any, ...]:
    """Show margins, bandwidths, noise, effort and sampling of a design, and what limits it.

    The controller is that of the design; the plant too, unless another one is given. The exit code
    is 0 however small the margins are, and 2 for bad input.
    """
    if plant is not None and model is not None:
        shown = described("--plant and --model")
        raise invalid("--model", shown, "one of the two", "Leave one out.")
    asked = LoopRequirements(sample_rate_hz=sample_rate, delay_s=delay)
    design = Design.load(design_file)
    machine = _machine(design, plant, model)
    with progress_bar("Analysing the loop"):
        analysis = loop_analysis(machine, design.controller, requirements=asked)
    content = {
        **analysis.to_dict(),
        "buildable": analysis.buildable,
        "problems": list(analysis.problems),
        "words": analysis.explain(),
    }
    to_json(content)  # nothing is written if anything fails
    save_picture(plot, force, lambda: analysis.plot(kind=kind).figure)
    lines = str(analysis).splitlines()
    return content, "\n".join([*lines[:-1], "", click.wrap_text(analysis.explain(), 88)])


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


# `robustpolish modes`.


@click.command(cls=command_with_any_machine(machine_modes))
@machine_options
@result_options
def modes(reading: str, dissipation: float, force: bool) -> tuple[Any, ...]:
    """Show natural frequencies, damping ratios and the state that carries each mode."""
    return shown_modes(air_bearing(READINGS[reading](), dissipation).open_loop)


# `robustpolish norms`.


@click.command(cls=command_with_any_machine(machine_norms))
@machine_options
@result_options
def norms(reading: str, dissipation: float, force: bool) -> tuple[Any, ...]:
    """Show the H-infinity and H2 norms from the brush forces to the six displacements.

    Nothing is controlled; the norms are what a controller has to reduce.
    """
    return shown_norms(air_bearing(READINGS[reading](), dissipation).open_loop, "m/N")

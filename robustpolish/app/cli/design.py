"""Commands on designs: `design`, `margins`, `modes` and `norms`, of the robot or any machine."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
import control
import numpy as np

import robustpolish
from robustpolish.app import documents
from robustpolish.app.cli import options as cli
from robustpolish.app.design_task import METHODS, machine_plant
from robustpolish.app.html import Report, render_html
from robustpolish.app.machine_design import design_machine, read_design_task
from robustpolish.base.budget import progress_bar
from robustpolish.base.checks import described, invalid, misfit, positive
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

    def names(command: click.Command) -> set[str]:
        return {name for known in command.params for name in known.opts}

    class Either(click.Command):
        def make_context(
            self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any
        ) -> click.Context:
            named = any(arg.partition("=")[0] in ("--model", "--plant") for arg in args)
            try:
                if named:
                    return other.make_context(info_name, args, parent, **extra)
                return super().make_context(info_name, args, parent, **extra)
            except click.NoSuchOption as error:
                if error.option_name not in names(self if named else other):
                    raise
                why = (
                    "It is one of the polishing robot." if named else "It needs --model or --plant."
                )
                message = f"{error.message} {why}"
                raise click.NoSuchOption(error.option_name, message, ctx=error.ctx) from None

        def invoke(self, ctx: click.Context) -> Any:
            return other.invoke(ctx) if ctx.command is other else super().invoke(ctx)

        def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
            super().format_epilog(ctx, formatter)
            with formatter.section("For any other machine"):
                formatter.write_text(f"{ctx.command_path} --model machine.toml, see")
                formatter.write_text(f"{ctx.command_path} --model machine.toml --help")

    return Either


# The options that name a machine and its signals.

given_machine_options = cli.options(
    cli.option("--model", "Mechanical model: a TOML file, or air-bearing.", click.Path()),
    cli.option("--plant", "Or a plant that was saved (.json).", click.Path()),
)
"""Which machine: --model or --plant."""

channel_options = cli.options(
    cli.repeatable("--performance", "NAME", "What is kept small."),
    cli.repeatable("--disturbance", "NAME", "What disturbs."),
)
"""From where to where: --disturbance and --performance, each repeatable."""


def named_machine(model: str | None, plant: str | None) -> MechanicalModel | GeneralizedPlant:
    """Return the machine in a file, which exactly one of two options names."""
    if model is not None and plant is not None:
        raise misfit("--plant", "--model and --plant", "one of the two", "Leave one out.")
    if plant is not None:
        return GeneralizedPlant.load(plant)
    return cli.mechanical_model(model or "")


DEFAULT_OUT = "robustpolish-results"

_PRICE = "Price of a unit of control in units of what is kept small."
_NOISE = "Noise on measurements in their units, per unit of a disturbance."
_controller_options = cli.options(
    cli.repeatable("--control", "NAME", "What acts; repeatable."),
    cli.repeatable("--measure", "NAME", "What is measured; repeatable."),
    channel_options,
    click.option("--full-state", is_flag=True, default=None, help="Measure all states."),
    cli.option("--norm", "Minimised; hinf by default.", click.Choice(("hinf", "h2"))),
    cli.option("--method", "auto by default.", click.Choice(METHODS)),
    cli.option("--order", "States of the controller; as many as it takes.", int),
    cli.repeatable("--control-weight", "[NAME=]SIZE", _PRICE),
    cli.repeatable("--noise", "[NAME=]SIZE", _NOISE),
    cli.option("--sample-rate", "Sample the controller so often, in Hz.", float),
    cli.option("--delay", "Seconds from a sample until its control acts.", float),
    cli.option("--anti-aliasing", "Corner of a Butterworth filter, in Hz.", float),
)
_TASK = {
    "control": "controls", "measure": "measurements", "disturbance": "disturbances",
    "noise": "measurement_noise", "sample_rate": "sample_rate_hz", "delay": "computation_delay",
    "anti_aliasing": "anti_aliasing_hz",
}  # fmt: skip
"""Parameters of a task that options call by another name."""


_SECTIONS = "TOML file with the sections [design] and [weights], instead of those of the model."


def _write_report(page: Path, report: Report) -> None:
    page.write_text(render_html(report, robustpolish.__version__), encoding="utf-8")


@click.command("design")
@given_machine_options
@cli.option("--weights", _SECTIONS, click.Path())
@_controller_options
@cli.place_options("Folder for design, plant, table and figure.")
@cli.result_options
def machine_design(
    model: str | None, plant: str | None, weights: str | None, out: str | None,
    report: str | None, force: bool, **given: Any,
) -> tuple[Any, ...]:  # fmt: skip
    """Design a controller for a machine, certify it and tell what its loop is like.

    The machine is a mechanical model (TOML), effects linearised about the state of rest, or a
    plant (JSON). What its sections [design] and [weights] say counts unless an option says
    otherwise. `robustpolish margins` and `export` read the design.json of the folder.
    """
    out = out or (DEFAULT_OUT if report == "" else None)
    machine = named_machine(model, plant)
    source = cli.named_source(model) if model is not None and weights is None else machine
    section = None if weights is None else Path(weights)
    for name, option_name in (("control_weight", "--control-weight"), ("noise", "--noise")):
        given[name] = _sizes(option_name, given[name])
    changes = {_TASK.get(name, name): value for name, value in given.items()}
    changes = {name: value for name, value in changes.items() if value not in (None, ())}
    task = read_design_task(source, section, **changes)
    with cli.claimed_places(out, report, force) as (folder, page):
        for note in task.notes:
            click.echo(f"... {note}", err=True)
        with cli.stages("Designing") as tell:
            found = design_machine(task)
            content = found.to_dict()
            cli.to_json(content)  # nothing is written if anything fails
            if page is not None:
                tell("writing the report")
                _write_report(page, documents.machine_design_report(found))
            if folder is not None:
                documents.save_machine_design(found, folder)
    words = [click.wrap_text(text, 88) for text in (*found.notes, found.analysis.explain())]
    lines = repr(found).splitlines()[: -len(words)]
    return content, "\n".join([*lines, "", *words]), out, report


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
@cli.result_options
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
@cli.result_options
def machine_norms(
    model: str | None, plant: str | None, performance: Any, disturbance: Any, force: bool
) -> tuple[Any, ...]:
    """Show the H-infinity and H2 norms from disturbances to performance outputs, uncontrolled.

    Of a mechanical model all inputs disturb and all free coordinates are outputs, unless some are
    named; effects are linearised about the state of rest.
    """
    machine = named_machine(model, plant)
    pushed = machine.free if isinstance(machine, MechanicalModel) else ()
    given = machine_plant(machine, pushed, (), performance, disturbance)
    w, z = given.disturbance_names, given.performance_names
    pairs = {(given.units.get(end, ""), given.units.get(start, "")) for end in z for start in w}
    units = {ratio_unit(*pair) for pair in pairs}
    content, text = shown_norms(given.open_loop, units.pop() if len(units) == 1 else "")
    content |= {"disturbances": w, "performance": z}
    return content, f"from {', '.join(w)} to {', '.join(z)}\n{text}"


def shown_norms(system: control.StateSpace, unit: str) -> tuple[dict[str, Any], str]:
    """Return both norms of a system as plain values and as text."""
    hinf, h2 = hinf_norm(system), h2_norm(system)
    peak_hz = hinf.frequency / (2 * np.pi)
    bounds = {name: getattr(hinf, name) for name in ("value", "lower", "upper")}
    content = {
        "hinf": {**bounds, "frequency_hz": peak_hz, "reason": hinf.reason},
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


_IDEAL = (
    "The thesis's state feedback of twelve states and six ideal forces, instead of what can be "
    "built; so do the options of it below."
)
_ACTUATION = "Of the ideal, where the control enters: forces (10.41), the default, or (10.40)."
_WEIGHT = (
    "Of the ideal: price of a unit of control in metres; 1e-7 for forces and 1e-8 for velocities, "
    "unless a gain bound is given."
)
_BOUND = "Of the ideal: largest singular value that the gain may have."


@click.command(cls=command_with_any_machine(machine_design))
@cli.brush_options
@cli.option("--ideal", _IDEAL, is_flag=True)
@cli.option("--actuation", _ACTUATION, click.Choice(("force", "displacement")))
@cli.option("--norm", "Of the ideal; hinf by default.", click.Choice(("hinf", "h2")))
@cli.option("--method", "Of the ideal.", click.Choice(("lmi", "riccati")))
@cli.option("--backend", "Of the ideal.", click.Choice(("cvxpy", "picos")))
@cli.option("--control-weight", _WEIGHT, float)
@cli.option("--gain-bound", _BOUND, float)
@cli.machine_options
@cli.place_options("Folder for table, figure, code and signals.")
@cli.result_options
def design(
    ideal: bool, reading: str, dissipation: float, out: str | None, report: str | None,
    force: bool, **given: Any,
) -> tuple[Any, ...]:  # fmt: skip
    """Design a controller for the polishing robot, certify it and try it on the brush.

    By default one that can be built: two gap sensors, two actuators, a computer at 20 kHz. The
    same forces drive the machine with and without control; the table shows the largest deviations.
    """
    out = out or (DEFAULT_OUT if report == "" else None)
    with cli.claimed_places(out, report, force) as (folder, page), cli.stages("Designing") as tell:
        machine = {"parameters": cli.READINGS[reading](), "dissipation": dissipation}
        kind = "ideal" if ideal else None
        job = design_against_brush(realisation=kind, tell=tell, **machine, **given)
        summary = documents.brush_design_summary(job)
        if page is not None:
            tell("Writing the report ...")
            _write_report(page, documents.brush_design_report(job))
        if folder is not None:
            documents.save_brush_design(job, folder)
            (folder / "design.json").write_text(cli.to_json(summary) + "\n", encoding="utf-8")
    return summary, documents.brush_design_text(job), out, report


# `robustpolish margins`.


_RATE, _DELAY = LoopRequirements.sample_rate_hz, LoopRequirements.delay_s


@click.command()
@cli.option("--design design_file", "A design that was saved (JSON).", cli.FILE, required=True)
@cli.option("--plant", "Try it on this plant (JSON).", cli.FILE)
@cli.option("--model", "Or on this machine (TOML).", cli.FILE)
@cli.option("--sample-rate", "Sampling in Hz that can be bought.", float, _RATE)
@cli.option("--delay", "Seconds that measurement and drive take besides sampling.", float, _DELAY)
@cli.choice("--kind", ("nyquist", "bode", "nichols", "sigma", "step"), "What --plot shows.")
@cli.option("--plot", "Save a picture (.png, .svg, .pdf).", cli.FILE)
@cli.result_options
def margins(
    design_file: str, plant: str | None, model: str | None, sample_rate: float, delay: float,
    kind: Any, plot: str | None, force: bool,
) -> tuple[Any, ...]:  # fmt: skip
    """Show margins, bandwidths, noise, effort and sampling of a design, and what limits it.

    The controller is that of the design; the plant too, unless another one is given. The exit code
    is 0 however small the margins are, and 2 for bad input.
    """
    if plant is not None and model is not None:
        raise misfit("--model", "--plant and --model", "one of the two", "Leave one out.")
    asked = LoopRequirements(sample_rate_hz=sample_rate, delay_s=delay)
    design = Design.load(design_file)
    machine = _machine(design, plant, model)
    with progress_bar("Analysing the loop"):
        analysis = loop_analysis(machine, design.controller, requirements=asked)
    words = analysis.explain()
    content = {**analysis.to_dict(), "buildable": analysis.buildable}
    content |= {"problems": list(analysis.problems), "words": words}
    cli.to_json(content)  # nothing is written if anything fails
    cli.save_picture(plot, force, lambda: analysis.plot(kind=kind).figure)
    lines = str(analysis).splitlines()
    return content, "\n".join([*lines[:-1], "", click.wrap_text(words, 88)])


def _machine(design: Design, plant: str | None, model: str | None) -> GeneralizedPlant:
    """Return the plant that measures what the design does."""
    wanted = design.plant
    if plant is not None:
        given = GeneralizedPlant.load(plant)
    elif model is not None:
        # With its actuators, sensors and delays.
        machine = cli.mechanical_model(model)
        known = {*machine.output_names, *machine.free, *(f"d{name}" for name in machine.free)}
        names = [name.removeprefix("measured_") for name in wanted.measurement_names]
        own = {"controls": wanted.control_names, "weights": {}, "full_state": False}
        heard = names if known.issuperset(names) else ()
        given = read_design_task(cli.named_source(model), measurements=heard, **own).plant
    else:
        return wanted
    found = [given] if given.delays else [given, given.with_full_state()]
    for candidate in found:
        if candidate.measurement_names == wanted.measurement_names:
            return candidate
    return next((candidate for candidate in found if candidate.ny == wanted.ny), given)


# `robustpolish modes`.


@click.command(cls=command_with_any_machine(machine_modes))
@cli.machine_options
@cli.result_options
def modes(reading: str, dissipation: float, force: bool) -> tuple[Any, ...]:
    """Show natural frequencies, damping ratios and the state that carries each mode."""
    return shown_modes(air_bearing(cli.READINGS[reading](), dissipation).open_loop)


# `robustpolish norms`.


@click.command(cls=command_with_any_machine(machine_norms))
@cli.machine_options
@cli.result_options
def norms(reading: str, dissipation: float, force: bool) -> tuple[Any, ...]:
    """Show the H-infinity and H2 norms from the brush forces to the six displacements.

    Nothing is controlled; the norms are what a controller has to reduce.
    """
    return shown_norms(air_bearing(cli.READINGS[reading](), dissipation).open_loop, "m/N")

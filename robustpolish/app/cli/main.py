"""The command `robustpolish`."""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from contextlib import suppress
from typing import Any

import click

import robustpolish

_COMMANDS = {
    "design": "Design a controller and certify it, for the polishing robot or any --model.",
    "modes": "Show modes and damping ratios, of the polishing robot or any --model.",
    "norms": "Show H-infinity and H2 norms without control, of the polishing robot or any --model.",
    "margins": "Tell what the loop of a saved design is like, and whether it can be built.",
    "export": "Sample a saved design, certify the loop and write C, MAT, JSON or an FMU.",
    "brush": "Simulate the brush on its mould and show the forces.",
    "simulate": "Simulate a machine, its effects included, with the controller that runs it.",
    "model": "Show the polishing robot's air bearing, or any model, as a TOML file.",
    "look": "Show what a measurement holds before there is a model, and draft one.",
    "compare": "Compare a mechanical model with a measurement.",
    "refit": "Fit the numbers of a mechanical model to measurements.",
    "try": "Add an effect to a mechanical model by hand and show what that does to the error.",
    "diagnose": "Name the effects that a mechanical model lacks.",
    "tell-apart": "Find the experiment that tells two models apart which a measurement does not.",
    "warm-up": "Compile now what is compiled on first use, once per user and version.",
}


_MODULES = {
    **dict.fromkeys(("design", "margins", "modes", "norms"), "design"),
    **dict.fromkeys(
        ("model", "look", "compare", "refit", "try", "diagnose", "tell-apart"), "learn"
    ),
}
"""Module of :mod:`robustpolish.app.cli` of each command that has none of its own name."""

_WITHOUT_MODEL = {
    "export": "The saved design of --design holds its machine.",
    "look": "It needs none: compare takes DATA and a model.",
    "tell-apart": "Machines are arguments, after the measurement.",
}
"""What to do where somebody looks for the option of the other commands."""


class _Group(click.Group):
    """Subcommands that are imported when they are used, so that --help is quick."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run a command; a full disk behind the standard output ends it with one line too."""
        try:
            return super().main(*args, **kwargs)
        except OSError as error:
            from robustpolish.base.input_files import is_write_error, storage_error

            if not is_write_error(error):
                raise
            with suppress(OSError):  # what is still in the buffer would be tried again at the end
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            click.echo(f"Error: {storage_error(error.filename or 'output', error)}", err=True)
            sys.exit(1)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a subcommand; say where its machine comes from if it has no --model.

        Warnings are notes, each once, without the line of code that they come from.
        """
        shown: set[str] = set()

        def note(message: Warning | str, *_: Any, **__: Any) -> None:
            if str(message) not in shown:
                click.echo(f"Note: {message}", err=True)
            shown.add(str(message))

        try:
            with warnings.catch_warnings():
                warnings.showwarning = note
                return super().invoke(ctx)
        except click.NoSuchOption as error:
            name = error.ctx.info_name if error.ctx else None
            if error.option_name not in ("--model", "--plant") or name not in _WITHOUT_MODEL:
                raise
            says = f"{error.message} {_WITHOUT_MODEL[name]}"
            raise click.NoSuchOption(error.option_name, says, ctx=error.ctx) from None

    def list_commands(self, ctx: click.Context) -> list[str]:
        del ctx
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        del ctx
        if cmd_name not in _COMMANDS:
            return None
        name = cmd_name.replace("-", "_")
        module = importlib.import_module(f"robustpolish.app.cli.{_MODULES.get(cmd_name, name)}")
        return getattr(module, name, None) or getattr(module, f"{name}_")

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        del ctx
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))


@click.command(cls=_Group)
@click.version_option(robustpolish.__version__, prog_name="robustpolish")
def main() -> None:
    """Robust control design with certificates, for machines with contact.

    Without arguments, design, modes, norms and brush work on the thesis's polishing robot; with
    --model machine.toml or --plant plant.json the first three work on any machine.
    """

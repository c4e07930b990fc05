"""A command that hands over to another one where a machine is named."""

from __future__ import annotations

from typing import Any

import click

_NAMES = ("--model", "--plant")


def or_any_machine(other: click.Command) -> type[click.Command]:
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

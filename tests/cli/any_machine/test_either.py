"""Two commands of one name: the robot's, and that for any machine."""

import click
import pytest
from click.testing import CliRunner

from robustpolish.app.cli.design import command_with_any_machine
from tests.cli.command_line import run


@click.command("look")
@click.option("--model")
@click.option("--plant")
@click.option("--far", is_flag=True)
def other(model, plant, far):
    click.echo(f"other {model} {plant} {far}")


@click.command(cls=command_with_any_machine(other))
@click.option("--near", is_flag=True)
def look(near):
    click.echo(f"own {near}")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "own False"),
        (["--near"], "own True"),
        (["--model", "m", "--far"], "other m None True"),
        (["--plant=p"], "other None p False"),
        (["--far"], "It needs --model or --plant."),
        (["--model", "m", "--near"], "It is one of the polishing robot."),
        (["--neither"], "No such option"),
        (["--help"], "For any other machine"),
        (["--model", "m", "--help"], "--far"),
    ],
)
def test_who_is_called(arguments, says):
    assert says in CliRunner().invoke(look, arguments).output


def test_commands_say_that_there_is_a_sibling():
    for command in ("design", "modes", "norms"):
        assert f"robustpolish {command} --model" in run(command, "--help").stdout.replace(
            "main", "robustpolish"
        )
        assert "--plant" in run(command, "--model", "m.toml", "--help").stdout

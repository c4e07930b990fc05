"""The command and its subcommands: help, version, what does not exist."""

import subprocess
import sys

import click
import pytest

import robustpolish as rp
from robustpolish.app.cli.main import main
from tests.cli.command_line import run


def test_help_lists_every_command():
    text = run("--help").stdout
    for command in ("design", "modes", "norms", "brush"):
        assert command in text
        assert "Usage" in run(command, "--help").stdout
    assert rp.__version__ in run("--version").stdout
    assert "No such command" in run("nonsense", code=2).stderr


@pytest.mark.parametrize(
    ("command", "says"), [("brush", "--mould"), ("export", "--design"), ("tell-apart", "arguments")]
)
def test_a_command_without_a_model_says_where_its_machine_comes_from(command, says):
    message = run(command, "--model", "m.toml", code=2).stderr
    assert "No such option" in message
    assert says in message
    assert "Did you mean" not in message


def test_only_the_command_that_is_used_is_imported():
    context = click.Context(main)
    for name in main.list_commands(context):
        command = main.get_command(context, name)
        assert command is not None
        assert command.name == name
    assert main.get_command(context, "nonsense") is None


def test_help_imports_no_subcommand():
    """Help stays quick because nothing else is imported for it."""
    program = (
        "import sys, robustpolish.app.cli.main\n"
        "robustpolish.app.cli.main(['--help'], standalone_mode=False)\n"
        "names = {name for name in sys.modules if name.startswith('robustpolish.app.cli.main.')}\n"
        "assert names == {'robustpolish.app.cli.main'}, names\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr

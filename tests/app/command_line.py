"""Run the command as a user would."""

from click.testing import CliRunner, Result

from robustpolish.app.cli.main import main


def run(*arguments: str, code: int = 0) -> Result:
    """Call `robustpolish` with arguments; it has to end with this exit code."""
    result = CliRunner().invoke(main, arguments)
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == code, result.output
    return result

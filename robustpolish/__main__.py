"""Run the command line by ``python -m robustpolish``."""

from robustpolish.cli import main

if __name__ == "__main__":
    main(prog_name="robustpolish")

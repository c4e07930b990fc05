"""Build the sdist and the wheel, and use the wheel where there is nothing else.

``python -m tests.package.check`` builds both into a temporary folder, has their descriptions
checked, compares what they hold with what the repository does, installs the wheel into an empty
environment outside the checkout, and runs the demo there and the examples of all docstrings.
"""

import os
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = "robustpolish"


def run(*command, cwd=ROOT):
    """Run a command that sees nothing of the checkout; stop where it fails."""
    print("$", *map(str, command), flush=True)
    bare = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL"))}
    subprocess.run([str(part) for part in command], cwd=cwd, env=bare, check=True)


def kept():
    """Return the files of the package that the repository keeps."""
    listed = subprocess.run(
        ["git", "ls-files", PACKAGE], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return set(listed.stdout.split())


def left_out(built):
    """Return by name what an sdist or a wheel does not hold of the package."""
    out = {}
    for path in built:
        if path.suffix == ".whl":
            with zipfile.ZipFile(path) as archive:
                names = set(archive.namelist())
        else:
            with tarfile.open(path) as archive:
                names = {name.partition("/")[2] for name in archive.getnames()}
        out[path.name] = sorted(kept() - names)
    return out


def main():
    """Build, look, install, run."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        run(sys.executable, "-m", "build", "--outdir", home / "dist", ROOT)
        built = sorted((home / "dist").iterdir())
        run(sys.executable, "-m", "twine", "check", "--strict", *built)
        for name, missing in left_out(built).items():
            print(f"{name}: {len(kept()) - len(missing)} of {len(kept())} files")
            if missing:
                return f"{name} lacks {', '.join(missing)}"
        venv.create(home / "empty", with_pip=True)
        bin_folder = home / "empty" / "bin"
        wheel = next(path for path in built if path.suffix == ".whl")
        run(bin_folder / "pip", "install", "--quiet", "--disable-pip-version-check", wheel)
        run(bin_folder / "pip", "check")
        run(bin_folder / PACKAGE, "design", "--out", "results", "--report", cwd=home)
        run(bin_folder / "python", Path(__file__).parent / "examples.py", PACKAGE, cwd=home)
    return 0


if __name__ == "__main__":
    sys.exit(main())

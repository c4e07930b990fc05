"""The documentation builds without a warning; the notebooks have tests of their own."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_pages_build_without_a_warning(tmp_path):
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-D", "nb_execution_mode=off"]
    built = subprocess.run(
        [*command, "-b", "html", str(ROOT / "docs"), str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    assert (tmp_path / "notebooks" / "01_the_machine.html").exists()
    page = (tmp_path / "theory_certificates.html").read_text(encoding="utf-8")
    assert "<math" in page
    assert "succ" not in page.split("<article")[1].split("</article>")[0]

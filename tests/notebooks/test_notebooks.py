"""Every notebook runs from end to end, at a small size, without a warning."""

import os
import subprocess
import sys
from pathlib import Path

import jupytext
import nbclient
import nbformat
import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.md"))
LONG = (
    "00_learn_the_air_bearing",
    "03_state_feedback",
    "04_output_feedback",
    "05_find_the_hidden_effect",
    "06_measured_data",
    "07_the_bridge",
    "08_from_weights_to_code",
    "09_from_measurement_to_proof",
    "10_polishing_a_mould",
    "11_the_spindle_as_a_beam",
    "12_brush_and_machine_together",
    "13_your_own_machine",
    "14_a_classical_design",
    "15_more_measured_machines",
)
"""Half a minute to a minute each; the documentation executes them as well."""


@pytest.fixture(scope="module")
def fonts(tmp_path_factory):
    """A list of fonts of our own, made before a notebook draws.

    The one at home may have been written by a Python whose matplotlib is gone, and is believed.
    """
    folder = tmp_path_factory.mktemp("matplotlib")
    subprocess.run(
        [sys.executable, "-c", "import matplotlib.font_manager"],
        env={**os.environ, "MPLCONFIGDIR": str(folder)},
        check=True,
    )
    return folder


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(path, marks=pytest.mark.long) if path.stem in LONG else path
        for path in NOTEBOOKS
    ],
    ids=lambda path: path.stem,
)
def executed(request, tmp_path_factory, fonts):
    """Run a notebook in an empty folder: it must bring its data with it."""
    patch = pytest.MonkeyPatch()
    patch.setenv("robustpolish_SMALL", "1")
    patch.setenv("MPLCONFIGDIR", str(fonts))
    patch.setenv("TQDM_DISABLE", "1")  # what is left on standard error is a complaint
    notebook = jupytext.read(request.param)
    folder = tmp_path_factory.mktemp(request.param.stem)
    try:
        nbclient.NotebookClient(
            notebook,
            timeout=300,
            kernel_name="python3",
            resources={"metadata": {"path": str(folder)}},
        ).execute()
    finally:
        patch.undo()
    return notebook


def test_a_notebook_runs_asks_and_answers(executed):
    code = [cell for cell in executed.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in code)
    complaints = [
        output["text"]
        for cell in code
        for output in cell.outputs
        if output.output_type == "stream" and output["name"] == "stderr"
    ]
    assert not complaints
    first = next(cell for cell in executed.cells if cell.cell_type == "markdown")
    assert "**Question:" in first.source
    headings = [cell.source for cell in executed.cells if cell.cell_type == "markdown"]
    assert headings[-1].splitlines()[0] == "## Answer" or "## Answer" in headings[-1]
    (answer,) = code[-1].outputs
    assert "**" in answer["data"]["text/markdown"]
    assert any("image/png" in o.get("data", {}) for cell in code for o in cell.outputs)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_no_output_is_committed(path):
    notebook = jupytext.read(path)
    assert all(not cell.get("outputs") for cell in notebook.cells)
    assert notebook.metadata["jupytext"]["text_representation"]["format_name"] == "myst"
    assert "../shared" not in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_pair_with_outputs_is_in_step(path):
    """After a change of the text `make notebooks` has to write its pair again."""
    pair = nbformat.read(path.with_suffix(".ipynb"), as_version=4)
    nbformat.validate(pair)
    text = jupytext.read(path)
    assert [_kept(cell) for cell in pair.cells] == [_kept(cell) for cell in text.cells]
    code = [cell for cell in pair.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    kinds = {(o.output_type, o.get("name")) for cell in code for o in cell.outputs}
    assert kinds <= {("display_data", None), ("execute_result", None), ("stream", "stdout")}
    config = jupytext.config.load_jupytext_config(str(path))
    again = jupytext.writes(pair, "md:myst", config=config)
    assert again == path.read_text(encoding="utf-8"), "saving in JupyterLab would change the text"


def test_every_pair_has_its_text():
    assert sorted(path.stem for path in NOTEBOOKS[0].parent.glob("*.ipynb")) == [
        path.stem for path in NOTEBOOKS
    ]


def _kept(cell):
    return cell.cell_type, cell.source, cell.metadata.get("tags", [])

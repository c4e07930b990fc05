"""What any released version saved loads for ever, proven anew, with the figures of then."""

import json
from pathlib import Path

import pytest

import robustpolish as rp

VERSIONS = sorted(path for path in Path(__file__).parent.iterdir() if (path / "told.json").exists())
FILES = [path for folder in VERSIONS for path in sorted(folder.iterdir()) if path.stem != "told"]


def test_the_first_version_is_among_them():
    assert "0.1.0" in [folder.name for folder in VERSIONS]
    assert len([path for path in FILES if path.parent.name == "0.1.0"]) == 14


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_it_loads(path):
    loaded = rp.load(path)
    assert repr(loaded)
    told = json.loads((path.parent / "told.json").read_text()).get(path.stem)
    if told is not None:
        assert isinstance(loaded, rp.results.Design | rp.results.SampledDesign)
        assert loaded.certificate.valid
        assert loaded.certificate.achieved == pytest.approx(told["achieved"], rel=1e-6)
        assert loaded.method == told["method"]


@pytest.mark.parametrize("folder", VERSIONS, ids=lambda folder: folder.name)
def test_what_the_files_tell_is_still_there(folder):
    blocks = rp.load(folder / "tuned_blocks.json").details["blocks"]
    assert list(blocks) == ["pid_x"]
    (region,) = rp.load(folder / "pole_region.json").details["pole_regions"]
    assert isinstance(region, rp.HalfPlane)
    (damper,) = rp.load(folder / "passive_feedback.json").details["elements"]
    assert damper.kind == "damper"
    assert dict(rp.load(folder / "wired.json").delays) == {"F": 1e-4}
    assert rp.load(folder / "diagnosis.json").verdict == "missing_effect"
    machine = rp.load(folder / "machine.toml")
    assert [effect.kind for effect in machine.effects] == ["coulomb_friction", "own"]
    assert rp.load(folder / "own.json").model.effects[1].kind == "own"


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_it_is_saved_as_before(path, tmp_path):
    """What is loaded and saved again loads as the same: no key is lost on the way."""
    loaded = rp.load(path)
    if path.suffix == ".toml":
        assert loaded.to_toml() == path.read_text()
        return
    loaded.save(tmp_path / "again.json")
    before, after = (json.loads(p.read_text()) for p in (path, tmp_path / "again.json"))
    assert set(before) <= set(after)
    assert before["robustpolish"] == after["robustpolish"]

import numpy as np
import pytest

import robustpolish as rp
from tests.brush import moulds

SIDE = np.linspace(-30.0, 30.0, 61)  # mm
HEIGHTS = 1e3 * moulds.height(1e-3 * SIDE[:, None], 1e-3 * SIDE[None, :])


def test_a_file_gives_what_the_array_gives(tmp_path):
    file = tmp_path / "grid.csv"
    lines = [["x/y", *SIDE], *([x, *row] for x, row in zip(SIDE, HEIGHTS, strict=True))]
    file.write_text("\n".join(",".join(map(str, line)) for line in lines))
    alone = tmp_path / "alone.csv"
    np.savetxt(alone, HEIGHTS, delimiter=",", fmt="%.17g")
    wanted = rp.polishing.Mould.from_array(HEIGHTS, SIDE, SIDE, unit="mm")
    x, y = moulds.places()
    found = rp.polishing.Mould.from_csv(file, unit="mm")
    np.testing.assert_allclose(found.height(x, y), wanted.height(x, y), atol=1e-15)
    found = rp.polishing.Mould.from_csv(alone, unit="mm", spacing=1.0)
    np.testing.assert_allclose(found.height(x + 0.03, y + 0.03), wanted.height(x, y), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "none"),
        (",1,2,3\n1,2\n", "unequal"),
        (",0,1,2,3\n0,1,1,1,one\n1,1,1,1,1\n2,1,1,1,1\n3,1,1,1,1\n", "'one' in row 2, column 5"),
        (",0,1,2,3\n0,1,1,,1\n1,1,1,1,1\n2,1,1,1,1\n3,1,1,1,1\n", r"1 that are no number"),
        (",0,1,2,4\n0,1,1,1,1\n1,1,1,1,1\n2,1,1,1,1\n3,1,1,1,1\n", "equally spaced"),
    ],
)
def test_files_that_are_no_grid_are_refused(tmp_path, text, message):
    file = tmp_path / "grid.csv"
    file.write_text(text)
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.polishing.Mould.from_csv(file)


def test_arrays_are_checked():
    with pytest.raises(rp.InvalidInputError, match="heights"):
        rp.polishing.Mould.from_array(HEIGHTS[:, 1:], SIDE, SIDE)
    with pytest.raises(rp.InvalidInputError, match="x"):
        rp.polishing.Mould.from_array(HEIGHTS[:3], SIDE[:3], SIDE)
    with pytest.raises(rp.InvalidInputError, match="can be read"):
        rp.polishing.Mould.from_csv("no_such_file.csv")

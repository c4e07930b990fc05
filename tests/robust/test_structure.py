import pytest

import robustpolish as rp
from robustpolish.robust.loop_model import read_structure, structure_of


def test_forms():
    structure = read_structure(["real", ("complex", 2), ("full", (2, 3)), [-3, 0], [1, 1]])
    assert [block.kind for block in structure.blocks] == [
        "real",
        "complex",
        "full",
        "real",
        "complex",
    ]
    assert structure.shape == (1 + 2 + 3 + 3 + 1, 1 + 2 + 2 + 3 + 1)
    assert structure.inputs[2] == slice(3, 6)
    assert structure.outputs[2] == slice(3, 5)


def test_of_a_system():
    k = rp.uncertain.real("k", 1, percent=10)
    d = rp.uncertain.dynamics("d", (2, 3))
    system = rp.uncertain.append(k * k, d)
    assert [(b.kind, b.copies, b.name) for b in structure_of(system.blocks).blocks] == [
        ("real", 2, "k"),
        ("full", 1, "d"),
    ]
    assert read_structure(system.blocks) == structure_of(system.blocks)


def test_bad():
    with pytest.raises(rp.InvalidInputError, match=r"blocks\[1\]"):
        read_structure(["real", 1.5])


def test_groups_are_carried():
    fit = rp.uncertain.ellipsoid({"k": 10.0, "c": 1.0}, [[2.0, 0.0], [0.1, 0.1]], name="fit")
    system = fit["k"] * fit["c"] + rp.uncertain.real("g", 1.0, percent=10)
    found = {block.name: block.group for block in structure_of(system.blocks).blocks}
    assert found == {"fit[0]": "fit", "fit[1]": "fit", "g": ""}

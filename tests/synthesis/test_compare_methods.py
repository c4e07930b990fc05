"""The comparison table holds certified numbers only."""

import matplotlib as mpl
import numpy as np
import pytest
from published_plants import scherer_1997

import robustpolish as rp
from robustpolish.synthesis.compare import compare_methods

mpl.use("Agg")


@pytest.fixture(scope="module")
def table():
    return compare_methods(scherer_1997(), time_limit=20.0)


def test_every_method_comes_close(table):
    assert [r.method for r in table] == ["auto", "riccati", "lmi/cvxpy", "lmi/picos", "slycot"]
    for result in table:
        assert result.achieved == pytest.approx(9.508, rel=0.01), result.message
        assert result.design.certificate.valid
        assert result.claimed >= result.achieved * (1 - 1e-3)
        assert 0 <= result.order <= 3
        assert result.gain > 0
        assert result.condition >= 1


def test_the_table_prints(table):
    text = str(table).splitlines()
    assert text[0].split() == [
        "method", "status", "claimed", "achieved", "gain", "condition", "order", "seconds",
    ]  # fmt: skip
    assert len(text) == 6
    assert "<td>lmi/picos</td>" in table._repr_html_()
    assert len(table) == 5
    with pytest.raises(KeyError):
        table["newton"]


def test_the_plot_shows_every_method(table):
    ax = table.plot()
    assert len(ax.lines) == 5
    assert ax.get_xscale() == "log"
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == [r.method for r in table]


def test_failures_are_listed_with_their_reason():
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[0.0]], [[1.0]], [[1.0]])
    table = compare_methods(plant, ["riccati", "slycot"])
    assert {r.status for r in table} == {"infeasible"}
    assert np.isnan(table["riccati"].achieved)
    assert "uncontrollable mode +1" in table["riccati"].message
    assert f"riccati: {table['riccati'].message}"[:60] in str(table)
    assert not table.plot().lines


@pytest.mark.parametrize("methods", [["magic"], "riccati", ["lmi/gurobi"], ["riccati/scipy"]])
def test_unknown_methods_are_refused(methods):
    with pytest.raises(rp.InvalidInputError, match=r"^methods: "):
        compare_methods(scherer_1997(), methods)

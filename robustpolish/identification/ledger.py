"""The error ledger: how far the error fell with every step, and what is left to noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any


@dataclass(frozen=True)
class Entry:
    """One step: what was done, and the free-run error over each output's deviation after it."""

    step: str
    nrmse: Mapping[str, float]


@dataclass(frozen=True)
class Ledger:
    """Entries in order, and the noise floor of each output.

    Examples
    --------
    >>> ledger = Ledger(noise_floor={"x": 0.01}).add("base", {"x": 0.5})
    >>> ledger = ledger.add("coulomb_friction", {"x": 0.02})
    >>> ledger.falls("x")
    [('base', 0.5, 0.5), ('coulomb_friction', -0.48, 0.02), ('noise floor', -0.01, 0.01)]
    """

    entries: tuple[Entry, ...] = ()
    noise_floor: Mapping[str, float] = field(default_factory=dict)

    def add(self, step: str, nrmse: Mapping[str, float] | Any) -> Ledger:
        """Return the ledger with one more entry.

        Parameters
        ----------
        step : str
        nrmse : mapping of str to float, or a comparison
            Errors by output; a comparison's outputs are read.
        """
        if not isinstance(nrmse, Mapping):
            nrmse = {name: output.nrmse for name, output in nrmse.outputs.items()}
        return replace(self, entries=(*self.entries, Entry(step, dict(nrmse))))

    def falls(self, output: str) -> list[tuple[str, float, float]]:
        """Return step, change and level for a waterfall picture of one output."""
        steps, last = [], 0.0
        for entry in self.entries:
            level = entry.nrmse[output]
            steps.append((entry.step, round(level - last, 12), level))
            last = level
        if output in self.noise_floor:
            floor = self.noise_floor[output]
            steps.append(("noise floor", round(floor - last, 12), floor))
        return steps

    def to_list(self) -> list[dict[str, Any]]:
        """Return the entries as plain data."""
        return [{"step": e.step, "nrmse": dict(e.nrmse)} for e in self.entries]

    def plot(self, output: str | None = None, ax: Any = None) -> Any:
        """Draw the waterfall of one output, the first by default; return the axes."""
        import matplotlib.pyplot as plt

        name = output or next(iter(self.entries[0].nrmse))
        axes = plt.subplots()[1] if ax is None else ax
        last = 0.0
        for i, (step, change, level) in enumerate(self.falls(name)):
            whole = i == 0 or step == "noise floor"
            bottom = 0.0 if whole else min(last, level)
            colour = "tab:gray" if whole else ("tab:green" if change < 0 else "tab:red")
            axes.bar(step, level if whole else abs(change), bottom=bottom, color=colour)
            axes.text(i, max(last, level) if not whole else level, f"{level:.3g}", ha="center")
            last = level
        axes.set_ylabel(f"error of {name} over its standard deviation")
        axes.tick_params(axis="x", rotation=30)
        return axes

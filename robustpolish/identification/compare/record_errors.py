"""The errors of simulated records, over all of them and of each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robustpolish.identification.compare.output_error import output_error
from robustpolish.identification.compare.simulated import Simulated
from robustpolish.identification.findings.record_error import OutputError, RecordError
from robustpolish.models.mechanical import MechanicalModel


def output_errors(model: MechanicalModel, found: Sequence[Simulated]) -> dict[str, OutputError]:
    """Return the errors of each output over records together."""
    measured = np.concatenate([part.record.Y[part.first :] for part in found])
    simulated = np.concatenate([part.outputs[part.first :] for part in found])
    return {
        item.name: output_error(item.name, model.unit_of(item), measured[:, i], simulated[:, i])
        for i, item in enumerate(model.outputs)
    }


def record_errors(model: MechanicalModel, found: Sequence[Simulated]) -> dict[str, RecordError]:
    """Return the errors of each record by its name."""
    return {
        part.record.name: RecordError(output_errors(model, [part]), part.starts, part.found)
        for part in found
    }

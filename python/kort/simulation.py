"""`simulate`: a recording from a model, with the stand's sensors."""

from __future__ import annotations

import json
from collections.abc import Mapping
from os import PathLike, fspath
from typing import Any

from . import _kort
from .recording import Recording, _taken


def simulate(
    rig: str | PathLike[str],
    scenario: str | PathLike[str] | Mapping[str, Any],
    *,
    seed: int | None = None,
    noise: float | None = None,
) -> Recording:
    """Makes a recording from a model, with the sensors of the rig.

    ``rig`` and ``scenario`` are files or names of shipped ones; a scenario may be a mapping with a scenario's keys too,
    for example the ``next_experiment.scenario`` of a diagnosis. ``seed`` and ``noise`` (a factor on the usual sensor
    noise, 0 is off) go before the scenario's. Raises ``ValueError`` with file, key and what is allowed."""
    if isinstance(scenario, Mapping):
        table = _kort.simulate(fspath(rig), "scenario", json.dumps(dict(scenario)), seed, noise)
    else:
        table = _kort.simulate(fspath(rig), fspath(scenario), None, seed, noise)
    return _taken(table)

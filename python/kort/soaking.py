"""`soak`: control laws compared on the same plant, faults and references."""

from __future__ import annotations

import json
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any

from . import _kort
from .reports import build, write_text

Path = str | PathLike[str]


@dataclass(frozen=True)
class Score:
    """A score over the seeds."""

    mean: float
    """Mean, in the unit at the end of the score's name."""
    ci95: tuple[float | None, float | None] | None = None
    """95 % interval of the mean."""


@dataclass(frozen=True)
class WorstWindow:
    """Where a law tracked worst."""

    rms_n: float | None
    """Thrust error there, root mean square, N."""
    time_s: tuple[float, float]
    """From when to when, s."""


@dataclass(frozen=True)
class Law:
    """A control law's scores in one scenario."""

    name: str
    """Its name."""
    scores: dict[str, Score | None]
    """By name, the unit last; none where it is not known."""
    against_plain: dict[str, Score | None] | None
    """Ratio to the plain velocity servo (1), where that ran too."""
    seeds: int
    """Runs."""
    pareto: bool
    """No other law is better in both thrust error and energy per useful newton-second."""
    worst_window: WorstWindow
    """Where it tracked worst."""


@dataclass(frozen=True)
class Scenario:
    """One scenario on one rig."""

    name: str
    """Its name."""
    rig: str
    """The rig."""
    what: str
    """In words."""
    thrust_max_n: float
    """Largest steady thrust, N."""
    laws: list[Law]
    """The laws compared."""
    verdict: str
    """In words."""


@dataclass(frozen=True)
class Adoption:
    """What adopting a diagnosis did to a law."""

    scenario: str
    """Scenario."""
    seed: int
    """Seed."""
    law: str
    """Law."""
    hidden: list[Any]
    """Effects hidden in the plant."""
    adopted: list[Any]
    """Effects adopted."""
    before: float | None
    """Thrust error before, root mean square, N."""
    after: float | None
    """After, N."""
    truth_told: float | None
    """With the truth told, N."""
    ratio: float | None
    """After over before (1)."""


@dataclass(frozen=True)
class Soak:
    """The report of `kort soak`, schema ``kort.soak/1``."""

    schema: str
    """``kort.soak/1``"""
    seconds: float
    """Length of the scenarios, each once, s."""
    virtual_seconds: float
    """Time that passed for the thrusters, all runs together, s."""
    scenarios: list[Scenario]
    """Scenario by scenario."""
    document: dict[str, Any]
    """The JSON document that this mirrors."""
    html: str
    """The report as one self-contained page."""
    adoption: list[Adoption] | None = None
    """What adopting diagnoses did, where that was asked for."""

    def write_html(self, path: Path) -> None:
        """Writes the report's page."""
        write_text(path, self.html)

    def plot(self) -> Any:
        """Thrust error against energy, a panel a scenario; a matplotlib figure."""
        from . import plots

        return plots.soak(self)


def soak(
    scenarios: Path | list[Path],
    *,
    controllers: list[str] | None = None,
    rigs: list[Path] | None = None,
    seeds: int | None = None,
    seed: int = 1,
    jobs: int = 0,
    adopt: bool = False,
) -> Soak:
    """Runs control laws through the same scripted hours in virtual time and compares them.

    ``scenarios`` are files or names of shipped ones (``soak-towed``), ``all`` for every one of less than an hour;
    ``controllers`` files of ``config/controllers`` without ending, laws, ``default`` (the rig's own) or ``drive_limits``
    (what no law can better), the scenario's by default; ``rigs`` go before the scenario's. ``seeds`` runs each, the first
    with ``seed``; ``jobs`` at the same time, 0 for all cores. ``adopt`` hides effects, diagnoses, adopts and runs again.

    Raises ``ValueError`` with file, key and what is allowed."""
    several = scenarios if isinstance(scenarios, list) else [scenarios]
    text, html = _kort.soak(
        [fspath(s) for s in several], [fspath(r) for r in rigs or []], controllers, seeds, seed, jobs, adopt
    )
    document = json.loads(text)
    report: Soak = build(Soak, {**document, "document": document, "html": html})
    return report

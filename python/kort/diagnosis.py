"""`diagnose`: what the model left out."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any

from . import _kort
from .recording import Source, given
from .reports import Channel, FittedEffect, HeldOut, Parameter, asked, build, write_text


@dataclass(frozen=True)
class Baseline:
    """The model, fitted again within what the rig states."""

    model: str
    """Its name."""
    parameters: list[Parameter]
    """Its parameters."""
    channels: dict[str, Channel]
    """Its errors by column."""
    effects: list[FittedEffect] | None = None
    """Effects that are taken to be there, because the rig states them or ``with_effects`` does; none where nothing is."""


@dataclass(frozen=True)
class Mismatch:
    """Where model and recording differ."""

    path: str
    """drive, shaft, blade, flow or sensor."""
    channel: str
    """The column where it shows most."""
    regime: str
    """When and where, in words."""
    time_s: list[tuple[float, float]]
    """Spans in which most of it lies, s."""
    significance_sigma: float | None
    """How far beyond the noise, in standard deviations."""
    share_of_excess_error: float | None
    """Its share of the error above the noise (0 to 1)."""


@dataclass(frozen=True)
class Finding:
    """An effect that the model leaves out."""

    effect: str
    """Catalogue identifier."""
    path: str
    """drive, shaft, blade, flow or sensor."""
    probability: float
    """Calibrated probability that it is present."""
    statement: str
    """In words."""
    equation: str
    """Its equation."""
    parameters: list[Parameter]
    """Its fitted values."""
    heldout: HeldOut
    """Gain on rows that were not fitted."""
    confounded_with: list[str]
    """Effects that this recording cannot tell from it."""
    evidence: list[str]
    """Why, in words."""
    not_adopted: str | None = None
    """Why a rig description does not take it over; none where it does."""


@dataclass(frozen=True)
class Explanation:
    """A set of effects that explains the recording."""

    effects: list[str]
    """Its effects; none is the model alone."""
    probability: float
    """Its probability."""


@dataclass(frozen=True)
class Remainder:
    """What the named effects leave."""

    share_of_excess_error: float | None
    """Of the squared error above the noise (0 to 1)."""
    path: str
    """Where it acts."""
    channel: str
    """The column where it shows most."""
    regime: str
    """When and where, in words."""
    nrmse: dict[str, float | None]
    """Root mean square over full scale (1) by column."""


@dataclass(frozen=True)
class Alternative:
    """An effect that was tried and set aside."""

    effect: str
    """Catalogue identifier."""
    probability: float
    """Its probability."""
    why_not: str
    """Why, in words."""


@dataclass(frozen=True)
class EmpiricalTerm:
    """What is known of a mismatch without a name."""

    path: str
    """Where it enters."""
    enters: str
    """What it adds to, with its unit."""
    expression: str
    """Formula with numbers."""
    variables: list[str]
    """Variables in it."""
    parameters: list[Parameter]
    """Fitted values."""
    heldout: HeldOut
    """Gain on rows that were not fitted."""


@dataclass(frozen=True)
class NextExperiment:
    """The run that would settle what this one cannot."""

    separates: list[str]
    """Effects that it parts."""
    excitation: str
    """What to do, in words."""
    why: str
    """Why, in words."""
    scenario: dict[str, Any]
    """A scenario for :func:`kort.simulate`, or for a thruster's test signal."""


@dataclass(frozen=True)
class Diagnosis:
    """The report of `kort diagnose`, schema ``kort.diagnosis/2``."""

    schema: str
    """``kort.diagnosis/2``"""
    kort_version: str
    """Version of kort."""
    recordings: list[str]
    """Recordings by name."""
    rig: str
    """Rig by name."""
    seed: int
    """Seed of everything drawn at random."""
    seconds: float
    """Length of the recordings together, s."""
    verdict: str
    """no_mismatch, explained, partly_explained, ambiguous, unexplained or insufficient_data."""
    summary: str
    """One paragraph to act on."""
    baseline: Baseline
    """The model, fitted again."""
    mismatch: list[Mismatch]
    """Where model and recording differ."""
    findings: list[Finding]
    """Named effects."""
    explanations: list[Explanation]
    """Effects that are right together, likeliest first, until 0.95 is reached; none: not one of the catalogue."""
    remainder: Remainder | None
    """What is left, where that is real."""
    alternatives: list[Alternative]
    """Effects set aside."""
    empirical_term: EmpiricalTerm | None
    """What is known where no name fits."""
    next_experiment: NextExperiment | None
    """What to run next."""
    notes: list[str]
    """Checks of the data."""
    document: dict[str, Any]
    """The JSON document that this mirrors."""
    rig_toml: str
    """The rig description with what is believed as its ``[[effects]]``, probability 0.7 and more without a rival and a size that
    can be told from nothing, and with what ``with_effects`` took as known, unless it may as well be zero."""
    html: str
    """The report as one self-contained page."""

    def write_rig(self, path: str | PathLike[str]) -> None:
        """Writes the rig description with what is believed."""
        write_text(path, self.rig_toml)

    def write_html(self, path: str | PathLike[str]) -> None:
        """Writes the report's page."""
        write_text(path, self.html)

    def plot(self) -> Any:
        """Held-out errors before and after each finding, and the odds of all effects; a matplotlib figure."""
        from . import plots

        return plots.diagnosis(self)


def diagnose(
    recordings: Source | list[Source],
    rig: str | PathLike[str] | None = None,
    *,
    model: str = "model2",
    with_effects: list[str] | None = None,
    columns: str | None = None,
    seed: int = 1,
    jobs: int | None = None,
    progress: Callable[[str], object] | None = None,
) -> Diagnosis:
    """Locates the mismatch between model and recordings, names the omitted physics, and shows the fit improve.

    The arguments are those of :func:`kort.fit`; ``with_effects`` are taken as known. Raises ``ValueError`` for input that
    cannot be used, with what is allowed and a hint."""
    wanted = asked(rig, model, with_effects, seed, jobs)
    text, rig_toml, html = _kort.diagnose(given(recordings, columns), wanted, progress)
    document = json.loads(text)
    report: Diagnosis = build(Diagnosis, {**document, "document": document, "rig_toml": rig_toml, "html": html})
    return report

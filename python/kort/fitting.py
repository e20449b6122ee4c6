"""`fit`: the parameters of a model from recordings."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any

from . import _kort
from .recording import Source, given
from .reports import Channel, FittedEffect, Parameter, asked, build, write_text


@dataclass(frozen=True)
class NotIdentifiable:
    """Parameters that these recordings cannot fix."""

    parameters: list[str]
    """Their names."""
    why: str
    """Why."""
    excitation: str
    """The run or the sensor that would fix them."""
    relative_std_error: float | None
    """What the data alone leave open: relative standard error of the worst of them (1)."""


@dataclass(frozen=True)
class Correlation:
    """Two parameters whose errors go together."""

    parameters: tuple[str, str]
    """Their names."""
    correlation: float
    """From -1 to 1."""


@dataclass(frozen=True)
class Starts:
    """What fits from further starts said."""

    tried: int
    """Fits tried."""
    agreed: int
    """Fits that ended in the same place."""
    worst_gap: float | None
    """How much worse the worst ended, in twice the log-likelihood."""


@dataclass(frozen=True)
class InitialState:
    """State at the first row of a recording."""

    recording: str
    """The recording."""
    shaft_speed_rad_s: float
    """Shaft speed, rad/s; positive turns ahead."""
    flow_m_s: float
    """Axial flow, m/s; positive ahead thrust's way."""
    estimated: bool
    """Fitted, rather than known because the recording begins at rest."""


@dataclass(frozen=True)
class Fit:
    """The report of `kort fit`, schema ``kort.fit/1``."""

    schema: str
    """``kort.fit/1``"""
    kort_version: str
    """Version of kort."""
    recordings: list[str]
    """Recordings by name."""
    rig: str
    """Rig by name."""
    model: str
    """Model."""
    seed: int
    """Seed of the starts."""
    seconds: float
    """Length of the recordings together, s."""
    parameters: list[Parameter]
    """Fitted values."""
    effects: list[FittedEffect]
    """Effects asked for."""
    channels: dict[str, Channel]
    """Errors by column."""
    not_identifiable: list[NotIdentifiable]
    """Groups that these recordings cannot fix."""
    correlations: list[Correlation]
    """Pairs whose errors correlate by more than 0.9."""
    symptoms: list[str]
    """Values that no thruster has, and what that tells."""
    starts: Starts
    """Do several starts agree?"""
    initial_states: list[InitialState]
    """States at the first rows."""
    notes: list[str]
    """Checks of the data."""
    document: dict[str, Any]
    """The JSON document that this mirrors."""
    rig_toml: str
    """The rig description with the fitted values, tol = two standard errors."""

    def __getitem__(self, name: str) -> Parameter:
        """A parameter by name."""
        return next(p for p in self.parameters if p.name == name)

    def write_rig(self, path: str | PathLike[str]) -> None:
        """Writes the rig description with the fitted values."""
        write_text(path, self.rig_toml)

    def plot(self) -> Any:
        """Fitted over stated values with two standard errors; a matplotlib figure."""
        from . import plots

        return plots.fit(self)


def fit(
    recordings: Source | list[Source],
    rig: str | PathLike[str] | None = None,
    *,
    model: str = "model2",
    with_effects: list[str] | None = None,
    columns: str | None = None,
    seed: int = 1,
    starts: int = 4,
    free_friction: bool = False,
    jobs: int | None = None,
    progress: Callable[[str], object] | None = None,
) -> Fit:
    """Identifies a model's parameters from recordings of one rig, with standard errors and a held-out score.

    ``rig`` is a file or a shipped rig's name; none takes the one that a recording of the service holds. ``model`` is
    model0, model1, model2, model3 or rotational_flow; ``with_effects`` are ids of the catalogue, fitted with it.
    ``columns`` is the column map for paths of foreign logs. ``jobs`` threads work, one a core by default, and the result
    is the same whatever their number. ``progress`` is called with words at each step.

    Raises ``ValueError`` for input that cannot be used, with what is allowed and a hint."""
    wanted = asked(rig, model, with_effects, seed, jobs)
    text, rig_toml = _kort.fit(given(recordings, columns), wanted, starts, free_friction, progress)
    document = json.loads(text)
    report: Fit = build(Fit, {**document, "document": document, "rig_toml": rig_toml})
    return report

"""What the reports of fit and diagnose share, and how their JSON becomes dataclasses."""

from __future__ import annotations

import dataclasses
import types
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

T = TypeVar("T")


@dataclass(frozen=True)
class Parameter:
    """A fitted value with its uncertainty."""

    name: str
    """Name, unit last."""
    value: float
    """Fitted value, in `unit`."""
    unit: str
    """Unit; "1" for a pure number."""
    std_error: float | None
    """Standard error (one sigma), in `unit`, what the rig states included."""
    stated: float | None = None
    """What the rig description states, in `unit`; none for an effect's value."""
    at_bound: bool | None = None
    """At the edge of what is allowed: a symptom, not a value."""


@dataclass(frozen=True)
class FittedEffect:
    """An effect that was fitted with the model."""

    effect: str
    """Catalogue identifier."""
    path: str
    """drive, shaft, blade, flow or sensor."""
    equation: str
    """Its equation."""
    parameters: list[Parameter]
    """Its fitted values."""


@dataclass(frozen=True)
class Channel:
    """Errors of a model on one column, root mean square over full scale (1)."""

    nrmse_train: float | None
    """On the rows fitted."""
    nrmse_heldout: float | None
    """On the rows held out."""
    noise_floor: float | None
    """What measurement noise alone would give."""
    white: bool
    """Is the residual white?"""


@dataclass(frozen=True)
class BeforeAfter:
    """Held-out errors on one column, root mean square over full scale (1)."""

    nrmse_before: float | None
    """Without the effect."""
    nrmse_after: float | None
    """With it."""


@dataclass(frozen=True)
class HeldOut:
    """Gain on rows that were not fitted."""

    channels: dict[str, BeforeAfter]
    """By column."""
    excess_error_removed: float | None
    """Share of the squared error above the noise floor that goes (0 to 1)."""
    interval_95: tuple[float | None, float | None]
    """Its 95 % interval."""


@dataclass(frozen=True)
class Asked:
    """What `fit` and `diagnose` ask beside recordings."""

    rig: str | None
    model: str
    with_effects: list[str]
    seed: int
    jobs: int | None


def asked(
    rig: str | PathLike[str] | None, model: str, with_effects: list[str] | None, seed: int, jobs: int | None
) -> Asked:
    """The same from what a user wrote."""
    return Asked(None if rig is None else fspath(rig), model, with_effects or [], seed, jobs)


def build(kind: Any, value: Any) -> Any:
    """A value of JSON as a dataclass, by its annotations. Keys that a newer program added are left out."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return None if value is None else build(next(a for a in arguments if a is not types.NoneType), value)
    if origin is list:
        return [build(arguments[0], one) for one in value]
    if origin is tuple:
        return tuple(build(a, one) for a, one in zip(arguments, value, strict=True))
    if origin is dict:
        return {key: build(arguments[1], one) for key, one in value.items()}
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        hints = get_type_hints(kind)
        wanted = {f.name: hints[f.name] for f in dataclasses.fields(kind) if f.name in value}
        return kind(**{name: build(hint, value[name]) for name, hint in wanted.items()})
    return float(value) if kind is float else value


def write_text(path: str | PathLike[str], text: str) -> None:
    """A result's file, UTF-8."""
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)

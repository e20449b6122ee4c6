from collections.abc import Callable, Sequence
from os import PathLike
from typing import Protocol, TypedDict, type_check_only

import numpy as np
import numpy.typing as npt

__all__ = [
    "__version__", "decode", "diagnose", "fit", "known_columns", "read", "simulate", "soak", "write",
]

@type_check_only
class Table(TypedDict):
    name: str
    time_s: npt.NDArray[np.float64]
    columns: dict[str, npt.NDArray[np.float64]]
    about: dict[str, str]
    notes: list[str]
    losses: list[str]
    unused: list[str]
    gaps: list[tuple[float, float]]

@type_check_only
class Given(Protocol):
    """A recording on its way in."""

    @property
    def name(self) -> str: ...
    @property
    def time_s(self) -> npt.NDArray[np.float64]: ...
    @property
    def columns(self) -> list[tuple[str, npt.NDArray[np.float64]]]: ...
    @property
    def about(self) -> dict[str, str]: ...
    @property
    def notes(self) -> list[str]: ...
    @property
    def losses(self) -> list[str]: ...
    @property
    def unused(self) -> list[str]: ...

@type_check_only
class Asked(Protocol):
    @property
    def rig(self) -> str | None: ...
    @property
    def model(self) -> str: ...
    @property
    def with_effects(self) -> list[str]: ...
    @property
    def seed(self) -> int: ...
    @property
    def jobs(self) -> int | None: ...

__version__: str

def read(path: str | PathLike[str], columns: str | None) -> Table: ...
def decode(name: str, bytes: bytes, columns: str | None) -> Table: ...
def write(path: str | PathLike[str], recording: Given) -> None: ...
def known_columns() -> list[tuple[str, str, str]]: ...
def fit(
    recordings: Sequence[Given],
    asked: Asked,
    starts: int,
    free_friction: bool,
    progress: Callable[[str], object] | None,
) -> tuple[str, str]: ...
def diagnose(
    recordings: Sequence[Given], asked: Asked, progress: Callable[[str], object] | None
) -> tuple[str, str, str]: ...
def simulate(
    rig: str | PathLike[str],
    scenario: str | PathLike[str],
    text: str | None,
    seed: int | None,
    noise: float | None,
) -> Table: ...
def soak(
    scenarios: Sequence[str | PathLike[str]],
    rigs: Sequence[str | PathLike[str]],
    controllers: Sequence[str] | None,
    seeds: int | None,
    seed: int,
    jobs: int,
    adopt: bool,
) -> tuple[str, str]: ...

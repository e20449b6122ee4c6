"""Recordings: columns over time, from files and data frames and back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _kort

if TYPE_CHECKING:
    import pandas
    import polars

Array = npt.NDArray[np.float64]
"""One 64-bit float a row; NaN means "not sampled then"."""


_SHOWN = 12
"""Columns that a summary names."""


class Gap(NamedTuple):
    """A stretch without rows."""

    from_s: float
    """Last instant before it, s."""
    to_s: float
    """First instant after it, s."""


class Column(NamedTuple):
    """A column that kort knows."""

    name: str
    """Name in files, reports and the API; the unit is its end."""
    unit: str
    """Unit for display."""
    meaning: str
    """Meaning and sign."""


def known_columns() -> list[Column]:
    """Every column that kort knows, with unit, meaning and sign."""
    return [Column(*one) for one in _kort.known_columns()]


@dataclass(repr=False)
class Recording:
    """Rows at strictly increasing instants, columns in SI units."""

    name: str
    """The file it came from, or a name."""
    time_s: Array
    """Log instants, s, strictly increasing, at least two."""
    columns: dict[str, Array]
    """The other columns by name, unit last, in the file's order."""
    about: dict[str, str] = field(default_factory=dict)
    """What a live recording says of itself; ``about["rig"]`` is its rig description."""
    notes: list[str] = field(default_factory=list)
    """What a user should know."""
    losses: list[str] = field(default_factory=list)
    """What was lost or skipped while reading."""
    unused: list[str] = field(default_factory=list)
    """Source columns that the column map does not take over."""
    gaps: list[Gap] = field(default_factory=list)
    """Stretches without rows, as found when it was read."""

    def __repr__(self) -> str:
        """A few lines: how much there is, of what, and what a user should know."""
        rows = len(self)
        span = f", {self.time_s[0]:.6g} to {self.time_s[-1]:.6g} s" if rows else ""
        out = [f"Recording {self.name!r}: {rows} rows{span}"]
        seen = {name: int(np.count_nonzero(~np.isnan(values))) for name, values in self.columns.items()}
        named = [name if n == rows else f"{name} ({n} samples)" for name, n in seen.items()]
        more = len(named) - _SHOWN
        out.append(f"  columns: {', '.join(named[:_SHOWN]) or 'none'}{f' and {more} more' if more > 0 else ''}")
        if self.about:
            out.append(f"  about: {', '.join(self.about)}")
        told: dict[str, list[Gap] | list[str]] = {"gaps": self.gaps, "notes": self.notes, "losses": self.losses}
        told["unused"] = self.unused
        counts = [f"{len(what)} in .{name}" for name, what in told.items() if what]
        if counts:
            out.append(f"  besides: {', '.join(counts)}")
        return "\n".join(out)

    def __len__(self) -> int:
        """Rows."""
        return len(self.time_s)

    def __getitem__(self, name: str) -> Array:
        """A column by name, ``time_s`` included."""
        return self.time_s if name == "time_s" else self.columns[name]

    @property
    def duration_s(self) -> float:
        """From the first to the last instant, s."""
        return float(self.time_s[-1] - self.time_s[0])

    def write(self, path: str | PathLike[str]) -> None:
        """Writes ``.csv``, ``.csv.gz``, ``.mcap`` or ``.parquet``, by the path's ending. Raises ``ValueError`` for another ending or
        columns that are no recording, ``RuntimeError`` if the file cannot be written."""
        _kort.write(path, _Given(self))

    def to_pandas(self) -> pandas.DataFrame:
        """A data frame indexed by ``time_s``, on the same memory where pandas allows it."""
        import pandas

        frame = pandas.DataFrame(self.columns, index=pandas.Index(self.time_s, name="time_s", copy=False), copy=False)
        frame.attrs["name"] = self.name
        return frame

    @classmethod
    def from_pandas(cls, frame: pandas.DataFrame, name: str = "data frame") -> Recording:
        """A recording from a data frame with the time, s, in a column or index ``time_s``. Every other column must hold
        numbers; ``Timedelta`` is taken as seconds in the time alone. The memory is shared where it is float64 already.

        Raises ``ValueError``, naming the column."""
        time = frame["time_s"] if "time_s" in frame.columns else frame.index
        if time is frame.index and time.name != "time_s" and time.dtype.kind != "m":
            raise ValueError(f"{name}: no column or index time_s\nhint: name the column with the seconds time_s")
        seconds = time.to_numpy()
        if seconds.dtype.kind == "m":
            seconds = seconds / np.timedelta64(1, "s")
        columns = {str(c): frame[c].to_numpy() for c in frame.columns if c != "time_s"}
        return cls.of(name, seconds, columns)

    def to_polars(self) -> polars.DataFrame:
        """A data frame with ``time_s`` first. The memory is shared, but for columns with NaN, which become null."""
        import polars

        whole = {"time_s": self.time_s, **self.columns}
        series = [
            polars.Series(name, values, nan_to_null=bool(np.isnan(values).any())) for name, values in whole.items()
        ]
        return polars.DataFrame(series)

    @classmethod
    def from_polars(cls, frame: polars.DataFrame, name: str = "data frame") -> Recording:
        """A recording from a data frame with a column ``time_s``, s; null means "not sampled then".

        Raises ``ValueError``, naming the column."""
        if "time_s" not in frame.columns:
            raise ValueError(f"{name}: no column time_s\nhint: name the column with the seconds time_s")
        columns = {column.name: column.to_numpy() for column in frame.iter_columns()}
        return cls.of(name, columns.pop("time_s"), columns)

    @classmethod
    def of(cls, name: str, time_s: npt.ArrayLike, columns: Mapping[str, npt.ArrayLike]) -> Recording:
        """A recording from anything numpy takes for numbers. Raises ``ValueError``, naming the column, also where the time
        does not increase from row to row."""
        return cls(name, _increasing(name, time_s), {c: _floats(name, c, v) for c, v in columns.items()})

    def cut(self, from_s: float, to_s: float) -> Recording:
        """The rows from ``from_s`` to before ``to_s``, s on the recording's own clock; a view, no copy."""
        rows = slice(*np.searchsorted(self.time_s, [from_s, to_s]))
        return Recording(
            self.name,
            self.time_s[rows],
            {name: values[rows] for name, values in self.columns.items()},
            dict(self.about),
            list(self.notes),
            list(self.losses),
            list(self.unused),
            [gap for gap in self.gaps if gap.from_s >= from_s and gap.to_s < to_s],
        )

    def plot(self, *names: str) -> Any:
        """The columns over time, a panel a unit; a matplotlib figure."""
        from . import plots

        return plots.recording(self, names)

    def __iter__(self) -> Iterator[str]:
        """Names of the columns, ``time_s`` first."""
        yield "time_s"
        yield from self.columns


def _increasing(recording: str, time_s: npt.ArrayLike) -> Array:
    found = _floats(recording, "time_s", time_s)
    steps = np.diff(found)
    if not np.all(steps > 0.0):
        row = int(np.argmin(steps > 0.0))
        raise ValueError(
            f"{recording}: column time_s does not increase from row {row} to {row + 1}: {found[row]:g} to "
            f"{found[row + 1]:g}; allowed: strictly increasing\nhint: sort the rows by time, leave out those that stand twice, "
            "and take one run of a log whose clock begins anew"
        )
    return found


def _floats(recording: str, name: str, values: npt.ArrayLike) -> Array:
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as why:
        raise ValueError(f"{recording}: column {name} does not hold numbers: {why}\nhint: leave it out") from None
    if found.ndim != 1:
        raise ValueError(f"{recording}: column {name} has {found.ndim} dimensions\nhint: one value a row")
    return found


class _Given:
    """A recording as the native module takes it."""

    def __init__(self, recording: Recording) -> None:
        self.name = recording.name
        self.time_s = _floats(self.name, "time_s", recording.time_s)
        self.columns = [(name, _floats(self.name, name, v)) for name, v in recording.columns.items()]
        self.about, self.notes = recording.about, recording.notes
        self.losses, self.unused = recording.losses, recording.unused


def _taken(table: _kort.Table) -> Recording:
    """A recording on the memory that the native module read it into."""
    return Recording(
        table["name"],
        table["time_s"],
        table["columns"],
        table["about"],
        table["notes"],
        table["losses"],
        table["unused"],
        [Gap(*gap) for gap in table["gaps"]],
    )


def read(path: str | PathLike[str], columns: str | None = None) -> Recording:
    """Reads a recording: CSV, MCAP, or a foreign log through a column map.

    ``columns`` names a shipped map or a TOML file of one, as ``--columns`` of the program does. Raises ``ValueError``
    with file, place, value found and what is allowed."""
    return _taken(_kort.read(fspath(path), columns))


Source = Recording | str | PathLike[str]
"""A recording, or the path of one."""


def given(recordings: Source | list[Source], columns: str | None) -> list[_Given]:
    """Recordings as the native module takes them; paths are read with the column map."""
    several = recordings if isinstance(recordings, list) else [recordings]
    return [_Given(one if isinstance(one, Recording) else read(one, columns)) for one in several]

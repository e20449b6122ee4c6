"""Recordings between files, numpy, pandas and polars."""

import math
from pathlib import Path

import kort
import numpy as np
import pandas as pd
import polars as pl
import pytest

T = [0.0, 0.1, 0.2, 0.3]


def small() -> kort.Recording:
    return kort.Recording.of("small", T, {"current_a": [1.0, 2.0, math.nan, 4.0], "thrust_n": [0.0, 1.0, 4.0, 9.0]})


def test_a_recording_is_printed_in_a_few_lines() -> None:
    columns = {f"extra{k}_v": np.arange(500.0) for k in range(14)} | {"current_a": [math.nan] * 400 + [1.0] * 100}
    recording = kort.Recording.of("long", np.arange(500) * 0.01, columns)
    recording.about = {"rig": "[propeller]\n" * 100}
    recording.notes = ["said at length " * 30]
    told = str(recording)
    assert told == repr(recording)
    assert len(told.splitlines()) == 4 and len(told) < 400, told
    assert "500 rows, 0 to 4.99 s" in told and "and 3 more" in told and "1 in .notes" in told, told
    assert "current_a (3 samples)" in str(small())


@pytest.mark.parametrize("time_s", [[0.0, 0.2, 0.1, 0.3], [0.0, 0.1, 0.1, 0.2], [0.0, math.nan, 0.2, 0.3]])
def test_time_that_does_not_increase_is_refused(time_s: list[float]) -> None:
    frame = pd.DataFrame({"time_s": time_s, "thrust_n": T})
    with pytest.raises(ValueError, match=r"time_s does not increase from row . to .*\nhint: sort"):
        kort.Recording.from_pandas(frame, "bench")
    with pytest.raises(ValueError, match="bench: column time_s"):
        kort.Recording.from_polars(pl.from_pandas(frame).with_columns(pl.col("time_s").fill_null(math.nan)), "bench")


def same(a: kort.Recording, b: kort.Recording) -> None:
    assert list(a) == list(b)
    for name in a:
        np.testing.assert_array_equal(a[name], b[name], name)


@pytest.mark.parametrize("ending", ["csv", "csv.gz", "mcap"])
def test_a_recording_comes_back_from_its_file(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"run.{ending}"
    small().write(path)
    same(kort.read(path), small())


def test_pandas_takes_the_memory_and_gives_it_back(cases: Path) -> None:
    recording = kort.read(cases / "clean.csv.gz")
    frame = recording.to_pandas()
    assert frame.index.name == "time_s" and len(frame) == len(recording)
    back = kort.Recording.from_pandas(frame, recording.name)
    same(back, recording)
    for name in recording:
        assert np.shares_memory(back[name], recording[name]), f"{name} is copied"


def test_numpy_arrays_lie_where_the_reader_put_them(cases: Path) -> None:
    values = kort.read(cases / "clean.csv.gz")["current_a"]
    assert values.dtype == np.float64 and values.flags.writeable and values.base is not None


def test_pandas_with_time_as_an_index_of_durations() -> None:
    frame = pd.DataFrame({"thrust_n": [0.0, 1.0]}, index=pd.to_timedelta([0, 250], unit="ms"))
    assert kort.Recording.from_pandas(frame).time_s.tolist() == [0.0, 0.25]


def test_polars_shares_memory_and_has_null_where_nothing_was_sampled() -> None:
    frame = small().to_polars()
    assert frame.columns == ["time_s", "current_a", "thrust_n"]
    assert frame["current_a"].null_count() == 1 and frame["thrust_n"].null_count() == 0
    back = kort.Recording.from_polars(frame)
    same(back, small())
    assert np.shares_memory(back["thrust_n"], frame["thrust_n"].to_numpy(allow_copy=False))


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"thrust": [0.0] * 4}, "thrust_n"),
        ({"thrust_n": [0.0] * 3}, "3 values, time_s has 4"),
        ({"thrust_n": [0.0, 1.0, math.inf, 0.0]}, "row 2 is inf"),
    ],
)
def test_what_is_no_recording_is_refused_with_its_column(tmp_path: Path, columns: dict[str, list[float]], words: str) -> None:
    with pytest.raises(ValueError, match="hint:") as refused:
        kort.Recording.of("bad", T, columns).write(tmp_path / "bad.csv")
    assert words in str(refused.value) and "bad" in str(refused.value)


def test_time_that_runs_back_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="does not increase from row 1"):
        kort.Recording.of("bad", [0.0, 0.2, 0.1], {"thrust_n": [0.0, 0.0, 0.0]}).write(tmp_path / "bad.csv")


def test_text_and_frames_without_time_are_refused() -> None:
    with pytest.raises(ValueError, match="column note does not hold numbers"):
        kort.Recording.from_polars(pl.DataFrame({"time_s": [0.0, 1.0], "note": ["a", "b"]}))
    with pytest.raises(ValueError, match="time_s"):
        kort.Recording.from_pandas(pd.DataFrame({"thrust_n": [0.0, 1.0]}))


def test_parquet_opens_elsewhere_with_null_where_nothing_was_sampled(tmp_path: Path) -> None:
    small().write(tmp_path / "small.parquet")
    frame = pl.read_parquet(tmp_path / "small.parquet")
    assert frame.equals(small().to_polars())
    same(kort.Recording.from_polars(frame), small())


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nowhere.csv"):
        kort.read(tmp_path / "nowhere.csv")


def test_a_cut_holds_the_rows_between() -> None:
    cut = small().cut(0.1, 0.3)
    assert cut.time_s.tolist() == [0.1, 0.2] and cut["thrust_n"].tolist() == [1.0, 4.0]


def test_known_columns_have_units() -> None:
    units = {column.name: column.unit for column in kort.known_columns()}
    assert units["thrust_n"] == "N" and units["time_s"] == "s"

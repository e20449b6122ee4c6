"""Reports: the program's own, and all of it."""

import dataclasses
import json
import subprocess
from pathlib import Path
from typing import Any

import kort
import numpy as np
import pytest


def plain(value: Any) -> Any:
    """A dataclass as the JSON that it mirrors, without what the package adds."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [f.name for f in dataclasses.fields(value) if f.name not in ("document", "rig_toml", "html")]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    return [plain(one) for one in value] if isinstance(value, (list, tuple)) else value


def mirrors(report: Any, document: dict[str, Any]) -> None:
    """Every key of the document is a field of the same value; a field without a key is none."""

    def held(of: Any, by: Any, at: str) -> None:
        if isinstance(by, dict) and isinstance(of, dict):
            for key in by:
                assert key in of, f"{at}.{key} has no field"
                held(of[key], by[key], f"{at}.{key}")
            for key in of.keys() - by.keys():
                assert of[key] is None, f"{at}.{key} is not in the document"
        elif isinstance(by, list):
            assert len(of) == len(by), at
            for i, (a, b) in enumerate(zip(of, by)):
                held(a, b, f"{at}[{i}]")
        else:
            assert of == by, at

    held(plain(report), document, report.schema)


def run(program: str, *arguments: str) -> Any:
    done = subprocess.run([program, *arguments, "--json"], capture_output=True, check=True)
    return json.loads(done.stdout)


def test_fit_says_what_the_program_says(cases: Path, kort_program: str) -> None:
    recording, rig = cases / "clean.csv.gz", cases / "clean.rig.toml"
    steps: list[str] = []
    report = kort.fit(recording, rig, starts=1, progress=steps.append)
    mirrors(report, report.document)
    assert report.document == run(kort_program, "fit", str(recording), "--rig", str(rig), "--starts", "1")
    assert steps, "no progress was told"
    assert report["lift_max"].std_error and "lift_max" in report.rig_toml
    assert report.plot().axes


def test_diagnose_names_what_was_hidden(cases: Path, tmp_path: Path) -> None:
    recording = kort.read(cases / "coulomb-friction.csv.gz").cut(0.0, 15.0)
    report = kort.diagnose(recording, cases / "coulomb-friction.rig.toml")
    mirrors(report, report.document)
    assert report.verdict == "explained" and report.findings[0].effect == "coulomb_friction"
    assert 'effect = "coulomb_friction"' in report.rig_toml
    report.write_html(tmp_path / "report.html")
    assert "coulomb" in (tmp_path / "report.html").read_text()
    assert len(report.plot().axes) == 2
    known = kort.diagnose(recording, cases / "coulomb-friction.rig.toml", with_effects=["coulomb_friction"])
    mirrors(known, known.document)
    assert [effect.effect for effect in known.baseline.effects or []] == ["coulomb_friction"]
    assert known.verdict == "no_mismatch"


def test_simulate_gives_the_rows_that_the_program_writes(tmp_path: Path, kort_program: str) -> None:
    rig, scenario = "whitcomb-yoerger-1999", "torque-step-9.2"
    ours = kort.simulate(rig, scenario, seed=3)
    run(kort_program, "simulate", "--rig", rig, "--scenario", scenario, "--seed", "3", "-o", str(tmp_path / "run.csv"))
    theirs = kort.read(tmp_path / "run.csv")
    assert list(ours) == list(theirs)
    for name in ours:
        np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-6, atol=1e-9, err_msg=name)
    assert ours.plot("thrust_n").axes


def test_soak_compares_laws() -> None:
    report = kort.soak("soak-towed", controllers=["velocity_servo", "static_map"], seeds=1)
    mirrors(report, report.document)
    laws = {law.name: law for law in report.scenarios[0].laws}
    assert laws.keys() == {"velocity_servo", "static_map"}
    error = laws["velocity_servo"].scores["thrust_rms_n"]
    assert error is not None and error.mean > 0.0
    assert report.html.startswith("<!DOCTYPE html>") and report.plot().axes


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda c: kort.fit(c / "clean.csv.gz", "no-such-rig"), "no such rig description"),
        (lambda c: kort.fit(c / "clean.csv.gz"), "holds no rig description"),
        (lambda c: kort.fit(c / "clean.csv.gz", c / "clean.rig.toml", model="model9"), "model9"),
        (lambda c: kort.diagnose(c / "clean.csv.gz", c / "clean.rig.toml", with_effects=["colomb"]), "coulomb_friction"),
        (lambda _: kort.simulate("whitcomb-yoerger-1999", {"name": "x"}), "hint:"),
        (lambda _: kort.soak("soak-towd"), "soak-towed"),
    ],
)
def test_what_cannot_be_used_is_said(cases: Path, call: Any, words: str) -> None:
    with pytest.raises(ValueError) as refused:
        call(cases)
    assert words in str(refused.value)

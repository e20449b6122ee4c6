#!/usr/bin/env python3
"""The same two recordings to kort and to PySINDy: a thruster as its rig says, and the same with dry friction hidden in it.

    pip install pysindy pandas
    python benches/beside_pysindy.py [KORT]

PySINDy is given what favours it: the right state (shaft speed), the measured current and flow as inputs, a library that holds
the blades' terms and dry friction, and the threshold that does best on the second half of the recording.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pysindy as ps

KORT = sys.argv[1] if len(sys.argv) > 1 else "kort"
RIG = "whitcomb-yoerger-1999"
TORQUE_CONSTANT_NM_A = 1.23  # of the rig
HIDDEN = {"coulomb_torque_n_m": 0.3, "stribeck_rise": 0.0, "stribeck_speed_rad_s": 2.0}
TERMS = {
    "1": lambda w, i, u: np.ones_like(w),
    "current": lambda w, i, u: i,
    "speed": lambda w, i, u: w,
    "speed |speed|": lambda w, i, u: w * np.abs(w),
    "flow": lambda w, i, u: u,
    "speed |flow|": lambda w, i, u: w * np.abs(u),
    "|speed| flow": lambda w, i, u: np.abs(w) * u,
    "flow |flow|": lambda w, i, u: u * np.abs(u),
    "sign(speed)": lambda w, i, u: np.tanh(w / 0.2),
}


def scenario(folder: Path, name: str, effects: str) -> Path:
    shipped = Path(__file__).resolve().parent.parent / "config/scenarios/identification-random-levels.toml"
    path = folder / f"{name}.toml"
    path.write_text(shipped.read_text() + effects)
    return path


def by_kort(recording: Path) -> str:
    done = subprocess.run([KORT, "diagnose", str(recording), "--rig", RIG, "--json"], capture_output=True, text=True)
    report = json.loads(done.stdout)
    found = [
        f"{one['effect']} (probability {one['probability']:.2f}, "
        + ", ".join(f"{p['name']} = {p['value']:.3f} ± {p['std_error']:.3f}" for p in one["parameters"])
        + ")"
        for one in report["findings"]
    ]
    return f"{report['verdict']}; {'; '.join(found) or 'nothing'}"


def by_pysindy(recording: Path) -> str:
    table = pd.read_csv(recording)
    t = table["time_s"].to_numpy()
    w = table["shaft_speed_rad_s"].interpolate().bfill().to_numpy()
    i = table["current_a"].interpolate().bfill().to_numpy()
    u = table["flow_m_s"].interpolate().bfill().to_numpy()
    rate = ps.SmoothedFiniteDifference()._differentiate(w[:, None], t)[:, 0]
    columns = np.stack([term(w, i, u) for term in TERMS.values()], axis=1)
    half = len(t) // 2
    best = None
    for threshold in np.geomspace(1e-3, 0.5, 40):
        scale = columns[:half].std(axis=0) + (columns[:half].std(axis=0) == 0)
        fit = ps.STLSQ(threshold=threshold * rate[:half].std(), alpha=1e-6).fit(columns[:half] / scale, rate[:half])
        size = fit.coef_[0] / scale
        left = np.sqrt(np.mean((rate[half:] - columns[half:] @ size) ** 2)) / rate[half:].std()
        if best is None or left < best[0]:
            best = (left, threshold, size)
    left, threshold, size = best
    kept = [f"{value:+.3g} {name}" for name, value in zip(TERMS, size) if value != 0]
    friction = -size[list(TERMS).index("sign(speed)")] / size[list(TERMS).index("current")] * TORQUE_CONSTANT_NM_A
    return f"{len(kept)} of {len(TERMS)} terms ({', '.join(kept)}); dry friction {friction:.3f} N m; {100 * left:.0f} % of the speed's rate left on the second half"


with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    hidden = "\n[[effects]]\neffect = \"coulomb_friction\"\nparameters = " + "{ " + ", ".join(f"{k} = {v}" for k, v in HIDDEN.items()) + " }\n"
    for title, effects in (("nothing hidden", ""), ("dry friction of 0.300 N m hidden", hidden)):
        recording = folder / f"{title.split()[0]}.csv"
        subprocess.run([KORT, "simulate", "--rig", RIG, "--scenario", str(scenario(folder, recording.stem, effects)), "-o", str(recording)], check=True, capture_output=True)
        print(f"{title}\n  kort    {by_kort(recording)}\n  PySINDy {by_pysindy(recording)}")

#!/usr/bin/env python3
"""The same tasks with MSS (Fossen's Marine Systems Simulator) in Octave and with kort: a propeller's curve, a step of thrust, a recording.

    apt-get install octave
    git clone https://github.com/cybergalactic/MSS    # MIT; its m-files alone are called, from a path; commit 736a3d1 was
    pip install numpy pandas
    python benches/beside_mss.py MSS [KORT]

MSS is given what favours it: the propeller is the one that its model of the REMUS 100 states, the curve is its own B-series table, a shaft
that follows its command is borrowed from its model of the NPS AUV (that of the REMUS has none), and its two forms of thrust are fitted with
the measured shaft speed and flow as inputs, where kort's fit is told the current that was commanded.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

if len(sys.argv) < 2:
    sys.exit(__doc__)
MSS = sys.argv[1]
KORT = sys.argv[2] if len(sys.argv) > 2 else "kort"
HERE = Path(__file__).resolve().parent
STAND = "whitcomb-yoerger-1999"
HIDDEN = '\n[[effects]]\neffect = "coulomb_friction"\nparameters = { coulomb_torque_n_m = 0.3, stribeck_rise = 0.0, stribeck_speed_rad_s = 2.0 }\n'

# The propeller of remus100.m, and how fast it turns there. Lift and drag begin as a shipped rig of that pitch has them (speed-drive).
DIAMETER_M, DENSITY_KG_M3, SPEED_RAD_S, WAKE = 0.14, 1026.0, 1525 / 60 * 2 * np.pi, 0.944
TURNS_S = SPEED_RAD_S / (2 * np.pi)
THRUST_N, TORQUE_N_M = (DENSITY_KG_M3 * TURNS_S**2 * DIAMETER_M**power for power in (4, 5))  # of a coefficient of one
RIG = f"""
[rig]
name = "remus-propeller"
[propeller]
radius_m = {DIAMETER_M / 2}
duct_length_m = {DIAMETER_M / 2}
pitch_rad = {{ value = {np.arctan(1 / (0.7 * np.pi)):.4f}, tol = 0.5 }}
lift_max = {{ value = 0.6, tol = 1.0 }}
drag_max = {{ value = 0.4, tol = 1.0 }}
[flow]
density_kg_m3 = {DENSITY_KG_M3}
flux_coefficient = {{ value = 2.0, tol = 1.0 }}
added_mass_coefficient = 1.5
[motor]
inertia_kg_m2 = 0.001
torque_constant_nm_a = 0.1
[amplifier]
kind = "speed"
time_constant_s = 0.1
supply_v = 24.0
[sensors]
torque = "propeller-side transducer"
ambient_flow = "recorded"
"""
COLUMNS = {"speed_cmd_rad_s": "rad/s", "shaft_speed_rad_s": "rad/s", "thrust_n": "N", "torque_n_m": "N m", "ambient_m_s": "m/s"}
MAP = 'description = "settled points"\n[time]\nsettle_s = 1.0\n' + "".join(
    f'[columns.{name}]\nsource = "{name}"\nunit = "{unit}"\n' for name, unit in COLUMNS.items()
)


def kort(*words: str) -> tuple[str, float]:
    """What it prints, and how long it took."""
    start_s = time.perf_counter()
    done = subprocess.run([KORT, *words], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        sys.exit(f"kort {' '.join(words)}: {done.stderr}")
    return done.stdout, time.perf_counter() - start_s


def simulate(folder: Path, name: str, rig: str, scenario: str) -> tuple[pd.DataFrame, float]:
    (folder / f"{name}.toml").write_text(scenario)
    recording = folder / f"{name}.csv"
    took_s = kort("simulate", "--rig", rig, "--scenario", str(folder / f"{name}.toml"), "-o", str(recording))[1]
    return pd.read_csv(recording), took_s


def at_speed(ambient: list, duration_s: float) -> str:
    points = json.dumps([[float(t), float(v)] for t, v in ambient])
    return (
        f'name = "towed"\nwhat = "towed"\ncommand = "speed_cmd_rad_s"\nnoise = 0.0\nambient = [{{ kind = "points", points = {points} }}]\n'
        f'[[segments]]\nkind = "hold"\nvalue = {SPEED_RAD_S}\nduration_s = {duration_s}\n'
    )


def rms(of: np.ndarray) -> float:
    return float(np.sqrt(np.mean(of**2)))


def course(thrust_n: np.ndarray, t_s: np.ndarray) -> str:
    peak = int(np.argmax(thrust_n))
    rise_s = t_s[np.argmax(thrust_n >= 0.9 * thrust_n[peak])] - t_s[np.argmax(thrust_n >= 0.1 * thrust_n[peak])]
    at = ", ".join(f"{thrust_n[np.searchsorted(t_s, s)]:.1f} N at {s:g} s" for s in (0.1, 1, 10))
    return f"10 to 90 % in {rise_s:.2f} s, largest {thrust_n[peak]:.1f} N at {t_s[peak]:.2f} s; {at}"


with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    stand = (HERE.parent / "config/scenarios/identification-random-levels.toml").read_text()
    recordings = {}
    for title, effects in (("nothing", ""), ("friction", HIDDEN)):
        recordings[title] = folder / f"{title}.csv"
        table, _ = simulate(folder, title, STAND, stand + effects)
        table.assign(flow_held_m_s=table["flow_m_s"].interpolate().bfill()).fillna(0).to_csv(folder / f"{title}-held.csv", index=False)

    mss = folder / "mss"
    mss.mkdir()
    for title in recordings:
        (folder / f"{title}-held.csv").rename(mss / f"{title}.csv")
    start_s = time.perf_counter()
    done = subprocess.run(["octave-cli", str(HERE / "beside_mss.m"), MSS, str(mss)], capture_output=True, text=True)
    if done.returncode != 0 or "identify_s" not in done.stdout:
        sys.exit(f"MSS: {done.stdout}{done.stderr}")
    octave_s = time.perf_counter() - start_s
    said = dict(line.split("\t") for line in done.stdout.splitlines() if "\t" in line)

    # 1. The curve: every second point to kort's fit, the others to judge it by.
    advance, thrust, torque = np.loadtxt(mss / "curve.csv", delimiter=",").T
    (folder / "rig.toml").write_text(RIG)
    (folder / "map.toml").write_text(MAP)
    ambient_m_s = advance * TURNS_S * DIAMETER_M
    taught = pd.DataFrame({"speed_cmd_rad_s": SPEED_RAD_S, "shaft_speed_rad_s": SPEED_RAD_S, "thrust_n": thrust * THRUST_N, "torque_n_m": torque * TORQUE_N_M, "ambient_m_s": ambient_m_s})[::2]
    taught.to_csv(folder / "taught.csv", index=False)
    fitted = str(folder / "fitted.toml")
    _, fit_s = kort("fit", str(folder / "taught.csv"), "--columns", str(folder / "map.toml"), "--rig", str(folder / "rig.toml"), "-o", fitted)
    print(f"propeller curve, B-series 3 blades, {len(advance)} points J 0 to {advance[-1]:.2f}")
    print(f"  MSS   KT {thrust[0]:.4f} to {thrust[-1]:.4f}, KQ {torque[0]:.4f} to {torque[-1]:.4f}; from blades, pitch and area alone; {said['curve_s']} s")
    for title, rig in (("unfitted", str(folder / "rig.toml")), ("fitted", fitted)):
        tow = [(2.0 * i + late, v) for i, v in enumerate(ambient_m_s) for late in (0.0, 1.9)]
        got, took_s = simulate(folder, f"tow-{title}", rig, at_speed(tow, 2.0 * len(advance)))
        settled = got.iloc[[np.searchsorted(got["time_s"], 2.0 * i + 1.8) for i in range(len(advance))]]
        errors = [settled[column].to_numpy() / one - curve for column, one, curve in (("thrust_n", THRUST_N, thrust), ("torque_n_m", TORQUE_N_M, torque))]
        shares = [100 * rms(error[1::2]) / curve[0] for error, curve in zip(errors, (thrust, torque))]
        print(f"  kort  {title}: held-out points off by {shares[0]:.1f} % (thrust) and {shares[1]:.1f} % (torque) of bollard, root mean square; {took_s + (fit_s if title == 'fitted' else 0):.2f} s")
        print(f"        at bollard {100 * errors[0][0] / thrust[0]:+.1f} % and {100 * errors[1][0] / torque[0]:+.1f} %")

    # 2. The step. MSS moves the vehicle too; kort is told the speed that MSS found.
    t_s, n_rpm, surge_m_s, thrust_n, torque_n_m = np.loadtxt(mss / "step.csv", delimiter=",").T
    print(f"step to 1525 rpm from rest, REMUS 100 from rest to {surge_m_s[-1]:.2f} m/s in {t_s[-1]:.0f} s")
    print(f"  MSS   {course(thrust_n, t_s)}; {said['step_s']} s")
    got, took_s = simulate(folder, "step", fitted, at_speed(list(zip(t_s[::5], WAKE * surge_m_s[::5])), t_s[-1]))
    print(f"  kort  {course(got['thrust_n'].to_numpy(), got['time_s'].to_numpy())}; {took_s:.2f} s")
    print(f"  torque at 10 s: MSS {torque_n_m[-1]:.2f} N m, kort {got['torque_n_m'].iloc[-1]:.2f} N m")
    print(f"  flow in the disc (kort): {got['flow_m_s'].iloc[10]:.2f} m/s at 0.1 s, {got['flow_m_s'].iloc[100]:.2f} m/s at 1 s; MSS has none")

    # 3. The recordings: what is left of the measured thrust in the half, or the rows, that were not fitted.
    for title, recording in recordings.items():
        print(f"recording of 65 s, {title} hidden: thrust left, share of the largest")
        for form in ("otter", "remus100"):
            print(f"  MSS   form of {form}: {said[f'{title} {form}']}")
        for extra in ([], ["--with", "coulomb_friction"]):
            text, took_s = kort("fit", str(recording), "--rig", STAND, "--json", *extra)
            thrust_left, speed_left = (json.loads(text)["channels"][channel]["nrmse_heldout"] for channel in ("thrust_n", "shaft_speed_rad_s"))
            print(f"  kort  fit {' '.join(extra)}: {100 * thrust_left:.2f} %, shaft speed {100 * speed_left:.2f} %; {took_s:.1f} s")
        text, took_s = kort("diagnose", str(recording), "--rig", STAND, "--json")
        report = json.loads(text)
        named = ", ".join(f"{one['effect']} {one['probability']:.2f}" for one in report["findings"]) or "nothing"
        print(f"  kort  diagnose: {report['verdict']}, {named}; {took_s:.1f} s")
    print(f"Octave in all {octave_s:.1f} s, of it identification {said['identify_s']} s")

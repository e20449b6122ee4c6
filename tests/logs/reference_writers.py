#!/usr/bin/env python3
"""Logs by the writers of their formats, of drives that follow a staircase of commands with a first-order lag.

    pip install python-can==4.6.1 moteus==1.1.1 && pip download --no-deps moteus-gui==1.1.1
    python tests/logs/reference_writers.py moteus_gui-1.1.1-py3-none-any.whl FOLDER

`two-drives.candump.log`: a VESC (number 5, 7 pole pairs) on can0 and a CiA 402 drive (node 1) on can1, written as Vector's
ASC by python-can and brought into candump's format by can-utils' own `asc2log`, which must be installed.
`moteus_1_servo_stats.csv`: what the logger of tview writes of a moteus' `servo_stats`. tview opens a window when it is
imported; its logger needs none and is taken out of its source.
"""

import ast
import collections
import csv
import enum
import json
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import can
from moteus.moteus import namedtuple_to_dict

LEVELS = [0.0, 0.2, 0.4, -0.3, 0.1]
BEGIN_S = 1_760_000_000.0


def candump(folder: Path) -> None:
    log = can.ASCWriter(str(folder / "two-drives.asc"))

    def send(time_s, identifier, data, channel):
        extended = identifier > 0x7FF
        log(can.Message(BEGIN_S + time_s, identifier, is_extended_id=extended, data=data, channel=channel))

    erpm = rpm = 0.0
    for k in range(1000):
        t, level = 0.01 * k, LEVELS[k // 200]
        erpm += (level * 21000 - erpm) * 0.01 / 0.15
        amps = level * 30 - erpm / 21000 * 25
        send(t, 0x905, struct.pack(">ihh", round(erpm), round(10 * amps), round(1000 * level)), 0)
        if k % 2 == 0:
            send(t + 0.0011, 0x301, struct.pack("<Hi", 0x0F, round(1500 * level)), 1)
            rpm += (level * 1500 - rpm) * 0.02 / 0.1
            send(t + 0.0019, 0x281, struct.pack("<Hi", 0x1637, round(rpm)), 1)
        if k % 100 == 0:
            send(t + 0.004, 0x701, b"\x05", 1)
    log.stop()
    subprocess.run(
        ["asc2log", "-I", folder / "two-drives.asc", "-O", folder / "two-drives.candump.log"],
        check=True,
    )


def logger(wheel: str):
    """tview's LoggingManager, without its windows."""
    source = zipfile.ZipFile(wheel).read("moteus_gui/tview.py")
    wanted = {"flatten_dict", "_flatten_list", "LoggingManager"}
    kept = [node for node in ast.parse(source).body if getattr(node, "name", None) in wanted]
    names = {"csv": csv, "json": json, "namedtuple_to_dict": namedtuple_to_dict}
    exec(compile(ast.Module(kept, []), "tview.py", "exec"), names)
    return names["LoggingManager"]()


def moteus(wheel: str, folder: Path) -> None:
    # As the firmware registers them (fw/bldc_servo_structs.h), those that a thruster has no use for left out.
    stats = collections.namedtuple(
        "servo_stats",
        "mode fault bus_V filt_bus_V fet_temp_C motor_temp_C d_A q_A position velocity torque_Nm power_W velocity_filt"
        " pid_position control_position control_velocity trajectory_done fw",
    )
    pid = collections.namedtuple("pid_position", "integral error")
    weakening = collections.namedtuple("fw", "id_A id_char")
    mode = enum.IntEnum("Mode", {"kStopped": 0, "kPosition": 10})
    log = logger(wheel)
    log.start_logging(str(folder / "moteus.csv"), format="csv")
    turns = speed = 0.0
    for k in range(500):
        level = LEVELS[k // 100]
        amps = 8 * level - 0.15 * (speed - 20 * level)
        speed += (20 * level - speed) * 0.02 / 0.2
        turns += 0.02 * speed
        now = stats(
            mode.kPosition, 0, 24.1, 24.0, 31.5, 30.0, 0.02, amps, turns, speed, 0.1 * amps, 2.4 * amps, speed,
            pid(0.0, 20 * level - speed), float("nan"), 20 * level if k >= 100 else None, False, weakening(0.0, 0.0),
        )
        log.log_data(1, BEGIN_S + 0.02 * k, "servo_stats", now, None)
    log.stop_logging()


if __name__ == "__main__":
    folder = Path(sys.argv[2])
    candump(folder)
    moteus(sys.argv[1], folder)

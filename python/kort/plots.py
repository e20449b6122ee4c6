"""Plots of recordings and reports, by matplotlib (the extra ``plot``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .recording import Recording, known_columns

if TYPE_CHECKING:
    from .diagnosis import Diagnosis
    from .fitting import Fit
    from .soaking import Soak


def _figure(panels: int, height: float, **more: Any) -> tuple[Any, list[Any]]:
    try:
        import matplotlib.pyplot as plt
    except ImportError as why:
        raise ImportError("plots need matplotlib\nhint: pip install './python[plot]' in a clone of kort") from why
    figure, axes = plt.subplots(
        panels, 1, figsize=(8, max(2.0, height * panels)), squeeze=False, layout="constrained", **more
    )
    return figure, list(axes[:, 0])


def recording(of: Recording, names: Sequence[str] = ()) -> Any:
    """Columns over time, a panel a unit; without names every column that has a sample."""
    units = {column.name: column.unit for column in known_columns()}
    wanted = list(names) or [name for name, values in of.columns.items() if not np.isnan(values).all()]
    panels: dict[str, list[str]] = {}
    for name in wanted:
        panels.setdefault(units.get(name, name), []).append(name)
    figure, axes = _figure(len(panels), 1.6, sharex=True)
    for ax, (unit, columns) in zip(axes, panels.items(), strict=True):
        for name in columns:
            sampled = ~np.isnan(of[name])
            ax.plot(of.time_s[sampled], of[name][sampled], label=name, linewidth=0.9)
        ax.set_ylabel(unit)
        ax.legend(loc="upper right", fontsize="small")
        for gap in of.gaps:
            ax.axvspan(gap.from_s, gap.to_s, color="0.9")
    axes[0].set_title(of.name)
    axes[-1].set_xlabel("time, s")
    return figure


def fit(of: Fit) -> Any:
    """Fitted over stated values with two standard errors; only what the rig states."""
    stated = [p for p in of.parameters if p.stated]
    figure, axes = _figure(1, 0.6 + 0.4 * len(stated))
    rows = range(len(stated))
    ratios = [p.value / p.stated for p in stated if p.stated]
    bars = [2.0 * (p.std_error or np.nan) / abs(p.stated) for p in stated if p.stated]
    axes[0].axvline(1.0, color="0.6", linewidth=0.9)
    axes[0].errorbar(ratios, rows, xerr=bars, fmt="o", capsize=3)
    axes[0].set_yticks(rows, [f"{p.name} = {p.value:.4g} {p.unit}" for p in stated])
    axes[0].set_xlabel("fitted over stated value, two standard errors")
    axes[0].set_title(f"{of.model} of {of.rig}")
    return figure


def diagnosis(of: Diagnosis) -> Any:
    """The odds of all effects above; held-out errors before and after the findings below."""
    figure, axes = _figure(2, 2.4)
    odds = [(f.effect, f.probability, "C0") for f in of.findings]
    odds += [(a.effect, a.probability, "0.7") for a in of.alternatives[:6]]
    axes[0].barh([o[0] for o in odds], [o[1] for o in odds], color=[o[2] for o in odds])
    axes[0].invert_yaxis()
    axes[0].set_xlim(0.0, 1.0)
    axes[0].set_xlabel("probability that it is present")
    axes[0].set_title(f"{of.verdict.replace('_', ' ')}: {of.rig}")
    channels = list(of.baseline.channels)
    at = np.arange(len(channels))
    axes[1].bar(at, [of.baseline.channels[c].nrmse_heldout or np.nan for c in channels], 0.25, label="model alone")
    for i, finding in enumerate(of.findings[:2]):
        after = [finding.heldout.channels[c].nrmse_after if c in finding.heldout.channels else None for c in channels]
        axes[1].bar(at + 0.25 * (i + 1), [np.nan if a is None else a for a in after], 0.25, label=finding.effect)
    floor = [of.baseline.channels[c].noise_floor or np.nan for c in channels]
    axes[1].plot(at, floor, "k_", markersize=24, label="noise floor")
    axes[1].set_xticks(at, channels, fontsize="small")
    axes[1].set_ylabel("held-out error / full scale")
    axes[1].legend(fontsize="small")
    return figure


def soak(of: Soak) -> Any:
    """Thrust error against energy, a panel a scenario; what nothing betters in both is filled."""
    figure, axes = _figure(len(of.scenarios), 3.0)
    for ax, scenario in zip(axes, of.scenarios, strict=True):
        for law in scenario.laws:
            error, energy = law.scores.get("thrust_rms_n"), law.scores.get("energy_j")
            if error is None or energy is None:
                continue
            ax.plot(energy.mean, error.mean, "o", fillstyle="full" if law.pareto else "none")
            ax.annotate(law.name, (energy.mean, error.mean), xytext=(5, 3), textcoords="offset points", fontsize="small")
        ax.set_title(f"{scenario.name} on {scenario.rig}")
        ax.set_xlabel("energy, J")
        ax.set_ylabel("thrust error, RMS, N")
    return figure

"""Writes the tables and plots of the study."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

from .border import Coupled
from .study import DAMPING, LAG, SETTINGS

NAMES = {
    "off": "no bound",
    "fast": "no bound, `reference_rate` 100 rad/s",
    "passivity": "`passivity = { strict = true }`",
    "limit": "`limits.energy`: 10 mJ, 20 mW",
}
INK, PALE, HOT = "#1f4e79", "#7f7f7f", "#c0392b"


def write(results: dict[str, Any], folder: Path) -> None:
    """Write `report.md`, `border.svg` and `beyond.svg`."""
    # Words stay words, and the same numbers give the same bytes.
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "hbot", "font.size": 9})
    (folder / "report.md").write_text(tables(results), encoding="utf-8")
    plot_border(results, folder / "border.svg")
    plot_beyond(results, folder / "beyond.svg")


def tables(results: dict[str, Any]) -> str:
    """Return the report."""
    lines = [
        "# Two coupled rigs: measurements",
        "",
        "[coupling.md](../coupling.md) explains them. This command writes this page:",
        "",
        "    python examples/couple.py --study docs/coupling",
        "",
        "Two simulated prototypes at 1 kHz. Each sphere is free, has an inertia of",
        f"{1e3 * results['inertia']:.3f}e-3 kg m², and is damped with {DAMPING} N m s/rad.",
        f"The program ran {results['priority']}. The machine's load was up to",
        f"{results['load']:.0f}.",
        "",
        "## The border",
        "",
        *border_rows(results["border"]),
        "",
        "With the simulated hand on each sphere, which keeps still:",
        "",
        *border_rows(results["grip"]),
        "",
        "Of all trials, the growth rate differs from theory by "
        f"{growth_error(results):.3f} 1/s in the median.",
        "",
        "## Inside and beyond the border",
        "",
        "| settings | delay, ms | stiffness / border | N m/rad | largest speed, rad/s"
        " | speed in the last half second, rad/s | energy given out, mJ | ended by |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in SETTINGS:
        for row in results["beyond"][name]:
            ended = row["ended"].rpartition(" ")[2] if row["ended"] else "-"
            lines.append(
                f"| {NAMES[name]} | {row['delay_ms']} | {row['part']} | {row['stiffness']:.2f} "
                f"| {row['speed']:.2f} | {row['last_speed']:.3f} | {1e3 * row['energy']:.2f} "
                f"| {ended} |"
            )
    return "\n".join(lines) + "\n"


def border_rows(found: list[dict[str, Any]]) -> list[str]:
    """Return a table of measured and derived borders."""
    lines = [
        "| added delay, ms | delay measured, ms | border derived, N m/rad"
        " | border measured, N m/rad | difference | swing derived, rad/s | swing measured, rad/s |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in found:
        at = [one for one in row["trials"] if one["growth"] is not None]
        stiffness = [one["stiffness"] for one in at]
        swing = np.interp(row["measured"], stiffness, [one["frequency"] for one in at])
        lines.append(
            f"| {row['delay_ms']} | {1e3 * row['delay']:.2f} | {row['predicted']:.3f} "
            f"| {row['measured']:.3f} | {100 * (row['measured'] / row['predicted'] - 1):+.1f} % "
            f"| {row['omega']:.1f} | {swing:.1f} |"
        )
    return lines


def growth_error(results: dict[str, Any]) -> float:
    """Return the median distance of a free trial's growth rate from that of the theory, 1/s."""
    errors = [
        abs(one["growth"] - theory(results, one["delay"]).growth(one["stiffness"]).real)
        for row in results["border"]
        for one in row["trials"]
        if one["growth"] is not None
    ]
    return float(np.median(errors))


def theory(results: dict[str, Any], delay: float) -> Coupled:
    """Return the theory of the free rigs of the study with a delay, s."""
    return Coupled(results["inertia"], DAMPING, delay, LAG)


def plot_border(results: dict[str, Any], path: Path) -> None:
    """Draw the border over the delay: derived, approximated and measured."""
    delays = np.linspace(0.0005, 0.06, 120)
    figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
    derived = [theory(results, float(delay)).border()[0] for delay in delays]
    axes.semilogy(1e3 * delays, derived, color=INK, label="derived")
    axes.semilogy(
        1e3 * delays, DAMPING / (delays + 2 * LAG), "--", color=PALE, label="b / (T + 2 lag)"
    )
    always = DAMPING**2 / (2 * results["inertia"])
    axes.axhline(always, ls=":", color=PALE, label="b² / (2 I): below it, any delay")
    axes.semilogy(
        [1e3 * row["delay"] for row in results["border"]],
        [row["measured"] for row in results["border"]],
        "o",
        color=HOT,
        label="measured",
    )
    axes.set(xlabel="delay T from tick to tick, ms", ylabel="stiffness k, N m/rad", xlim=(0, 60))
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def plot_beyond(results: dict[str, Any], path: Path) -> None:
    """Draw the speed over time at 1.5 times the border, with 20 ms of delay."""
    figure, rows = plt.subplots(
        len(SETTINGS), 1, figsize=(6.4, 6.0), sharex=True, layout="constrained"
    )
    for axes, name in zip(rows, SETTINGS, strict=True):
        log = next(np.array(row["log"]) for row in results["beyond"][name] if "log" in row)
        axes.plot(log[:, 0] - log[0, 0], log[:, 1], color=INK, lw=0.6)
        axes.set_title(NAMES[name].replace("`", ""), loc="left", fontsize=9)
        axes.spines[["top", "right"]].set_visible(False)
    rows[-1].set_xlabel("time since the coupling began, s")
    figure.supylabel("angular velocity of the first sphere about n3, rad/s", fontsize=9)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)

"""The section of the identification: its numbers in charts and tables."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from eval.page.figures import Marks, Series, lines, panel, traces
from eval.page.html import columns, figure, folded, table, text
from eval.papers.experiment import Result
from eval.papers.mistry2010.identification.judging import rms
from eval.papers.mistry2010.identification.measuring import Noise
from eval.papers.page import fate
from eval.papers.trial import RATES
from eval.wording import number
from fbid_gym.robots import load


def improvements(numbers: dict[str, Any], level: float, method: str = "identified") -> np.ndarray:
    """How many times the torque error falls: every model and motion at one noise."""
    rows = [row["error"] for row in numbers["rows"] if row["level"] == level]
    return np.array(
        [row["nominal"][name] / row[method][name] for row in rows for name in row[method]]
    )


def average(numbers: dict[str, Any], level: float, method: str) -> float:
    """RMS torque error over models and motions, N·m."""
    rows = [row["error"][method] for row in numbers["rows"] if row["level"] == level]
    return rms(np.array([list(row.values()) for row in rows]))


def show(result: Result) -> list[str]:
    """Draw the section."""
    numbers, arrays = result.numbers, result.arrays
    true = arrays["true model"]
    curves = [
        ("nominal", 1, arrays["nominal model"] - true),
        ("identified", 0, arrays["identified model"] - true),
    ]
    charts = [
        traces(arrays["time"], curves, "Left knee, torque error, N·m"),
        noise_chart(numbers),
        spectrum(numbers),
    ]
    noisiest = numbers["levels"][-1]
    masses = [row["mass"] for row in numbers["rows"] if row["level"] == noisiest]
    return [
        figure(
            charts,
            "Left: error of eq. (15) on the fast squat/bow, of one nominal model and of what "
            "noisy data (level 1) made of it. Middle: what sensor noise leaves of the gain, "
            "all models and motions. Right: what unit steps of the parameters do to the data, "
            "in the order of their effect; what is below 0.00001 of the torque counts as not "
            "told.",
            3,
        ),
        text(
            "Nominal masses are off by up to 30 %, and with them the inertias; the "
            "centres of mass by up to 30 % of the link's half-length along every axis. "
            "The robot moves under the wrong model: sums of sinusoids at all joints, "
            f"{number(numbers['seconds'], 2)} s each on both feet, on the left and on the "
            "right one. No contact force is measured. Accelerations are derivatives of the "
            "noisy velocities through the same filter that the torques pass."
        ),
        sweep_table(numbers),
        text(
            "Noise of the measured motion does not average out as noise of the torque does: "
            "it is in the regressor, and biases the estimate however much data there are. At "
            f"{number(noisiest)} times the noise of the table below, the total mass comes out "
            f"as {number(float(np.mean(masses)))} kg instead of "
            f"{number(load('biped').mass)} kg, and little of the gain is left. Least squares "
            "without regard for what can exist predicts torques about as well without noise "
            "and somewhat worse with it, by bodies that no simulator takes."
        ),
        excitation_table(numbers["told"]),
        text(
            "Feet that stand flat take whatever wrench the ground gives, so nothing tells "
            "their own parameters; a foot in the air tells them. Single parameters that only "
            "count in combinations, as the masses of neighbouring links, stay near their "
            "nominal values, and the torque does not depend on how they share."
        ),
        tracking_table(numbers["tracking"]),
        folded("Sensor noise at level 1", noise_table()),
        folded("Masses and centres of mass of one model", body_table(result)),
    ]


def noise_chart(numbers: dict[str, Any]) -> Markup:
    """Torque error against noise."""
    curves = [
        (name, colour, [average(numbers, x, method) for x in numbers["levels"]])
        for method, name, colour in (
            ("nominal", "nominal", 1),
            ("plain", "least squares", 5),
            ("identified", "identified", 0),
        )
    ]
    marks = Marks(logarithmic=True)
    return lines(numbers["levels"], curves, "Torque error, N·m", "sensor noise", marks=marks)


def spectrum(numbers: dict[str, Any]) -> Markup:
    """Singular values of the projected regressor, by stance."""
    series = []
    for colour, row in zip((1, 2, 3, 0), numbers["told"], strict=True):
        values = [value for value in row["singular_values"] if value > 1e-8]
        series.append(Series(row["stance"], colour, range(1, len(values) + 1), values))
    title, below = "Share of the torque", "direction of the parameters"
    return panel(series, title, below, y_format="{:.0e}".format, marks=Marks(logarithmic=True))


def sweep_table(numbers: dict[str, Any]) -> str:
    """The sweep over sensor noise."""

    def times_less(level: float) -> str:
        every = improvements(numbers, level)
        return f"{number(every.min(), 2)} to {number(every.max(), 2)}"

    def mean(level: float, what: str) -> float:
        return float(np.mean([row[what] for row in numbers["rows"] if row["level"] == level]))

    def error(method: str) -> Callable[[float], str]:
        return lambda level: number(average(numbers, level, method), 2)

    cells = (
        ("noise", number),
        ("nominal, N·m", error("nominal")),
        ("identified", error("identified")),
        ("total mass known", error("weighed")),
        ("least squares", error("plain")),
        ("times less", times_less),
        ("impossible bodies by least squares", lambda x: f"{mean(x, 'impossible'):.1f}"),
        ("residual", lambda x: number(mean(x, "residual"), 2)),
    )
    return columns(numbers["levels"], cells)


def excitation_table(told: Sequence[dict[str, Any]]) -> str:
    """What the data tell, by stance."""
    cells = (
        ("data", lambda row: row["stance"]),
        ("base parameters", lambda row: f"{row['dimension']} of {row['attainable']}"),
        ("condition", lambda row: number(row["condition"], 2)),
        ("told by themselves", lambda row: str(len(row["told"]))),
        ("in combinations", lambda row: str(len(row["combined"]))),
        ("not told", lambda row: str(len(row["untold"]))),
        ("which", lambda row: ", ".join(_grouped(row["untold"])) or "–"),
    )
    return columns(told, cells, wrap=True)


def _grouped(names: Sequence[str]) -> list[str]:
    """Names of parameters, all ten of a body as the body alone."""
    by_body: dict[str, list[str]] = {}
    for name in names:
        body, _, parameter = name.partition(" ")
        by_body.setdefault(body, []).append(parameter)
    return [
        body if len(parameters) == 10 else f"{body} ({', '.join(parameters)})"
        for body, parameters in by_body.items()
    ]


def tracking_table(rows: Sequence[dict[str, Any]]) -> str:
    """Tracking of the 2 Hz squat by model."""
    cells = (
        ("2 Hz squat, PD+FF", lambda row: row["model"]),
        ("joint error, mrad RMS", lambda row: number(1e3 * row["error"], 2)),
        ("feedback, N·m RMS", lambda row: number(row["feedback"], 2)),
        ("", lambda row: fate(row["fell"])),
    )
    return columns(rows, cells)


def noise_table() -> str:
    """The sensors' noise at level 1."""
    noise = Noise()
    rows = [
        ["joint angle", f"{noise.joint:g} rad"],
        ["joint velocity", f"{noise.joint_rate:g} rad/s"],
        ["orientation of the base", f"{noise.tilt:g} rad"],
        ["angular velocity of the base", f"{noise.spin:g} rad/s"],
        ["linear velocity of the base", f"{noise.drift:g} m/s"],
        ["joint torque", f"{noise.torque:g} N·m"],
    ]
    return table(["sensor", f"white noise at {RATES.control} Hz, standard deviation"], rows)


def body_table(result: Result) -> str:
    """Masses and centres of mass: true, nominal, identified."""
    rows = []
    for name, *versions in zip(result.numbers["bodies"], *result.arrays["parameters"], strict=True):
        cells = []
        for version in versions:
            com = 100.0 * np.asarray(version[1:4]) / version[0]
            cells += [number(version[0]), ", ".join(f"{value:.1f}" for value in com)]
        rows.append([name.replace("_", " "), *cells])
    heads = ["body"]
    for version in ("true", "nominal", "identified"):
        heads += [f"{version}, kg", "centre of mass, cm"]
    return table(heads, rows)

"""The section of the identification: its numbers in charts and tables."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from eval.papers.charts import lines, traces
from eval.papers.experiment import Result
from eval.papers.mistry2010.identification.judging import METHODS, rms
from eval.papers.mistry2010.identification.measuring import Noise
from eval.papers.parts import fate, figure, folded, table, text
from eval.papers.trial import RATES
from eval.plots import Series, panel
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
            "Nominal masses are off by up to 30&nbsp;%, and with them the inertias; the "
            "centres of mass by up to 30&nbsp;% of the link's half-length along every axis. "
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


def noise_chart(numbers: dict[str, Any]) -> str:
    """Torque error, on a logarithmic axis, against noise."""
    curves = [
        (name, colour, [float(np.log10(average(numbers, x, method))) for x in numbers["levels"]])
        for method, name, colour in (
            ("nominal", "nominal", 1),
            ("plain", "least squares", 5),
            ("identified", "identified", 0),
        )
    ]
    return lines(numbers["levels"], curves, "Torque error, N·m", "sensor noise", y_format=_power)


def spectrum(numbers: dict[str, Any]) -> str:
    """Singular values of the projected regressor, by stance."""
    series = []
    for colour, row in zip((1, 2, 3, 0), numbers["told"], strict=True):
        values = np.array(row["singular_values"])
        values = np.log10(values[values > 1e-8])
        directions = list(range(1, len(values) + 1))
        series.append(Series(row["stance"], colour, directions, values.tolist()))
    return panel(series, "Share of the torque", "direction of the parameters", y_format=_power)


def _power(exponent: float) -> str:
    """Label of a logarithmic axis: whole powers of ten alone."""
    return f"{10.0 ** round(exponent):g}" if abs(exponent - round(exponent)) < 1e-9 else ""


def sweep_table(numbers: dict[str, Any]) -> str:
    """The sweep over sensor noise."""
    rows = []
    for level in numbers["levels"]:
        at = [row for row in numbers["rows"] if row["level"] == level]
        every = improvements(numbers, level)
        rows.append(
            [
                number(level),
                *(number(average(numbers, level, method), 2) for method in METHODS),
                f"{number(every.min(), 2)} to {number(every.max(), 2)}",
                f"{sum(row['impossible'] for row in at) / len(at):.1f}",
                number(float(np.mean([row["residual"] for row in at])), 2),
            ]
        )
    heads = [
        "noise", "nominal, N·m", "identified", "total mass known", "least squares",
        "times less", "impossible bodies by least squares", "residual",
    ]  # fmt: skip
    return table(heads, rows)


def excitation_table(told: Sequence[dict[str, Any]]) -> str:
    """What the data tell, by stance."""
    rows = [
        [
            row["stance"],
            f"{row['dimension']} of {row['attainable']}",
            number(row["condition"], 2),
            str(len(row["told"])),
            str(len(row["combined"])),
            str(len(row["untold"])),
            ", ".join(_grouped(row["untold"])) or "–",
        ]
        for row in told
    ]
    heads = [
        "data", "base parameters", "condition", "told by themselves", "in combinations",
        "not told", "which",
    ]  # fmt: skip
    return table(heads, rows, wrap=True)


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
    cells = [
        [
            row["model"],
            number(1e3 * row["error"], 2),
            number(row["feedback"], 2),
            fate(row["fell"]),
        ]
        for row in rows
    ]
    return table(["2 Hz squat, PD+FF", "joint error, mrad RMS", "feedback, N·m RMS", ""], cells)


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

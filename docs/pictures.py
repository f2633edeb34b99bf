"""Draws the pictures of the fan, `docs/fan_*.png`, from the scene of its tutorial.

`python docs/pictures.py` takes some three minutes.
"""

import re
import tempfile
from pathlib import Path

import numpy as np

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.plot import colours, page


DOCS = Path(__file__).parent
GAP = 0.3  # of the ring [mm]
RPM = 30 / np.pi


def fan() -> jr.Scene:
    """The fan of the tutorial, as its file has it."""
    text = (DOCS / "tutorials" / "fan.md").read_text("utf-8")
    found = re.search(r'```toml title="fan.toml"\n(.*?)```', text, re.S)
    if found is None:
        raise ValueError("docs/tutorials/fan.md has no block with the title fan.toml.")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fan.toml"
        path.write_text(found[1], "utf-8")
        return jr.load(path)


def save(ax, name: str) -> None:
    """Write the figure of some Axes."""
    ax.figure.savefig(DOCS / name, dpi=110)


def draw_linear(scene: jr.Scene) -> None:
    """Campbell diagram, and response to unbalance with the clearance of the ring."""
    diagram, critical = jr.campbell(scene, np.linspace(0.0, 630.0, 64)), jr.critical_speeds(scene)
    with plot.units(speed="rpm"):
        upper, _ = plot.campbell(diagram, critical=critical)
    save(upper, "fan_campbell.png")
    speeds = np.linspace(10.0, 630.0, 311)
    response = jr.unbalance_response(scene.without("limiters"), speeds, at=1.3)
    ax = page.single(None, 170, 80)
    ax.plot(speeds * RPM, 1e3 * np.asarray(response.major)[:, 0], color=colours.BLUE)
    for service in (1500, 3600):
        ax.axvline(service, color="0.6", linewidth=0.8)
    ax.axhline(GAP, color=colours.RED, linestyle="--", linewidth=0.8, label="clearance of the ring")
    ax.set(xlabel="speed [rpm]", ylabel="largest deflection [mm]", xlim=(0, 6000), ylim=(0, None))
    page.legend(ax, 1)
    save(ax, "fan_response.png")


def draw_run_up(scene: jr.Scene) -> None:
    """The run-up with and without the ring."""
    heavy = scene.replace({"unbalance.eccentricity": 2e-4, "shaft.nodes": 3})
    ramp = jr.SpeedProfile.ramp(150.0, 600.0, duration=4.0)
    rising = jr.Scene(heavy.shaft, *heavy.effects, spin=ramp)
    times = np.linspace(0.0, 4.0, 4001)
    steps = {"solver": jr.Exponential(2), "substeps": 16, "at": 1.3}
    ax = page.single(None, 170, 80)
    runs = {"without the ring": rising.without("limiters"), "in its ring": rising}
    for (name, one), colour in zip(runs.items(), ("0.75", colours.BLUE), strict=True):
        run = jr.run_up(one, times, **steps)
        wheel = 1e3 * np.abs(np.asarray(run.displacement)[:, 0])
        ax.plot(np.asarray(run.speed) * RPM, wheel, color=colour, linewidth=0.7, label=name)
    ax.axhline(GAP, color=colours.RED, linestyle="--", linewidth=0.8, label="clearance of the ring")
    ax.set(xlabel="speed [rpm]", ylabel="deflection of the wheel [mm]", ylim=(0, None))
    ax.margins(x=0)
    page.legend(ax, 3)
    save(ax, "fan_run_up.png")


if __name__ == "__main__":
    draw_linear(fan())
    draw_run_up(fan())

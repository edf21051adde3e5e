"""Draw blends.svg, solving the pattern again: python docs/explanation/make_blends.py.

Needs matplotlib, and a minute.
"""

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from planner.grading.dither import blue_noise_ranks
from planner.materials.mixtures import TwoPhases

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER.parents[1]))

from benchmarks.calibrate_dither import PER_CELL, extension_modulus, hard_share  # noqa: E402

CONTRASTS = {1.7: "FLX9740 and FLX9750", 3.9: "FLX9795 and RGD8430"}
DEALT = (0.1, 0.2, 0.3, 0.42, 0.5, 0.58, 0.7, 0.8, 0.9)


def main() -> None:
    """Draw one panel a contrast: modulus over the geometric mean of both materials."""
    ranks = blue_noise_ranks()
    shares = [hard_share(ranks < f * ranks.size, PER_CELL) for f in DEALT]
    mpl.rcParams |= {"svg.hashsalt": "blends", "font.size": 9}
    figure = Figure(figsize=(8.0, 3.8), layout="constrained")
    f = np.linspace(0.0, 1.0, 201)
    for axes, (contrast, title) in zip(figure.subplots(1, 2), CONTRASTS.items(), strict=True):
        rule = contrast**f
        phases = TwoPhases(1.0, contrast)
        low, high = phases.hashin_shtrikman_MPa(f)
        axes.fill_between(f, low / rule, high / rule, color="#cfe3f2", label="Hashin-Shtrikman")
        axes.plot(f, phases.voigt_MPa(f) / rule, "--", color="#888888", label="Voigt")
        axes.plot(f, phases.reuss_MPa(f) / rule, ":", color="#888888", label="Reuss")
        axes.plot(f, phases.dithered_MPa(f) / rule, color="#1f5f99", label="estimate")
        solved = [(s.mean(), extension_modulus(s, contrast) / contrast ** s.mean()) for s in shares]
        axes.plot(*np.array(solved).T, "o", ms=4, color="#c03a2b", label="pattern, solved")
        axes.set_title(f"{title}: contrast {contrast}", fontsize=9)
        axes.set_xlabel("volume fraction of the harder material")
        axes.set_ylabel("modulus / geometric mean")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=8)
    figure.savefig(FOLDER / "blends.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()

"""First loading of a specimen, and its load in proportion to what the palette predicts."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.quality.motion import first_turn
from planner.gap.specimen import Specimen
from planner.materials.laws import make_law
from planner.palette import Palette

__all__ = ["first_loading", "log_load", "predicted_stress_MPa", "stress_at"]


def first_loading(specimen: Specimen) -> tuple[FloatArray, FloatArray]:
    """Return strain and mean nominal stress of the first loading, to its turn or peak load."""
    stop = first_turn(specimen.displacement_mm) + 1
    stop = int(np.argmax(specimen.force_N[:stop])) + 1
    return specimen.strain[:stop], specimen.force_N[:stop] / _mean_section_mm2(specimen)


def stress_at(strain: FloatArray, stress_MPa: FloatArray, at: FloatArray) -> FloatArray:
    """Return the stress at rising strains `at`, each the mean of the points half-way around it.

    Where there are no such points, a line between the nearest ones has to do.
    """
    rising = np.maximum.accumulate(strain)
    edges = np.concatenate([[at[0]], 0.5 * (at[1:] + at[:-1]), [at[-1]]])
    edges[0] -= edges[1] - at[0]
    edges[-1] += at[-1] - edges[-2]
    bounds = np.searchsorted(rising, edges)
    sums = np.concatenate([[0.0], np.cumsum(stress_MPa)])
    places = np.concatenate([[0.0], np.cumsum(rising)])
    count = np.diff(bounds)
    some = np.maximum(count, 1)
    mean = np.diff(sums[bounds]) / some
    middle = np.diff(places[bounds]) / some
    line = np.interp(at, rising, stress_MPa)
    # Points of a bin lie about its middle, not at it; the load's proportion to strain corrects it.
    return np.where(count > 2, mean * at / np.where(middle > 0.0, middle, at), line)


def predicted_stress_MPa(specimen: Specimen, palette: Palette, strain: FloatArray) -> FloatArray:
    """Return the mean nominal stress that the palette's laws give, roughly for a graded bar.

    A bar's slices are taken as springs of their secant moduli at the mean strain.
    """
    grades = np.array([m.coordinate for m in palette.materials])
    secants = np.stack(
        [make_law(m.law).nominal_stress_MPa(1.0 + strain) / strain for m in palette.materials]
    )
    if specimen.profile is None:
        index = palette.materials.index(palette.resolve(specimen.material or ""))
        predicted: FloatArray = secants[index] * strain
        return predicted
    x = _slices(specimen)
    coordinate = specimen.profile.at(x)
    section = specimen.section_mm2(x)
    share = np.ones_like(x) if section is None else section / np.mean(section)
    logs = np.log(np.maximum(secants, 1e-12))
    along = np.stack([np.interp(coordinate, grades, column) for column in logs.T])
    compliance = np.mean(np.exp(-along) / share, axis=1)
    bar: FloatArray = strain / compliance
    return bar


def log_load(specimen: Specimen, palette: Palette, *, stretched: float = 1.0) -> float | None:
    """Return ln(measured over predicted load), the median over the first loading's upper part.

    Parameters
    ----------
    stretched
        Factor on the strains, to see what the load would be were the travel in another unit.

    Returns
    -------
    float or None
        None where nothing there is above zero.
    """
    strain, stress = first_loading(specimen)
    strain = strain * stretched
    end = min(float(strain[-1]), _law_end(specimen, palette))
    at = end * np.linspace(0.3, 0.9, 13)
    at = at[at > 0.0]
    if len(at) < 3:
        return None
    measured = stress_at(strain, stress, at)
    predicted = predicted_stress_MPa(specimen, palette, at)
    both = (measured > 0.0) & (predicted > 0.0)
    if both.sum() < 3:
        return None
    return float(np.median(np.log(measured[both] / predicted[both])))


def _law_end(specimen: Specimen, palette: Palette) -> float:
    if specimen.profile is None:
        return palette.resolve(specimen.material or "").elongation_at_break
    return min(m.elongation_at_break for m in palette.materials)


def _mean_section_mm2(specimen: Specimen) -> float:
    section = specimen.section_mm2(_slices(specimen))
    return 1.0 if section is None else float(np.mean(section))


def _slices(specimen: Specimen) -> FloatArray:
    middles: FloatArray = specimen.gauge_mm * (np.arange(200) + 0.5) / 200
    return middles

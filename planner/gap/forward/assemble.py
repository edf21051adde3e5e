"""The setup of a campaign's tests, with no effect."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray, FloatArray
from planner.gap.campaign import Campaign
from planner.gap.forward.legs import Path
from planner.gap.forward.read_off import step_times_s
from planner.gap.forward.setup import RELAXATION_TIMES_s, Setup
from planner.gap.forward.slices import slice_edges_mm
from planner.gap.forward.steps import Walk
from planner.gap.specimen import Specimen

__all__ = ["MountedTest", "assemble", "mean_section_mm2", "mean_times_s"]

_ORIENTATIONS = {"x": 0, "y": 1, "z": 2}
_USUAL: Mapping[str, float] = {"temperature_C": 23.0, "soak_h": 0.0, "age_days": 1.0}
"""Stand in for conditions that neither specimens nor palette tell; no test is at them then."""


@dataclass(frozen=True, slots=True, eq=False)
class MountedTest:
    """One test: the specimens that went the same way, by their place, and their steps.

    Attributes
    ----------
    frames
        Fractions of the first loading at which strain fields are compared.
    """

    places: tuple[int, ...]
    walk: Walk
    time_s: FloatArray
    frames: tuple[float, ...]


def mean_times_s(paths: Sequence[Path], walk: Walk) -> FloatArray:
    """Return the mean of the times at which specimens came by each step, rising."""
    times = np.mean([step_times_s(path, walk) for path in paths], axis=0)
    least = 1e-9 * float(times[-1])
    return np.asarray(np.maximum.accumulate(times) + least * np.arange(len(times)))


def slice_bounds_mm(specimen: Specimen) -> FloatArray:
    """Return the edges of a specimen's slices along the drawn gauge."""
    if specimen.profile is None:
        return np.array([0.0, specimen.gauge_mm])
    edges = slice_edges_mm(specimen.profile)
    return np.asarray(edges * (specimen.gauge_mm / edges[-1]))


def assemble(campaign: Campaign, tests: Sequence[MountedTest], paths: Mapping[int, Path]) -> Setup:
    """Return the setup: as printed, by the palette's laws, in a rigid machine."""
    groups = [[campaign.specimens[place] for place in test.places] for test in tests]
    bounds = [slice_bounds_mm(group[0]) for group in groups]
    counts = [len(b) - 1 for b in bounds]
    coordinate, area = [], []
    for group, b in zip(groups, bounds, strict=True):
        middle = 0.5 * (b[1:] + b[:-1])
        coordinate.append(_coordinates(campaign, group[0], middle))
        area.append(mean_section_mm2(group, middle))
    reference = campaign.palette.reference
    covariates: dict[str, FloatArray] = {}
    known: dict[str, BoolArray] = {}
    for name, usual in _USUAL.items():
        stands = getattr(reference, name)
        values = [[getattr(s, name) for s in group] for group in groups]
        covariates[name], known[name] = _means(values, usual if stands is None else stands)
    for name in ("width_mm", "thickness_mm"):
        sizes = [[nominal_size_mm(s, name) for s in group] for group in groups]
        covariates[name], known[name] = _means(sizes, 1.0)
    orientations = [next((s.orientation for s in group if s.orientation), None) for group in groups]
    known["orientation"] = np.array([o is not None for o in orientations])
    always = np.ones(len(tests), dtype=np.bool_)
    known.update(rate_per_s=always, rate_mm_s=always, gauge_mm=always)
    gauge = np.array([np.mean([s.gauge_mm for s in group]) for group in groups])
    rate = np.array([np.mean([paths[place].speed_mm_s for place in t.places]) for t in tests])
    slices, steps = sum(counts), len(tests[0].time_s)
    none = np.zeros(slices)
    still = np.zeros(len(tests))
    coordinates = [m.coordinate for m in campaign.palette.materials]
    return Setup(
        reference=reference,
        coordinate_range=(coordinates[0], coordinates[-1]),
        first_slice=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        time_s=np.stack([test.time_s for test in tests]),
        travel_mm=np.stack([test.walk.travel_mm for test in tests]),
        rate_per_s=rate / gauge,
        gauge_mm=gauge,
        orientation=np.array([_ORIENTATIONS[o or reference.orientation or "x"]
                              for o in orientations]),
        known=known,
        designs=tuple(group[0].profile for group in groups),
        x_mm=np.concatenate([0.5 * (b[1:] + b[:-1]) for b in bounds]),
        length_mm=np.concatenate([np.diff(b) for b in bounds]),
        coordinate=np.concatenate(coordinate),
        log_factor=none,
        log_tilt=none,
        relaxing=np.zeros((slices, len(RELAXATION_TIMES_s))),
        softening=none,
        set_share=none,
        area_mm2=np.concatenate(area),
        travel_factor=np.ones(len(tests)),
        lost_mm=np.zeros((len(tests), steps)),
        slip_mm_N=still,
        slip_from_N=still,
        slip_power=np.ones(len(tests)),
        compliance_mm_N=still,
        compliance_power=np.ones(len(tests)),
        gain=np.ones((len(tests), steps)),
        offset_N=np.zeros((len(tests), steps)),
        **covariates,
    )  # fmt: skip


def mean_section_mm2(group: Sequence[Specimen], x_mm: FloatArray) -> FloatArray:
    """Return the mean section of specimens along the gauge; 1 mm² where it is unknown."""
    found = [area for s in group if (area := s.section_mm2(x_mm)) is not None]
    return np.mean(found, axis=0) if found else np.ones_like(x_mm)


def nominal_size_mm(specimen: Specimen, name: str) -> float | None:
    """Return nominal `width_mm` or `thickness_mm`, else the design's mean, else the measured."""
    own: float | None = getattr(specimen, name)
    design = specimen.profile
    if own is None and design is not None and getattr(design, name) is not None:
        length = design.length_mm
        own = float(np.trapezoid(getattr(design, name), design.x_mm)) / length
    return getattr(specimen, f"measured_{name}") if own is None else own


def _coordinates(campaign: Campaign, specimen: Specimen, x_mm: FloatArray) -> FloatArray:
    if specimen.profile is None:
        return np.full_like(x_mm, campaign.palette.resolve(specimen.material or "").coordinate)
    return specimen.profile.at(x_mm)


def _means(
    groups: Sequence[Sequence[float | None]], otherwise: float
) -> tuple[FloatArray, BoolArray]:
    """Return the mean of what is known of each group, and whether anything is."""
    values = [[value for value in group if value is not None] for group in groups]
    known = np.array([bool(v) for v in values])
    return np.array([float(np.mean(v)) if v else otherwise for v in values]), known

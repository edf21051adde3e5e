"""Photopolymer resins of one laboratory: replicates, three print sessions, three treatments.

Liao et al., Sci. Data 2025 (CMU B.O.R.G.; MIT), as tidy tables: every specimen with its own length
and section, crosshead and load as recorded ("raw") and as the authors trimmed them. Nominal strain
is the crosshead's travel over the length between the grips; no temperature was published.
"""

import csv
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np

from benchmarks.withheld.real.coupons import coupon, fitted_palette, folder_of
from planner.gap.campaign import Campaign, Specimen
from planner.numerics import FloatArray
from planner.palette import Reference

__all__ = ["BORG", "Recorded", "toe_compensated"]

UNTREATED, ETHANOL, AUTOCLAVE = "NS", "EtOH", "Autoclave"
BIOFLEX, BIOFLEX_UNW2 = "3dresyn bioflex ipa", "3dresyn bioflex unw2"
DENTAGUM, SILICONE, SILICONE_MIX = (
    "asiga dentagum",
    "formlabs silicone ipa",
    "formlabs silicone mix",
)
DENTAGUIDE, AQUAGRAY = "asiga dentaguide", "phrozen aquagray"
ALL = (BIOFLEX, BIOFLEX_UNW2, SILICONE, DENTAGUM)
"""The soft resins that were washed as their makers say, each stiffer than the one before."""

SOFT_MM = {"width_mm": 3.0, "thickness_mm": 1.5, "gauge_mm": 26.0, "rate_mm_s": 500.0 / 60.0}
RIGID_MM = {"width_mm": 1.0, "thickness_mm": 0.75, "gauge_mm": 7.0, "rate_mm_s": 5.0 / 60.0}
DISC_MM = {"gauge_mm": 5.0, "rate_mm_s": 0.2}
"""As drawn, to the nearest step of what was measured; strain is of each specimen's own length."""

YIELDING = 0.9
"""Of the largest stress: palettes of the rigid resins hold below it, as no law here yields."""


@dataclass(frozen=True)
class _Set:
    """Which specimens make the palette, and which the campaign.

    Attributes
    ----------
    resins
        Of the palette; `stand_in` was tested in place of the first, under its name.
    reference
        Plates whose specimens the palette is fitted to.
    fitted
        The treatment of those.
    test
        "Tensile" or "Compression".
    raw
        Whether the campaign has the curves as recorded.
    measured
        Whether measured sections are told.
    own_gauge
        Whether each specimen has its own length as its gauge, rather than strain alone.
    nominal
        Columns that all specimens share.
    toes
        Whose curves are compensated for their toe and end before they yield.
    """

    resins: tuple[str, ...]
    treatments: tuple[str, ...] = (UNTREATED,)
    plates: str = "123"
    reference: str = "12"
    fitted: str = UNTREATED
    test: str = "Tensile"
    stand_in: str = ""
    raw: bool = False
    measured: bool = True
    own_gauge: bool = False
    nominal: Mapping[str, float] = field(default_factory=lambda: SOFT_MM)
    toes: Literal["nobody", "palette", "both"] = "nobody"


_TREATED = (UNTREATED, ETHANOL, AUTOCLAVE)
_SETS: Mapping[str, _Set] = MappingProxyType(
    {
        "bioflex": _Set((BIOFLEX,)),
        "bioflex-unw2": _Set((BIOFLEX_UNW2,)),
        "silicone": _Set((SILICONE,)),
        "dentagum": _Set((DENTAGUM,)),
        "four-resins": _Set(ALL, plates="3"),
        "own-gauges": _Set((DENTAGUM,), own_gauge=True),
        "bioflex-treated": _Set((BIOFLEX,), _TREATED),
        "silicone-treated": _Set((SILICONE,), _TREATED),
        "dentagum-treated": _Set((DENTAGUM,), _TREATED),
        "four-resins-treated": _Set(ALL, _TREATED),
        "wrong-area": _Set((SILICONE,), stand_in=SILICONE_MIX, measured=False),
        "right-area": _Set((SILICONE,), stand_in=SILICONE_MIX),
        "session": _Set((SILICONE_MIX,), (ETHANOL,), reference="23", fitted=ETHANOL),
        "raw": _Set((BIOFLEX, SILICONE, DENTAGUM), (AUTOCLAVE,), fitted=AUTOCLAVE, raw=True),
        "aquagray-treated": _Set((AQUAGRAY,), _TREATED, nominal=RIGID_MM, toes="both"),
        "slack": _Set((AQUAGRAY,), nominal=RIGID_MM, toes="palette"),
        "softened": _Set((DENTAGUIDE,), nominal=RIGID_MM, toes="palette"),
        "compression": _Set(ALL, test="Compression", nominal=DISC_MM),
    }
)


@dataclass(frozen=True, eq=False)
class Recorded:
    """One specimen as the tables have it; `use` is what its authors kept for their figures."""

    test: str
    resin: str
    treatment: str
    plate: str
    specimen: str
    length_mm: float
    thickness_mm: float
    width_mm: float
    area_mm2: float
    use: bool
    time_s: FloatArray
    travel_mm: FloatArray
    load_N: FloatArray

    @property
    def strain(self) -> FloatArray:
        """Nominal, positive in compression too."""
        return self.travel_mm / self.length_mm

    @property
    def stress_MPa(self) -> FloatArray:
        """Nominal, by the measured section."""
        return self.load_N / self.area_mm2


def _read(folder: Path, test: str, curves: str) -> list[Recorded]:
    """Return the specimens of one kind of test that have a length, a section and a curve."""
    rows: dict[tuple[str, ...], list[tuple[float, ...]]] = {}
    with (folder / curves).open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            key = tuple(row[k] for k in ("resin", "sterilization", "plate", "specimen"))
            at = (float(row[k]) for k in ("time_s", "crosshead_mm", "load_N"))
            # The resins' names differ in case between the sources' sheets
            rows.setdefault((key[0].lower(), *key[1:]), []).append(tuple(at))
    found = []
    with (folder / "geometry.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            key = (row["resin"].lower(), row["sterilization"], row["plate"], row["specimen"])
            if row["test"] != test or key not in rows or not row["L0_mm"]:
                continue
            thickness, area = float(row["d_or_thickness_mm"]), float(row["area_mm2"])
            found.append(
                Recorded(
                    test,
                    *key,
                    length_mm=float(row["L0_mm"]),
                    thickness_mm=thickness,
                    width_mm=area / thickness,
                    area_mm2=area,
                    use=row["use"] == "1",
                    **dict(
                        zip(("time_s", "travel_mm", "load_N"), np.array(rows[key]).T, strict=True)
                    ),
                )
            )
    return found


def toe_compensated(strain: FloatArray, stress: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a curve from where its steepest tangent meets the axis, up to `YIELDING`."""
    below = np.arange(len(stress)) <= np.argmax(stress >= YIELDING * stress.max())
    strain, stress = strain[below], stress[below]
    # The slope over a fifth of the rise: single steps are noise
    window = max(3, len(stress) // 5)
    rise = (stress[window:] - stress[:-window]) / (strain[window:] - strain[:-window])
    at = int(np.argmax(rise))
    middle = slice(at, at + window + 1)
    slope, crossing = np.polyfit(strain[middle], stress[middle], 1)
    start = -crossing / slope
    straight = strain > strain[middle].mean()
    return strain[straight] - start, stress[straight]


def _made(name: str, data: Path) -> Campaign:
    chosen = _SETS[name]
    folder = folder_of(data, "borg_resins")
    tensile = _read(folder, "Tensile", "tension_trimmed_by_authors.csv")
    if chosen.test == "Compression":
        tested = _read(folder, chosen.test, "compression_raw.csv")
    else:
        tested = _read(folder, "Tensile", "tension_raw.csv") if chosen.raw else tensile
    fitted = {
        _id(resin): _curves(
            (
                r
                for r in tensile
                if r.resin == resin
                and r.treatment == chosen.fitted
                and r.plate in chosen.reference
                and r.use
            ),
            toe_compensated if chosen.toes != "nobody" else _as_it_is,
        )
        for resin in chosen.resins
    }
    nominal = dict(chosen.nominal)
    rate = nominal["rate_mm_s"] / nominal["gauge_mm"]
    palette = fitted_palette(
        f"borg-{name}", fitted, Reference(strain_rate_per_s=rate), "Liao et al. 2025"
    )
    if chosen.toes != "nobody":
        # Rigid resins count as plastic, and no coupon is planned of such; they are below yield here
        springs = tuple(replace(m, deformation="elastic") for m in palette.materials)
        palette = replace(palette, materials=springs)
    named = {chosen.stand_in or resin: _id(resin) for resin in chosen.resins}
    specimens = tuple(
        _coupon(r, named[r.resin], chosen)
        for r in tested
        if r.resin in named and r.treatment in chosen.treatments and r.plate in chosen.plates
    )
    notes = (
        "Strain is the crosshead's travel over each specimen's own length between the grips; "
        "travel and time are of one gauge length with that strain, unless each has its own."
    )
    columns = ("treatment",) if len(chosen.treatments) > 1 else ()
    return Campaign(f"borg-{name}", "none", palette, specimens, columns, notes)


def _as_it_is(strain: FloatArray, stress: FloatArray) -> tuple[FloatArray, FloatArray]:
    return strain, stress


def _curves(
    chosen: Iterable[Recorded],
    through: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]],
) -> list[tuple[FloatArray, FloatArray]]:
    return [through(r.strain, r.stress_MPa) for r in chosen]


def _id(resin: str) -> str:
    return resin.replace(" ", "-")


def _coupon(r: Recorded, material: str, chosen: _Set) -> Specimen:
    """Return a specimen whose force is what was recorded; compression counts negative."""
    nominal: dict[str, object] = dict(chosen.nominal)
    if chosen.own_gauge:
        nominal["gauge_mm"] = r.length_mm
    if chosen.test == "Compression":
        nominal |= {"width_mm": r.width_mm, "thickness_mm": r.thickness_mm}
    elif chosen.measured:
        nominal |= {"measured_width_mm": r.width_mm, "measured_thickness_mm": r.thickness_mm}
    if len(chosen.treatments) > 1:
        nominal["covariates"] = {"treatment": r.treatment}
    sign = -1.0 if chosen.test == "Compression" else 1.0
    section = float(nominal["width_mm"]) * float(nominal["thickness_mm"])  # type: ignore[arg-type]
    speed = float(nominal["rate_mm_s"]) / float(nominal["gauge_mm"])  # type: ignore[arg-type]
    strain, stress = r.strain, r.stress_MPa
    if chosen.toes == "both":
        strain, stress = toe_compensated(strain, stress)
        time_s = strain / speed
    else:
        # The first row comes a moment after the start, in compression half a minute of approach;
        # the clock runs so that the strain of the shared gauge goes at the speed that was set
        length = float(nominal["gauge_mm"]) / r.length_mm  # type: ignore[arg-type]
        time_s = length * (r.time_s - r.time_s[0]) + max(float(strain[0]), 0.0) / speed
    return coupon(
        "-".join((*_id(r.resin).split("-")[1:], r.treatment, r.plate, r.specimen.split()[0])),
        material,
        time_s,
        sign * strain,
        sign * stress * (r.area_mm2 / section),
        protocol="monotonic",
        batch=f"{_id(r.resin)}-{r.plate}",
        **nominal,
    )


BORG: Mapping[str, Callable[[Path], Campaign]] = MappingProxyType(
    {f"borg-{name}": partial(_made, name) for name in _SETS}
)
"""Makers of the campaigns, by their names."""

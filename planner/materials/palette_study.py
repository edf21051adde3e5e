"""From a set of tensile tests to a palette or a table of characteristics."""

import inspect
import itertools
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from planner.errors import (
    ArgumentError,
    Caution,
    FileError,
    PaletteError,
    as_count,
    as_number,
    as_texts,
    check_kind,
    check_known,
    listed,
)
from planner.formats.specimens import ListedSpecimen
from planner.formats.tables import encode_csv, number
from planner.glance import counted, one_line, outcome, plotted, shade
from planner.materials.algorithm_one import QuadraticStudy, quadratic_study
from planner.materials.characterise import (
    SECANT_STRAINS,
    Characteristics,
    Curve,
    MaterialCharacteristics,
    Spread,
    characterise_material,
    doubts,
    toe_compensated,
)
from planner.materials.fit import (
    ASSUMED_LOG_SD,
    RELATIVE_FLOOR,
    STARTS,
    MaterialFit,
    fit_material,
    loading,
    widened,
)
from planner.materials.laws import candidate_laws, make_law, secant_modulus_MPa, stability
from planner.materials.mixtures import CoefficientModel, left_out_remark
from planner.materials.study import ReadRecord, Study, read_study
from planner.materials.unit_slips import unit_slips
from planner.numerics import FloatArray, normal_quantile
from planner.palette import SAME_K, Material, Palette, Reference, Temperature
from planner.printers import Printer, installed_printers, palette_of

__all__ = ["Characterisation", "PaletteStudy", "characterise", "fit", "fit_tables"]


_READING = tuple(inspect.signature(read_study).parameters)
"""What `characterise` and `fit` hand on as they are given it."""


# ------------------------------------------------------------------------------------------------
# Characteristics as files: a CSV table, one row a material, and a JSON document.


@dataclass(frozen=True, slots=True, eq=False)
class Characterisation:
    """What tensile tests say of materials without any law.

    Attributes
    ----------
    materials
        In the order of the tests.
    notes
        What was corrected, assumed or left out when the tests were read, one sentence each.
    unit_slips
        Where a unit seems to have been taken for another, one sentence each.
    curves
        The specimens' curves by material, strains as recorded.
    records
        What was read of each specimen: file, sheet, columns, sizes and where they come from.
    unused
        What was in the files and is in no figure, one sentence each.
    """

    materials: tuple[MaterialCharacteristics, ...]
    notes: tuple[str, ...] = ()
    unit_slips: tuple[str, ...] = ()
    curves: Mapping[str, Sequence[Curve]] = field(default_factory=dict)
    records: tuple[ReadRecord, ...] = ()
    unused: tuple[str, ...] = ()

    plot = plotted

    @one_line
    def __repr__(self) -> str:
        return (
            f"of {counted(len(self.materials), 'material')}, "
            f"{counted(sum(len(one.specimens) for one in self.materials), 'specimen')}; "
            + outcome((len(self.findings), "finding"))
        )

    @property
    def findings(self) -> tuple[str, ...]:
        """What speaks against the materials' figures, one sentence each."""
        each = ((one, _names(self.unit_slips, one.material)) for one in self.materials)
        told = [said for one, unit_told in each for said in doubts(one, unit_told=unit_told)]
        return (*self.unused, *self.unit_slips, *told)

    @property
    def ok(self) -> bool:
        """Whether nothing speaks against the figures."""
        return not self.findings

    def csv(self) -> bytes:
        """Return the table: material, specimens, deformation, then the figures with their spread.

        The columns of a figure `modulus_MPa` are modulus_MPa, modulus_sd_MPa, modulus_cv,
        modulus_low_MPa, modulus_high_MPa (95 % interval) and modulus_n: how many specimens have
        the figure, as a secant beyond break is none. Numbers have nine significant digits; an
        empty cell means unknown.
        """
        names = dict.fromkeys(name for m in self.materials for name in m.spreads)
        rows: list[_Row] = []
        for one in self.materials:
            kind = one.deformation.kind
            row = {"material": one.material, "specimens": one.n, "deformation": kind}
            for name in names:
                row |= _cells(name, one.spreads.get(name))
            rows.append(row)
        return _table(rows)

    def document(self) -> dict[str, Any]:
        """Return the figures of materials and specimens as plain values, unrounded."""
        specimens = [c for m in self.materials for c in m.specimens]
        return {
            "schema": 1,
            "records": [_told(one, columns=dict(one.columns)) for one in self.records],
            "materials": [_characteristics_document(m) for m in self.materials],
            "notes": [*self.notes, *(note for c in specimens for note in c.notes)],
            "findings": list(self.findings),
        }


def characterise(
    files: Study | str | Path | Iterable[str | Path],
    *,
    specimens: str | Path | None = None,
    material: str | None = None,
    width_mm: float | None = None,
    thickness_mm: float | None = None,
    gauge_mm: float | None = None,
    columns: Sequence[str] | None = None,
    unit_of: str | Sequence[str] = (),
    mode: str | None = None,
    blocks: str | None = None,
    leave_out: Collection[str] = (),
    printer: str | Printer = "connex3",
    palette: str | Path | Palette | None = None,
    compare: bool = True,
    at_strain: Sequence[float] | None = None,
) -> Characterisation:
    """Take modulus, toughness, elongation and their spread from tensile tests.

    Parameters
    ----------
    files
        Tensile files, or folders of them, or a study of such that was read already. A list of
        specimens among them, or named specimens.csv beside them, says what each one is.
    specimens
        The list of specimens, if it is elsewhere.
    material
        What all specimens without a row are made of; else their files tell.
    width_mm, thickness_mm, gauge_mm
        Size of the specimens that neither a row nor a file's head gives.
    columns
        Headings in place of the files' own, by position; ``-`` leaves a column out.
    unit_of
        The unit that force, travel, stress or strain is in, whatever the files say:
        ``"force=lbf:S1,S2"`` for some specimens or materials, ``"travel=in"`` for all.
    mode
        How specimens were loaded of which no row says it in a column ``mode``: ``tension``,
        ``compression``, ``planar`` or ``equibiaxial``. Figures are taken of tension alone.
    blocks
        Blocks of numbers in one sheet that nothing names: ``join`` reads them as one record,
        ``apart`` as specimens.
    leave_out
        Specimens and materials that no figure is to rest on.
    printer, palette
        By name, file or value: what materials of the same names are compared with.
    compare
        Whether they are; where some are off by a factor of units, that is a finding.
    at_strain
        Strains of secant moduli; 0.1, 0.5 and 1 by default.

    Returns
    -------
    Characterisation
        `Characterisation.ok` is false where something speaks against the figures.

    Raises
    ------
    FileError
        A file or curve that no result should rest on; the message names it.
    ArgumentError
        A size or strain that is not above 0, or no file at all.
    UnknownNameError
        A unit, specimen or material in `unit_of` or `leave_out` that there is not.

    Examples
    --------
    >>> found = planner.characterise(["samples/tensile"])  # doctest: +SKIP
    >>> round(found.materials[0].spreads["modulus_MPa"].mean, 3)  # doctest: +SKIP
    0.606
    """
    given = locals()
    study = read_study(**{name: given[name] for name in _READING})
    strains = SECANT_STRAINS if at_strain is None else tuple(np.atleast_1d(at_strain).tolist())
    found = tuple(characterise_material(*of, secant_strains=strains) for of in study.groups.items())
    stated = _by_material(study, study.groups, "coordinate", None)
    slips, asked = unit_slips(study, _compared(palette, printer, compare), stated)
    mixed = _mixed(_conditions(study), "figures of one material mix them")
    notes = (*study.notes, *_other_modes(study), *mixed, *asked)
    return Characterisation(found, notes, slips, study.groups, study.records, study.findings())


def _other_modes(study: Study, used: Collection[str] = ()) -> list[Caution]:
    """Say which specimens were not pulled along one axis, save those of materials that use them.

    Raises
    ------
    FileError
        None was.
    """
    said = [
        f"specimen {record.specimen}: tested in {record.mode}; left out of the figures of tension"
        for record in study.records
        if not record.left_out and record.mode != "tension" and record.material not in used
    ]
    if not study.groups:
        raise FileError(f"no curve to characterise: {'; '.join(said)}; add tensile tests")
    return [Caution(one) for one in said]


def _compared(
    palette: str | Path | Palette | None, printer: str | Printer, compare: bool
) -> Palette | None:
    """Return what a study is compared with: the palette named, or that of an installed printer."""
    asked = compare and (palette is not None or installed_printers())
    return palette_of(palette, printer) if asked else None


def _characteristics_document(material: MaterialCharacteristics) -> dict[str, Any]:
    def specimen(found: Characteristics) -> dict[str, Any]:
        secants = {f"{strain:g}": value for strain, value in found.secant_MPa.items()}
        return _told(found, secant_MPa=secants, deformation=found.deformation.kind)

    return {
        "material": material.material,
        "deformation": material.deformation.kind,
        "deformation_reason": material.deformation.reason,
        "specimens_agree": material.agree,
        "figures": {name: asdict(spread) for name, spread in material.spreads.items()},
        "specimens": list(map(specimen, material.specimens)),
    }


def _told(value: Any, **other: Any) -> dict[str, Any]:
    """Return the fields of a value but its notes, some told otherwise."""
    return _these(value, *(each.name for each in fields(value) if each.name != "notes")) | other


def _these(value: Any, *names: str) -> dict[str, Any]:
    """Return some of a value's attributes."""
    return {name: getattr(value, name) for name in names}


_Row = dict[str, Any]


def _cells(name: str, figure: Spread | None) -> _Row:
    """Return what a row says of a figure, by column; the unit stays at the end."""
    stem, unit = re.split(r"(?=_MPa|_MJ_m3|$)", name, maxsplit=1)
    names = (name, f"{stem}_sd{unit}", f"{stem}_cv", f"{stem}_low{unit}", f"{stem}_high{unit}")
    told = (figure.mean, figure.sd, figure.cv, *(figure.interval or ())) if figure else ()
    return dict(itertools.zip_longest(names, told)) | {f"{stem}_n": figure.n if figure else 0}


def _table(rows: Sequence[_Row]) -> bytes:
    """Return rows as CSV, with a column for each key of any."""
    header = list(dict.fromkeys(key for row in rows for key in row))
    return encode_csv([header, *([row.get(key) for key in header] for row in rows)])


# ------------------------------------------------------------------------------------------------
# From a study's groups of curves to a palette, with a report of every law that was tried.


_DEFAULT_DENSITY_G_CM3 = 1.14
"""Assumed where none is given: between the 1.12 to 1.13 assumed of TangoPlus and the 1.17 to
1.18 g/cm3 of VeroWhite."""

_RANKING_STRAIN = 0.1
"""Secant modulus at this strain, or at the smallest elongation at break, orders a palette."""

_SMALLEST_R2 = 0.9
_LARGEST_HELD_OUT_ERROR = 0.2
"""A law that does worse than either is reported as a finding."""

_DIFFERENT = 1e-3
"""Relative spread of a condition that counts as a difference between specimens."""


@dataclass(frozen=True, slots=True, eq=False)
class PaletteStudy:
    """A palette fitted to a study.

    Attributes
    ----------
    fits
        By material id, from soft to hard.
    notes
        What was corrected, assumed or doubtful, one sentence each.
    problem
        Why the palette cannot be planned with as it is, or None.
    findings
        What speaks against a material's figures or its law, one sentence each; the problem is
        not among them.
    quadratic
        Algorithm 1 of Hemleben's thesis on the same tests, if asked for.
    """

    palette: Palette
    fits: Mapping[str, MaterialFit]
    notes: tuple[str, ...]
    problem: str | None
    findings: tuple[str, ...] = ()
    quadratic: QuadraticStudy | None = None

    @one_line
    def __repr__(self) -> str:
        return f"{self.palette.name}: {counted(len(self.fits), 'material')} fitted; " + outcome(
            (self.problem is not None, "problem"), (len(self.findings), "finding")
        )

    @property
    def ok(self) -> bool:
        """Whether the palette can be planned with, and nothing speaks against it."""
        return self.problem is None and not self.findings

    def document(self) -> dict[str, Any]:
        """Return the report as plain values."""
        return {
            "schema": 1,
            "palette": self.palette.name,
            "materials": [_material_document(m, self.fits[m.id]) for m in self.palette.materials],
            "notes": list(self.notes),
            "problem": self.problem,
            "findings": list(self.findings),
            **({} if self.quadratic is None else {"quadratic": self.quadratic.document()}),
        }


def fit(
    files: Study | str | Path | Iterable[str | Path],
    *,
    law: str = "all",
    name: str | None = None,
    weighting: str = "relative",
    coordinate: Mapping[str, float] | None = None,
    order: Sequence[str] | None = None,
    density: Mapping[str, float] | None = None,
    starts: int = STARTS,
    level: float = 0.95,
    coefficients: str | None = None,
    specimens: str | Path | None = None,
    material: str | None = None,
    width_mm: float | None = None,
    thickness_mm: float | None = None,
    gauge_mm: float | None = None,
    columns: Sequence[str] | None = None,
    unit_of: str | Sequence[str] = (),
    mode: str | None = None,
    blocks: str | None = None,
    leave_out: Collection[str] = (),
    printer: str | Printer = "connex3",
    palette: str | Path | Palette | None = None,
    compare: bool = True,
    progress: Callable[[str], None] | None = None,
) -> PaletteStudy:
    """Fit laws to tensile tests, choose one a material, and make a palette with intervals.

    Parameters
    ----------
    files, specimens, material, width_mm, thickness_mm, gauge_mm, columns, unit_of, mode, blocks
        The tests; see `characterise`.
    leave_out
        Specimens and materials that are not to be fitted.
    printer, palette, compare
        What they are compared with; see `characterise`.
    law
        ``neo-hookean``, ``yeoh``, ``martins``, ``ogden``, ``ogden-1``, ``-2`` or ``-3`` (terms),
        or ``all``: the best is chosen.
    name
        Name of the palette; ``palette`` by default, on the command line that of the file.
    weighting
        Residuals ``relative`` to the stress, or ``absolute``.
    coordinate
        Coordinate m by material. Without it: the column ``coordinate`` of specimens.csv, else
        0 to 1 evenly in the order of stiffness.
    order
        All materials from soft to hard, in place of coordinates, where tests leave it open.
    density
        In g/cm3 by material. Without it: the column ``density_g_cm3``, else 1.14, which is noted.
    starts
        Starts of each search.
    level
        Coverage of the intervals.
    coefficients
        ``quadratic`` runs Algorithm 1 of Hemleben's thesis beside: every coefficient of eq. 3.8 as
        a quadratic of m. The palette is the same.
    progress
        Told which material is fitted.

    Returns
    -------
    PaletteStudy
        With the palette, and what was tried. `write_palette` writes the palette.

    Raises
    ------
    ArgumentError
        An unknown weighting or material, no stable law, or coordinates or an order that go
        against stiffness by more than the intervals leave open.
    UnknownNameError
        An unknown law.
    FileError
        A curve or a column that no figure can rest on.

    Examples
    --------
    >>> fitted = planner.fit(["samples/tensile"], law="ogden")  # doctest: +SKIP
    >>> planner.write_palette(fitted.palette, "lab.toml")  # doctest: +SKIP
    """
    given = locals()
    study = read_study(**{name: given[name] for name in _READING})
    check_known(weighting, ("relative", "absolute"), f"weighting {weighting!r}: {{}}choose")
    as_count(starts, "`starts`", 2000)
    if coefficients not in (None, "quadratic"):
        raise ArgumentError(f"`coefficients` {coefficients!r}: it can be quadratic, or left out")
    tell = progress or (lambda stage: None)
    laws = candidate_laws(law)
    study, elsewhere = _at_one_temperature(_with_compressed(study))
    stated = _by_material(study, study.groups, "coordinate", coordinate)
    slips, asked = unit_slips(study, _compared(palette, printer, compare), stated)
    notes = [*study.notes, *_other_modes(study, study.groups), *asked]
    fits: dict[str, MaterialFit] = {}
    for called, curves in study.groups.items():
        tell(f"fitting {called}")
        fits[called] = fitted = fit_material(
            called, curves, laws, others=study.other_modes.get(called, ()), weighting=weighting,
            starts=starts, level=level,
        )  # fmt: skip
        notes.extend(note for note in fitted.notes if note not in notes)
    if single := [called for called, fitted in fits.items() if fitted.characteristics.n == 1]:
        notes.append(
            f"one specimen of {listed(single, 3)}: scatter of {100 * ASSUMED_LOG_SD:g} % is "
            "assumed; laws are judged by blocks of strain"
        )
    coordinates = _coordinates(fits, stated, coordinate, order, notes, slips)
    ordered = sorted(coordinates, key=coordinates.__getitem__)
    densities = _densities(study, ordered, density, notes)
    ids = _ids(ordered)
    materials = tuple(
        Material(
            id=ids[called],
            aliases=() if ids[called] == called else (called,),
            coordinate=coordinates[called],
            elongation_at_break=fits[called].elongation_at_break,
            density_g_cm3=densities[called],
            law=fits[called].law,
            colour=shade(rank / max(len(ordered) - 1, 1)),
            source=_source(fits[called], weighting),
            deformation=fits[called].characteristics.deformation.kind,
            modulus_log_sd=fits[called].scatter.log_sd,
            uncertainty=fits[called].uncertainty,
        )
        for rank, called in enumerate(ordered)
    )
    table = _temperature_table(study, fits, elsewhere, coordinates)
    fitted_palette = Palette(
        name or "palette", materials, _reference(study, notes), "planner fit", temperature=table
    ).as_written()
    if table is not None:
        notes.extend(_warming(fitted_palette, table))
        notes.extend(_warmed_and_more(study, elsewhere))
    by_id = {ids[called]: fits[called] for called in ordered}
    found = [_findings(fits[called], _names(slips, called)) for called in ordered]
    findings = (*study.findings(), *slips, *itertools.chain.from_iterable(found))
    problem = None
    try:
        notes += CoefficientModel(fitted_palette).remarks()
        notes += left_out_remark(fitted_palette)
    except PaletteError as error:
        problem = str(error)
    quadratic = None
    if coefficients is not None:
        tell("running Algorithm 1")
        quadratic = quadratic_study(fitted_palette, by_id, level)
    return PaletteStudy(fitted_palette, by_id, tuple(notes), problem, findings, quadratic)


def _with_compressed(study: Study) -> Study:
    """Return a study with what was compressed alone among its groups, its curves as sizes."""
    groups, others = dict(study.groups), dict(study.other_modes)
    for material, curves in study.other_modes.items():
        if material not in groups and all(curve.mode == "uniaxial" for curve in curves):
            groups[material] = tuple(
                replace(c, strain=-c.strain, stress_MPa=-c.stress_MPa, mode="compression")
                for c in others.pop(material)
            )
    return replace(study, groups=groups, other_modes=others)


def _source(fit: MaterialFit, weighting: str) -> str:
    limits = stability(make_law(fit.law), fit.elongation_at_break).limits
    of = f"{fit.characteristics.n} {'compressed' if fit.compressed else 'tensile'} specimen(s)"
    said = f"fitted to {of}, {weighting} residuals"
    return f"{said}; stable (Drucker) {', '.join(limits)} only" if limits else said


def _warming(palette: Palette, table: Temperature) -> Iterator[str]:
    """Say what tests at two temperatures tell of grades."""
    called = {material.coordinate: material.id for material in palette.materials}
    for m, low, high, factor, sd in zip(*msgspec.structs.astuple(table), strict=True):
        ends = [f"{factor * np.exp(side * normal_quantile() * sd):.3g}" for side in (-1.0, 1.0)]
        yield (
            f"warming multiplies stress of {called[m]} by {factor:.3g} from {low:g} to {high:g} "
            f"degC (95 % {' .. '.join(ends)})"
        )
    yield (
        f"laws are of {palette.reference.temperature_C:g} degC; planner materials --temperature-C "
        "tells them at another"
    )


def _names(slips: Sequence[str], material: str) -> bool:
    """Return whether specimens of a material were said to be in another unit."""
    return any(said.startswith(f"{material}: ") for said in slips)


def _findings(fit: MaterialFit, unit_told: bool) -> Iterator[str]:
    """Say what speaks against the specimens, and against the law that was chosen."""
    yield from doubts(fit.characteristics, unit_told=unit_told)
    if unit_told:
        return  # no law describes specimens in two units
    r2, chosen = fit.uncertainty.r2, fit.choice.chosen
    if chosen is None and r2 is not None and r2 < _SMALLEST_R2:
        yield (
            f"material {fit.material}: a law that yields describes it badly (R2 {r2:.3f}; at least "
            f"{_SMALLEST_R2:g} is asked): look at the specimens"
        )
    if chosen is not None and (
        chosen.fit.r2 < _SMALLEST_R2 or chosen.held_out_error > _LARGEST_HELD_OUT_ERROR
    ):
        yield (
            f"material {fit.material}: {chosen.fit.name} describes it badly (R2 "
            f"{chosen.fit.r2:.3f}, held-out error {100 * chosen.held_out_error:.2g} %; at least "
            f"{_SMALLEST_R2:g} and at most {100 * _LARGEST_HELD_OUT_ERROR:g} % are asked): look at "
            "the specimens, or try --law all"
        )


def _coordinates(
    fits: Mapping[str, MaterialFit],
    stated: Mapping[str, float],
    given: Mapping[str, float] | None,
    order: Sequence[str] | None,
    notes: list[str],
    slips: Sequence[str],
) -> Mapping[str, float]:
    """Return coordinates by material: stated, else even in the order given, else of stiffness."""
    strain = min(_RANKING_STRAIN, *(fit.elongation_at_break for fit in fits.values()))
    laws = {called: make_law(fit.law) for called, fit in fits.items()}
    stiffness = {called: float(secant_modulus_MPa(law, strain)) for called, law in laws.items()}
    order = as_texts(() if order is None else order, "`order`")
    found = {} if order else stated
    ordered = list(order) if order else sorted(fits, key=stiffness.__getitem__)
    if order and (sorted(order) != sorted(fits) or given):
        raise ArgumentError(
            f"`order` {', '.join(order)}: give each of {', '.join(fits)} once, and no `coordinate`"
        )
    if not found:
        if len(ordered) > 1:
            how = "as given" if order else f"by the secant modulus at strain {_RANKING_STRAIN:g}"
            more = "" if order else " or --order"
            notes.append(
                f"coordinates go from 0 to 1 evenly, {how}; --coordinate{more} says others"
            )
        found = dict(zip(ordered, np.linspace(0.0, 1.0, len(ordered)).tolist(), strict=True))
    if missing := [material for material in ordered if material not in found]:
        raise ArgumentError(
            f"material {missing[0]}: no coordinate, though others have one; give all of them by "
            f"`coordinate` {missing[0]}=... or a column coordinate in specimens.csv, or none"
        )
    for softer, harder in itertools.pairwise(sorted(found, key=found.__getitem__)):
        beyond = np.log(stiffness[softer] / stiffness[harder])
        scatter = np.hypot(fits[softer].scatter.log_sd, fits[harder].scatter.log_sd)
        if found[softer] == found[harder] or beyond > normal_quantile() * scatter:
            low, high = sorted((softer, harder), key=stiffness.__getitem__)
            raise ArgumentError(
                f"coordinate of {high} is {found[high]:g}, not above {found[low]:g} of "
                f"{low}, which is softer; coordinates must rise with stiffness"
                + "".join(f" ({said})" for said in slips)
            )
    return found


def _densities(
    study: Study, ordered: Sequence[str], given: Mapping[str, float] | None, notes: list[str]
) -> dict[str, float]:
    found = _by_material(study, ordered, "density_g_cm3", given)
    if assumed := [material for material in ordered if material not in found]:
        notes.append(
            f"density of {listed(assumed, 3)} assumed {_DEFAULT_DENSITY_G_CM3:g} g/cm3; --density "
            "or a column density_g_cm3 says another"
        )
    return dict.fromkeys(assumed, _DEFAULT_DENSITY_G_CM3) | found


def _by_material(
    study: Study, materials: Collection[str], column: str, given: Mapping[str, float] | None
) -> dict[str, float]:
    """Return a figure by material: as given, else from a column of specimens.csv."""
    if not isinstance(given := given or {}, Mapping):
        raise ArgumentError(f"{column} {given!r}: give figures by material, as {{'FLX9760': 1.1}}")
    for material in given:
        said = f"{column} of {material!r}: {{}}the tests have no such material, but"
        check_known(material, materials, said)
    found: dict[str, float] = {}
    for row in _rows(study):
        if not (cell := row.covariates.get(column, "")):
            continue
        # A cell holds one figure, so that a comma in it can only be the decimal sign.
        value = number(cell, ";")
        if value is None or not np.isfinite(value):
            raise ArgumentError(
                f"specimen {row.specimen}: {column} is {cell!r} in specimens.csv; write a number"
            )
        if found.setdefault(row.material, value) != value:
            raise ArgumentError(
                f"material {row.material}: {column} is {found[row.material]:g} for one specimen "
                f"and {value:g} for {row.specimen}; give one value"
            )
    return found | {name: as_number(given[name], f"{column} of {name}") for name in given}


def _rows(study: Study) -> list[ListedSpecimen]:
    """Return the rows of the specimens that were fitted."""
    used = [curve.specimen for curves in study.groups.values() for curve in curves]
    return [study.specimens[name] for name in used if name in study.specimens]


def _reference(study: Study, notes: list[str]) -> Reference:
    """Return the mean conditions of the specimens; what is unknown or differs is noted."""
    known = _conditions(study)
    notes += _mixed(known, "laws and scatter mix them; the mean is written, or no orientation")
    if unknown := [condition for condition, found in known.items() if not found]:
        notes.append(f"reference conditions unknown: {', '.join(unknown)}; see specimens.csv")
    ways = known.pop("orientation")
    means = {condition: float(np.mean(v)) for condition, v in known.items() if v}
    return Reference(**means, orientation=ways[0] if len(ways) == 1 else None)


def _conditions(study: Study) -> dict[str, list[Any]]:
    """Return what specimens have of each condition: numbers, and the different orientations."""
    rows = _rows(study)
    used = [study.dimensions.get(c.specimen) for curves in study.groups.values() for c in curves]
    rates = [d.rate_mm_s / d.gauge_mm for d in used if d and d.rate_mm_s and d.gauge_mm]
    values: dict[str, list[Any]] = {"strain_rate_per_s": rates}
    for condition in ("temperature_C", "soak_h", "age_days"):
        values[condition] = [v for r in rows if (v := getattr(r, condition)) is not None]
    return values | {"orientation": sorted({r.orientation for r in rows if r.orientation})}


def _mixed(known: Mapping[str, Sequence[Any]], how: str) -> Iterator[Caution]:
    """Say which conditions differ between specimens."""
    for condition, found in known.items():
        if condition == "orientation":
            differ, ends = len(found) > 1, ", ".join(found)
        else:
            differ = bool(found) and _apart(found)
            ends = f"{min(found):g} to {max(found):g}" if differ else ""
        if differ:
            yield Caution(f"{condition} differs between specimens ({ends}); {how}")


def _warmed_and_more(study: Study, others: dict[str, tuple[Curve, ...]]) -> Iterator[Caution]:
    """Say what else differs between a palette's temperature and those that it is compared with."""
    here = replace(study, groups={material: study.groups[material] for material in others})
    known, elsewhere = _conditions(here), _conditions(replace(study, groups=others))
    del known["temperature_C"]
    for condition, own in known.items():
        if not own or not (far := elsewhere[condition]):
            continue
        if condition == "orientation":
            differ, ends = own != far, [", ".join(own), ", ".join(far)]
        else:
            means = float(np.mean(own)), float(np.mean(far))
            differ, ends = _apart(means), [f"{mean:.4g}" for mean in means]
        if differ:
            yield Caution(
                f"{condition} differs between temperatures ({ends[0]} at the palette's, {ends[1]} "
                "elsewhere); what warming multiplies stress by holds what that does too"
            )


def _apart(values: Sequence[float]) -> bool:
    return float(np.ptp(values)) > _DIFFERENT * max(map(abs, values))


def _ids(materials: Sequence[str]) -> dict[str, str]:
    """Return ids that may stand in file names, by material."""
    ids: dict[str, str] = {}
    for material in materials:
        identifier = re.sub(r"[^A-Za-z0-9._-]+", "-", material).strip("-") or "material"
        if identifier in ids.values():
            raise ArgumentError(
                f"material {material!r}: its id would be {identifier!r}, like another's; rename it"
            )
        ids[material] = identifier
    return ids


_ENDS = ("low_MPa", "high_MPa")


def _material_document(material: Material, fit: MaterialFit) -> dict[str, Any]:
    return {
        **_these(material, "id", "coordinate"),
        "specimens": fit.characteristics.n,
        **_these(material, "deformation", "elongation_at_break", "modulus_log_sd"),
        "law": {"model": material.law.model, **_plain(material.law.parameters)},
        "law_low": _plain(fit.uncertainty.law_low),
        "law_high": _plain(fit.uncertainty.law_high),
        "interval_level": fit.uncertainty.level,
        "interval_basis": fit.uncertainty.basis,
        "secants": [
            {"strain": one.strain, "secant_MPa": one.value_MPa}
            | (_these(one, *_ENDS) if np.isfinite(one.high_MPa) else dict.fromkeys(_ENDS))
            for one in fit.secants
        ],
        "reason": fit.choice.reason,
        "candidates": [
            {
                "law": one.fit.name,
                "chosen": one is fit.choice.chosen,
                "parameters": one.fit.parameter_count,
                "held_out_error": one.held_out_error,
                **_these(one.fit, "r2", "adjusted_r2", "nrmse"),
                "stable": one.unstable_strain is None,
                "unstable_at_strain": one.unstable_strain,
                "determined": one.determined,
                **_these(one.fit, "starts", "starts_converged", "starts_agreeing"),
                **_these(one.fit, "gradient", "at_bound"),
            }
            for one in fit.choice.candidates
        ],
    }


def _plain(parameters: Mapping[str, Sequence[float]]) -> dict[str, list[float | None]]:
    """Return lists of figures; an open end of an interval is null."""
    return {k: [v if np.isfinite(v) else None for v in vs] for k, vs in parameters.items()}


# ------------------------------------------------------------------------------------------------
# What warming multiplies a material's stress by, from tests at two temperatures or more.


_USUAL_C = 23.0
"""Of the same standard: of two temperatures with as many specimens the palette's is the nearer."""

_STRAINS = np.linspace(0.1, 1.0, 19)
"""Shares of the strain that all specimens reach, at which stresses are compared. Numerical."""


def _at_one_temperature(study: Study) -> tuple[Study, dict[str, tuple[Curve, ...]]]:
    """Return a study's tests at one temperature, and those of the same materials at others.

    The one is that of most specimens. A material that was not tested there keeps what it has. In
    other modes those go that are at another temperature than the material's in tension.
    """
    told = _temperatures(study)
    every = itertools.chain.from_iterable(study.groups.values())
    used = [told[curve.specimen] for curve in every if curve.specimen in told]
    own = max(
        used,
        key=lambda t: (sum(abs(v - t) <= SAME_K for v in used), -abs(t - _USUAL_C)),
        default=_USUAL_C,
    )

    def far_from(at: float, curves: Sequence[Curve]) -> tuple[Curve, ...]:
        return tuple(c for c in curves if abs(told.get(c.specimen, at) - at) > SAME_K)

    groups, others = dict(study.groups), {}
    modes, notes = dict(study.other_modes), list(study.notes)
    for material, curves in study.groups.items():
        far = far_from(own, curves)
        if 0 < len(far) < len(curves):
            groups[material] = tuple(c for c in curves if c not in far)
            others[material] = far
        # Nothing is far from nan, of which tension tells no temperature.
        at = next((told[c.specimen] for c in groups[material] if c.specimen in told), np.nan)
        loaded, unlike = modes.get(material, ()), f"where tension of {material} was at {at:g}"
        far = far_from(at, loaded)
        modes[material] = tuple(c for c in loaded if c not in far)
        for name in (c.specimen for c in far):
            notes.append(
                Caution(f"specimen {name}: tested at {told[name]:g} degC, {unlike}; left out")
            )
    return replace(study, groups=groups, other_modes=modes, notes=tuple(notes)), others


def _temperatures(study: Study) -> dict[str, float]:
    rows = study.specimens.items()
    return {name: row.temperature_C for name, row in rows if row.temperature_C is not None}


def _temperature_table(
    study: Study,
    fits: Mapping[str, MaterialFit],
    others: Mapping[str, Sequence[Curve]],
    coordinate: Mapping[str, float],
) -> Temperature | None:
    """Return the factor of every material tested at two temperatures; None if there is none.

    ln(stress), the mean over strains that all of its specimens reach, is straight in the
    temperature, by least squares; ln(factor) is its slope times the difference. Its deviation is
    that of the specimens about the line, widened by Student's t; `ASSUMED_LOG_SD` of two.
    """
    told, rows = _temperatures(study), []
    for material, far in others.items():
        elastic = fits[material].characteristics.deformation.kind == "elastic"
        borne = loading(far) if elastic else [toe_compensated(curve) for curve in far]
        curves = [c for c in (*fits[material].curves, *borne) if c.specimen in told]
        at = np.array([told[curve.specimen] for curve in curves])
        if np.ptp(at) <= SAME_K:
            continue  # those at the palette's own temperature do not state it
        strain = _STRAINS * min(float(curve.strain.max()) for curve in curves)
        slope, sd = _line(at, np.array([_level(curve, strain) for curve in curves]))
        span = float(np.ptp(at))
        rows.append((coordinate[material], at.min(), at.max(), np.exp(slope * span), sd * span))
    return Temperature(*map(tuple, np.array(sorted(rows)).T.tolist())) if rows else None


def _level(curve: Curve, strain: FloatArray) -> float:
    """Return the mean ln(stress) at strains."""
    least = RELATIVE_FLOOR * float(curve.stress_MPa.max())
    stress = np.interp(strain, curve.strain, curve.stress_MPa)
    return float(np.log(np.maximum(stress, least)).mean())


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return the slope of a line by least squares, and its standard deviation."""
    if len(x) == 2:
        return float(np.diff(y)[0] / np.diff(x)[0]), ASSUMED_LOG_SD * 2.0**0.5 / float(np.ptp(x))
    (slope, _), covariance = np.polyfit(x - x.mean(), y, 1, cov=True)
    return float(slope), widened(len(x) - 1) * float(covariance[0, 0]) ** 0.5


# ------------------------------------------------------------------------------------------------
# Named after what they hold; they are Tables 3.1, 3.2 and 4.1 of Hemleben's thesis for one's own
# tests. Numbers have nine significant digits; an empty cell means unknown, or an open end.


_COEFFICIENTS = tuple(f"c{number}" for number in range(1, 7))


def fit_tables(study: PaletteStudy) -> dict[str, bytes]:
    """Return the tables of a fit as CSV, by the name of their files.

    ``characteristics.csv`` is that of `Characterisation.csv`, ``laws.csv`` has a row for each
    parameter of each law, ``r2.csv`` the R2 of each law that was tried (the thesis' Table 4.1).
    Where `fit` ran Algorithm 1: ``coefficients.csv``, eq. 3.8 of each material;
    ``quadratics.csv``, its coefficients over m; ``goodness.csv``, R2 and errors of each way, also
    of what the other materials predict.

    Parameters
    ----------
    study
        What `planner.fit` returns.

    Returns
    -------
    dict of str to bytes
        The tables.

    Examples
    --------
    >>> from pathlib import Path  # doctest: +SKIP
    >>> tables = planner.fit_tables(planner.fit(["samples/tensile"]))  # doctest: +SKIP
    >>> Path("laws.csv").write_bytes(tables["laws.csv"])  # doctest: +SKIP
    """
    check_kind(study, PaletteStudy, "what `planner.fit` returns")
    fits = (study.fits[m.id] for m in study.palette.materials)
    found = Characterisation(tuple(fit.characteristics for fit in fits if not fit.compressed))
    tables = {"laws.csv": _laws(study), "r2.csv": _r2(study)}
    if study.quadratic is not None:
        tables["coefficients.csv"] = _coefficients(study.quadratic)
        tables["quadratics.csv"] = _quadratics(study.quadratic)
        tables["goodness.csv"] = _goodness(study.quadratic)
    return {"characteristics.csv": found.csv()} | {k: _table([*rows]) for k, rows in tables.items()}


def _laws(study: PaletteStudy) -> Iterator[_Row]:
    figures = ("level", "specimens", "r2", "nrmse", "held_out_error")
    for one in study.palette.materials:
        known = study.fits[one.id].uncertainty
        own = {"material": one.id, "coordinate": one.coordinate, "law": one.law.model}
        for symbol, values in one.law.parameters.items():
            ends = zip(values, known.law_low[symbol], known.law_high[symbol], strict=True)
            for term, (value, low, high) in enumerate(ends, start=1):
                row = {"parameter": symbol, "term": term, "value": value, "low": low, "high": high}
                yield own | row | _these(known, *figures)


def _r2(study: PaletteStudy) -> Iterator[_Row]:
    literal = {} if study.quadratic is None else {row.id: row for row in study.quadratic.rows}
    for material in study.palette.materials:
        fit = study.fits[material.id]
        row: _Row = {"material": material.id, "chosen": fit.chosen_name}
        row |= {c.fit.name: c.fit.r2 for c in fit.choice.candidates}
        row[fit.chosen_name] = fit.uncertainty.r2
        if material.id in literal:
            errors = literal[material.id].errors
            row |= {_KINDS[kind]: one.r2 for kind in ("own", "quadratics") if (one := errors[kind])}
        yield row


def _coefficients(found: QuadraticStudy) -> Iterator[_Row]:
    for row in found.rows:
        own = {"material": row.id, "coordinate": row.curve.coordinate}
        for name, c, half in zip(_COEFFICIENTS, row.fit.c, row.fit.half, strict=True):
            yield {**own, "coefficient": name, "value": c, "low": c - half, "high": c + half}


def _quadratics(found: QuadraticStudy) -> Iterator[_Row]:
    powers = ("q2", "q1", "q0")
    header = ("coefficient", *powers, *(f"{q}_through_coefficients" for q in powers))
    rows = zip(_COEFFICIENTS, found.quadratics.model.rows, found.through.rows, strict=True)
    for name, last, through in rows:
        yield dict(zip(header, (name, *last, *through), strict=True))


_KINDS = {
    "own": "eq_3_8", "quadratics": "quadratics", "law": "law",
    "quadratics_without": "quadratics_left_out", "mixtures_without": "mixtures_left_out",
}  # fmt: skip
"""Columns of what `QuadraticRow.errors` are of."""


def _goodness(found: QuadraticStudy) -> Iterator[_Row]:
    for row in found.rows:
        errors = {name: row.errors[kind] for kind, name in _KINDS.items()}
        yield {
            "material": row.id,
            "coordinate": row.curve.coordinate,
            **{f"r2_{name}": one and one.r2 for name, one in errors.items()},
            **{f"nrmse_{name}": one and one.nrmse for name, one in errors.items()},
            "stress_near_rest_quadratics_MPa": row.near_rest_MPa,
            "stress_near_rest_law_MPa": row.law_near_rest_MPa,
        }

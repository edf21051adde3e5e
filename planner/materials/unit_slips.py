"""Whether tests are in another unit than they say: against a palette, a ladder, replicates."""

import itertools
import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planner.errors import Caution, listed
from planner.formats.units import QUANTITIES, QUANTITY_UNITS, UnitOf, unit_near
from planner.materials.characterise import SECANT_STRAINS, characterise_curve
from planner.materials.laws import make_law, secant_modulus_MPa
from planner.materials.study import Study
from planner.numerics import FloatArray, IntArray, normal_quantile
from planner.palette import Material, Palette

__all__ = ["unit_slips"]


# ------------------------------------------------------------------------------------------------
# How far honest materials lie apart, in ln stiffness.
#
# Another lab's prints are softer or stiffer than a palette as a whole (age, machine, batch), in a
# way that changes smoothly along the ladder (temperature, rate), and each by itself. What is beyond
# all three together, apart from the others, and the factor between two units, is a slip.


_LAB_SD = math.log(2.0) / 1.96
"""Of a lab as a whole, and of what changes along the ladder: published measurements of one digital
material differ by up to a factor of 2, in 95 of 100."""

_ALONG = 0.5
"""Coordinate over which what changes along the ladder stays alike: half from softest to hardest
elastomer. Chosen: a warm lab softens the last two or three grades, not one alone."""

_OWN_SD = 0.25
"""Of one material beside its lab: some tens of per cent, a factor of 1.6 in 95 of 100."""

_SPECIMEN_SD = 0.09
"""Between specimens of one print: PolyJet elastomers have coefficients of variation of 1 to 9 %;
used where replicates tell less."""

_FALSE_ALARM = 1e-3
"""Share of honest studies that may be taken for a slip, shared out over all batches that there are.

With it and the next numbers, of 5000 simulated honest labs none is taken for a slip, and at most 1
in a hundred where materials scatter with heavy tails, one is off by a factor of 2, or a warm lab
softens the hardest by 3. Of batches in lbf 30 to 98 in a hundred are found (of the softest grade
alone 5), of those in kgf 78 to 98."""

_WARNED = 0.05
"""The same share for a warning. Of the honest labs above 0.1, 3, 8 and 8 in a hundred are warned;
of batches in lbf 83 to 99 (of the softest grade alone 38)."""

_APART = 0.4
"""Share of the shift that lies empty between a batch and the others; see above."""

_UNIT_REACH = 0.35
"""How far ln of a batch's shift may lie off a unit's factor: laws and conditions may be off by a
third."""

_REPLICATES_REACH = 0.25
"""ln: two specimens that scatter by 9 % differ by 0.13; twice that."""

_OUT_OF_ORDER = math.log(2.0)
"""ln by which a harder material may be softer than its softer neighbour: as `_LAB_SD`."""


@dataclass(frozen=True, slots=True)
class _Batch:
    """Materials that lie together off the others.

    Attributes
    ----------
    shift
        ln of their stiffness over the others'.
    sure
        Whether it is beyond what honest labs show, not only beyond what most do.
    """

    members: tuple[int, ...]
    shift: float
    sure: bool = True


def batch_apart(
    coordinate: FloatArray, log_ratio: FloatArray, variance: FloatArray
) -> _Batch | None:
    """Return the batch of materials whose stiffness is off as no honest lab's is, if there is one.

    All splits of the materials in the order of their ratio are tried, either side as the batch
    and all together; generalised least squares give the shift of each. The likeliest is returned
    if its shift is beyond honest differences (`_WARNED`; sure by `_FALSE_ALARM`), honest
    differences explain what is left (99 %), and nothing lies between it and the others (`_APART`).

    Parameters
    ----------
    log_ratio
        ln of measured over expected stiffness, shape (n,).
    variance
        Of each, from the palette's own uncertainty and the scatter of specimens.
    """
    from scipy.special import chdtri

    n = len(log_ratio)
    distance = np.subtract.outer(coordinate, coordinate) / _ALONG
    lab = _LAB_SD**2 * (1.0 + np.exp(-0.5 * distance**2))
    inverse = np.linalg.inv(lab + np.diag(variance + _OWN_SD**2))
    order = np.argsort(log_ratio, kind="stable")
    # Of two materials that differ nothing tells which is off.
    splits = range(1, n) if n > 2 else ()
    batches = [order, *(side for k in splits for side in (order[:k], order[k:]))]
    found: list[tuple[float, float, float, IntArray]] = []
    for members in batches:
        inside = np.zeros(n)
        inside[members] = 1.0
        precision = float(inside @ inverse @ inside)
        shift = float(inside @ inverse @ log_ratio) / precision
        rest = log_ratio - shift * inside
        found.append((float(rest @ inverse @ rest), shift, precision**-0.5, members))
    misfit, shift, sd, batch = min(found, key=lambda one: one[0])
    warned, sure = (
        normal_quantile(1.0 - share / (2.0**n - 1.0)) * sd for share in (_WARNED, _FALSE_ALARM)
    )
    if abs(shift) <= warned or (n > 1 and misfit > float(chdtri(n - 1, 0.01))):
        return None
    beyond = np.sign(shift) * log_ratio
    others = np.delete(beyond, batch)
    if len(others) and beyond[batch].min() - others.max() <= _APART * abs(shift):
        return None
    return _Batch(tuple(sorted(batch.tolist())), shift, abs(shift) > sure)


# ------------------------------------------------------------------------------------------------
# A study against a palette.


def unit_slips(
    study: Study, against: Palette | None, coordinate: Mapping[str, float]
) -> tuple[tuple[str, ...], tuple[Caution, ...]]:
    """Return where a unit seems taken for another, and where one may be but need not.

    Parameters
    ----------
    against
        The palette to compare materials with, by name.
    coordinate
        Of materials, where it is stated.
    """
    if slips := tuple(_among_replicates(study)):
        # A material's mean says nothing while its specimens are in two units.
        return slips, ()
    is_sure, said = _against_palette(study, against) if against else (False, "")
    if is_sure:
        return (said,), ()
    return _along_ladder(study, coordinate), (Caution(said),) if said else ()


def _against_palette(study: Study, palette: Palette) -> tuple[bool, str]:
    """Compare a study's elastic materials with those of a palette that have their names.

    Returns whether it is sure, and what is said, or "". A batch that is surely off by a factor of
    units while others agree is a finding, else a caution; if all are off, the palette may be of
    other prints, and it is a caution too. Rigid grades are left out: by where strain was measured,
    at the grips or on the specimen, their modulus may differ by as much as units do.
    """
    elastic = [m for m in palette.materials if m.deformation == "elastic"]
    named = {n.casefold(): m for m in elastic for n in (m.id, *m.aliases)}
    pulled = (name for name, curves in study.groups.items() if curves[0].mode == "uniaxial")
    if not (called := [name for name in pulled if name.casefold() in named]):
        return False, ""
    known = [named[name.casefold()] for name in called]
    coordinate = np.array([material.coordinate for material in known])
    ratios = np.array([_against(study, *one) for one in zip(called, known, strict=True)])
    stiffness, variance, elongation = ratios.T
    if (batch := batch_apart(coordinate, stiffness, variance)) is None:
        return False, ""
    at = list(batch.members)
    inside, others = [called[i] for i in at], np.delete(called, at).tolist()
    longer = float(elongation[at].mean() - (np.delete(elongation, at).mean() if others else 0.0))
    if (advice := _advice(study, inside, batch.shift, longer, reach=_UNIT_REACH)) is None:
        return False, ""
    of = _off(inside, batch.shift, 2)
    if not (others and batch.sure):
        return False, f"{of} the palette: {advice}, or --no-compare"
    agree = f"while {listed(others, 6)} {'is' if len(others) == 1 else 'are'} not"
    whole = f"{of} the palette {palette.name}, {agree}"
    return True, f"{whole}: {advice}, or --no-compare if they are right"


def _off(names: Sequence[str], shift: float, digits: int) -> str:
    way, verb = "above" if shift > 0.0 else "below", "is" if len(names) == 1 else "are"
    return f"{listed(names, 6)} {verb} {math.exp(abs(shift)):.{digits}g} times {way}"


def _against(study: Study, called: str, material: Material) -> tuple[float, float, float]:
    """Return ln of stiffness over the palette's, its variance, and ln of the strain at break."""
    curves = study.groups[called]
    strain = min(SECANT_STRAINS[0], 0.5 * min(float(c.strain[-1]) for c in curves))
    found = [characterise_curve(c, secant_strains=[strain]) for c in curves]
    logs = [math.log(c.secant_MPa[strain] or c.modulus_MPa) for c in found]
    expected = math.log(float(secant_modulus_MPa(make_law(material.law), strain)))
    scatter = max(_SPECIMEN_SD, float(np.std(logs, ddof=1)) if len(logs) > 1 else 0.0)
    variance = material.modulus_log_sd**2 + scatter**2 / len(logs)
    longest = float(np.mean([math.log(c.strain[-1]) for c in curves]))
    longer = longest - math.log(material.elongation_at_break)
    return float(np.mean(logs)) - expected, variance, longer


# ------------------------------------------------------------------------------------------------
# A ladder of materials whose coordinates are stated, and replicates of one material.


def _along_ladder(study: Study, coordinate: Mapping[str, float]) -> tuple[str, ...]:
    """Return where a material is far softer than one of a lower coordinate, and by which unit.

    The batch is the run of neighbours whose shift makes the ladder smoothest.
    """
    ordered = sorted((m for m in study.groups if m in coordinate), key=lambda m: coordinate[m])
    moduli = ([characterise_curve(curve).modulus_MPa for curve in study.groups[m]] for m in ordered)
    level = np.array([np.log(each).mean() for each in moduli])
    drops = -np.diff(level)
    if not len(drops) or drops.max() <= _OUT_OF_ORDER:
        return ()
    at = int(np.argmax(drops))
    said = (
        f"{ordered[at + 1]} is {math.exp(drops[at]):.2g} times softer than {ordered[at]}, whose "
        "coordinate is lower"
    )
    m = np.array([coordinate[material] for material in ordered])
    run = _smoothest(m, level) if len(ordered) > 3 else None
    inside = [ordered[i] for i in run.members] if run else []
    advice = run and _advice(study, inside, run.shift, 0.0, reach=_UNIT_REACH)
    return (f"{said}: {advice or 'check sizes, units and coordinates'}",)


def _smoothest(m: FloatArray, level: FloatArray) -> _Batch | None:
    """Return the run of neighbours, shifted, that leaves the least bends; None if still unordered.

    A bend is what a point lies off the line through its neighbours.
    """
    n, left = len(level), (m[2:] - m[1:-1]) / (m[2:] - m[:-2])

    def bends(values: FloatArray) -> FloatArray:
        return values[1:-1] - left * values[:-2] - (1.0 - left) * values[2:]

    found: list[tuple[float, int, _Batch]] = []
    for first, last in itertools.combinations(range(n + 1), 2):
        if 2 * (last - first) > n:
            continue
        inside = np.zeros(n)
        inside[first:last] = 1.0
        lever = bends(inside)
        shift = float(lever @ bends(level)) / float(lever @ lever)
        rest = level - shift * inside
        if np.all(np.diff(rest) > 0.0):
            batch = _Batch(tuple(range(first, last)), shift)
            found.append((float(np.sum(bends(rest) ** 2)), last - first, batch))
    return min(found, key=lambda one: one[:2])[2] if found else None


def _among_replicates(study: Study) -> Iterator[str]:
    """Say which specimens lie off most replicates by the factor between two units."""
    for material, curves in study.groups.items():
        found = [characterise_curve(c) for c in curves]
        level, longer = np.log([(c.modulus_MPa, c.elongation_at_break) for c in found]).T
        # Of two, either may be off; the one in the other unit is then for the user to say.
        middle = float(np.sort(level)[len(level) // 2])
        normal = np.abs(level - middle) < _REPLICATES_REACH
        far = np.flatnonzero(np.abs(level - middle) > math.log(2.0))
        if not 0 < 2 * len(far) <= len(found):
            continue
        shift = float(level[far].mean()) - middle
        length = float(longer[far].mean() - longer[normal].mean())
        names = [found[i].specimen for i in far]
        if advice := _advice(study, names, shift, length, reach=_REPLICATES_REACH):
            yield f"{material}: {_off(names, shift, 3)} the other specimens: {advice}"


# ------------------------------------------------------------------------------------------------
# Which unit was taken for which, in words and as an option.


def _advice(
    study: Study, names: Sequence[str], shift: float, longer: float, *, reach: float
) -> str | None:
    """Return which unit was taken for which, as a question with the option that corrects it.

    Parameters
    ----------
    names
        Specimens or materials that are off.
    shift, longer
        ln of their stiffness and of their strain at break over the right ones. A factor on the
        length's unit is in both, against each other.
    reach
        How far ln of the unit's factor may lie off.
    """
    curves = [c for name, group in study.groups.items() for c in group
              if name in names or c.specimen in names]  # fmt: skip
    factors = study.factors.get(curves[0].specimen, {})
    of_length = abs(longer + shift) < abs(longer)
    quantities = ("strain", "travel") if of_length else ("stress", "force")
    quantity = next((q for q in quantities if QUANTITIES[q][0] in factors), None)
    if quantity is None:
        return None
    column, kind = QUANTITIES[quantity]
    own, units = factors[column], QUANTITY_UNITS[kind]
    unit = unit_near(kind, math.log(own) + (shift if of_length else -shift), own, reach)
    if unit is None:
        return None
    stated = next(name for name, factor in units.items() if factor == own) or "fractions"
    option = shlex.quote(UnitOf(quantity, unit or "1", tuple(names)).text)
    # A section ten times too large is as near as kgf.
    sizes = ", or is a size wrong" if quantity == "force" else ""
    if unit in units:
        was = f"was {unit}" if unit else "were fractions"
        return f"{was} taken for {stated}{sizes}? Give --unit-of {option}"
    # No unit is so small: the numbers were multiplied on the way, as another unit's would be.
    other = unit_near(kind, 2.0 * math.log(own) - math.log(float(unit)), own)
    return f"was {stated} converted as if it were {other}{sizes}? Give --unit-of {option}"

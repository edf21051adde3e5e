"""From one material's specimens to its law: hyperelastic where it is elastic, else linear."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from planner.errors import ArgumentError
from planner.materials.characterise import (
    MaterialCharacteristics,
    characterise_material,
    toe_compensated,
)
from planner.materials.curve import Curve
from planner.materials.fit.intervals import Intervals, intervals
from planner.materials.fit.law_choice import Candidate, Choice, choose_law
from planner.materials.fit.law_fit import STARTS
from planner.materials.fit.sample import Weighting, sample_of
from planner.materials.fit.scatter import ASSUMED_LOG_SD, Scatter, scatter_of_fit, scatter_of_moduli
from planner.materials.fit.separable import SeparableLaw
from planner.palette import LawParameters, Uncertainty

__all__ = ["MaterialFit", "fit_material"]


@dataclass(frozen=True, slots=True, eq=False)
class MaterialFit:
    """What a palette says of one material, and why.

    Attributes
    ----------
    choice
        The laws that were tried; None for a plastic material, which gets Young's modulus alone.
    notes
        What the user should know, one sentence each.
    """

    material: str
    characteristics: MaterialCharacteristics
    law: LawParameters
    uncertainty: Uncertainty
    scatter: Scatter
    choice: Choice | None
    notes: tuple[str, ...]

    @property
    def elongation_at_break(self) -> float:
        """Mean strain at break of the specimens."""
        return self.characteristics.spreads["elongation_at_break"].mean


def fit_material(
    material: str,
    curves: Sequence[Curve],
    laws: Sequence[SeparableLaw],
    *,
    weighting: Weighting = "relative",
    starts: int = STARTS,
    level: float = 0.95,
) -> MaterialFit:
    """Characterise a material's specimens, fit the laws, and choose one.

    Strains count from the end of the toe, and the curve up to its largest stress is fitted.

    Raises
    ------
    ArgumentError
        No law is stable over the working range, which goes to the mean elongation at break.
    FileError
        A curve that no figure can rest on.
    """
    if not 0.5 <= level < 1.0:
        raise ArgumentError(f"level {level:g}: it must be at least 0.5 and below 1, as 0.95")
    found = characterise_material(material, curves)
    notes = [note for c in found.specimens for note in c.notes if "not shifted" not in note]
    if found.deformation.kind == "plastic":
        law, uncertainty, scatter = _linear(found, level)
        return MaterialFit(material, found, law, uncertainty, scatter, None, tuple(notes))
    sample = sample_of([_loading(curve) for curve in curves], weighting=weighting)
    working = found.spreads["elongation_at_break"].mean
    try:
        choice = choose_law(laws, sample, working, starts=starts)
    except ArgumentError as error:
        raise ArgumentError(f"material {material}: {error}") from error
    chosen = choice.chosen
    if chosen is None:
        falls = "; ".join(
            f"the stress of {c.fit.name} falls at strain {c.stability.strain:.3g}"
            for c in choice.candidates
            if c.stability.strain is not None
        )
        raise ArgumentError(
            f"material {material}: no law is stable up to its elongation at break, {working:.3g}, "
            f"and a tenth beyond ({falls}); try --law all"
        )
    notes.extend(_doubts(material, chosen))
    ends = intervals(chosen.fit, sample, level)
    return MaterialFit(
        material,
        found,
        chosen.fit.parameters,
        _uncertainty(chosen, ends, found.n, choice.scheme),
        scatter_of_fit(chosen.fit, sample),
        choice,
        tuple(notes),
    )


def _loading(curve: Curve) -> Curve:
    """Return the curve from the end of its toe to its largest stress."""
    curve = toe_compensated(curve)
    stop = int(np.argmax(curve.stress_MPa)) + 1
    return replace(
        curve,
        strain=curve.strain[:stop],
        stress_MPa=curve.stress_MPa[:stop],
        time_s=None if curve.time_s is None else curve.time_s[:stop],
    )


def _doubts(material: str, chosen: Candidate) -> list[str]:
    convergence = chosen.fit.convergence
    notes = []
    if not convergence.ok:
        notes.append(
            f"material {material}: {convergence.agreeing} of {convergence.starts} starts reach the "
            f"best {chosen.fit.name}, whose gradient is {convergence.gradient:.1e}; a better one "
            "may exist: try more --starts"
        )
    if convergence.at_bound:
        notes.append(
            f"material {material}: a parameter of {chosen.fit.name} lies at its bound, so that "
            "the tests do not determine it"
        )
    return notes


def _uncertainty(chosen: Candidate, ends: Intervals, count: int, scheme: str) -> Uncertainty:
    law = chosen.fit.law
    by_profile = ends.profiled.astype(np.float64)
    flags = law.parameters(by_profile[: law.nonlinear], by_profile[law.nonlinear :])
    kinds = {
        kind: ", ".join(symbol for symbol, values in flags.items() if values[0] == flag)
        for kind, flag in (("profile", 1.0), ("Student's t", 0.0))
    }
    ways = " and ".join(f"{kind} ({symbols})" for kind, symbols in kinds.items() if symbols)
    if ends.independent_points is None:
        scatter = f"scatter between {count} specimens"
    else:
        scatter = (
            f"one specimen as {ends.independent_points:.3g} independent points, without the "
            "scatter between specimens"
        )
    return Uncertainty(
        specimens=count,
        level=ends.level,
        law_low=_rounded(law.parameters(ends.a[:, 0], ends.c[:, 0])),
        law_high=_rounded(law.parameters(ends.a[:, 1], ends.c[:, 1])),
        basis=f"{ways}; {scatter}; held out: {scheme}",
        r2=chosen.fit.r2,
        nrmse=chosen.fit.nrmse,
        held_out_error=float(f"{chosen.held_out_error:.3g}"),
    )


def _rounded(parameters: dict[str, tuple[float, ...]]) -> dict[str, tuple[float, ...]]:
    """Round ends of intervals, which are found to 2 %, to four digits."""
    return {k: tuple(float(f"{v:.4g}") for v in values) for k, values in parameters.items()}


def _linear(
    found: MaterialCharacteristics, level: float
) -> tuple[LawParameters, Uncertainty, Scatter]:
    """Take Young's modulus: the specimens' geometric mean, with Student's interval of its ln."""
    from scipy.stats import t as student

    moduli = [c.modulus_MPa for c in found.specimens]
    scatter = scatter_of_moduli(moduli)
    mean = float(np.log(moduli).mean())
    freedom = found.n - 1 if found.n > 1 else np.inf
    half = float(student.ppf(0.5 + 0.5 * level, freedom)) * scatter.between / np.sqrt(found.n)
    low, mean, high = (float(np.exp(v)) for v in (mean - half, mean, mean + half))
    uncertainty = Uncertainty(
        specimens=found.n,
        level=level,
        law_low={"modulus_MPa": (low,)},
        law_high={"modulus_MPa": (high,)},
        basis=f"Student's t; scatter between {found.n} specimens"
        if found.n > 1
        else f"one specimen, {100 * ASSUMED_LOG_SD:g} % scatter between specimens assumed",
    )
    parameters = MappingProxyType({"modulus_MPa": (mean,)})
    return LawParameters("linear", parameters), uncertainty, scatter

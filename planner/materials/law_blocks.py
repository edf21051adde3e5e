"""A material's law as a block to paste into the input of Abaqus, Ansys or FEBio."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from planner.errors import ArgumentError, did_you_mean
from planner.materials.hardening import hardening
from planner.materials.laws import make_law
from planner.materials.marlow import POISSON
from planner.numerics import FloatArray
from planner.palette import Material

__all__ = ["PROGRAMS", "law_block"]


# The programs write Ogden's energy each in its own way, of stretches free of volume change:
#
#     planner, Ansys   sum mu / alpha (l1^alpha + ...)         G = sum mu alpha / 2
#     Abaqus           sum 2 mu / alpha^2 (l1^alpha + ...)     G = sum mu
#     FEBio            sum c / m^2 (l1^m + ...)                G = sum c / 2
#
# and the volume's as (J - 1)^2 / D (Abaqus), / d (Ansys), k / 2 (ln J)^2 or so (FEBio). Palettes'
# laws are incompressible; with Poisson's ratio nu the coefficients are times 1.5 / (1 + nu), so
# that Young's modulus at rest stays.

_NEARLY = 1.5 / (1.0 + POISSON)
_CURVE_POINTS = 60


def _ogden(material: Material) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Return mu and alpha of a law of Ogden's, or of neo-Hooke's as one."""
    found = material.law.parameters
    if material.law.model == "neo-hookean":
        return (found["mu_MPa"][0] * _NEARLY,), (2.0,)
    if material.law.model != "ogden":
        return None
    return tuple(mu * _NEARLY for mu in found["mu_MPa"]), found["alpha"]


def _bulk_MPa(material: Material) -> float:
    at_rest = float(make_law(material.law).tangent_MPa(1.0))
    return at_rest / (3.0 * (1.0 - 2.0 * POISSON))


def _curve(material: Material) -> FloatArray:
    """Return engineering strain and nominal stress up to the break, closer at rest."""
    strain = material.elongation_at_break * np.linspace(0.0, 1.0, _CURVE_POINTS + 1)[1:] ** 2
    return np.stack([strain, make_law(material.law).nominal_stress_MPa(1.0 + strain)], axis=1)


def _flow(material: Material) -> FloatArray:
    """Return true stress and plastic strain; none of a law that stays straight."""
    if material.law.model == "linear":
        return np.empty((0, 2))
    at_rest = float(make_law(material.law).tangent_MPa(1.0))
    strain, stress = _curve(material).T
    rows = hardening(strain, stress, at_rest, POISSON)
    return np.empty((0, 2)) if rows is None else rows


def _listed(*values: float) -> str:
    return ", ".join(f"{value:.9g}" for value in values)


def _abaqus(material: Material) -> Iterator[str]:
    terms, d = _ogden(material), 2.0 / _bulk_MPa(material)
    yield f"*MATERIAL, NAME={material.id}"
    if terms is not None:
        pairs = [v for mu, alpha in zip(*terms, strict=True) for v in (0.5 * mu * alpha, alpha)]
        values = [*pairs, d, *[0.0] * (len(terms[0]) - 1)]
        yield f"*HYPERELASTIC, OGDEN, N={len(terms[0])}"
        yield from (_listed(*values[k : k + 8]) for k in range(0, len(values), 8))
    elif material.law.model == "yeoh":
        yield "*HYPERELASTIC, YEOH"
        yield _listed(*(c * _NEARLY for c in material.law.parameters["c_MPa"]), d, 0.0, 0.0)
    elif material.deformation == "elastic":
        yield f"*HYPERELASTIC, MARLOW, POISSON={POISSON:g}"
        yield "*UNIAXIAL TEST DATA"
        yield from (_listed(stress, strain) for strain, stress in _curve(material).tolist())
    else:
        yield "*ELASTIC"
        yield _listed(float(make_law(material.law).tangent_MPa(1.0)), POISSON)
        rows = _flow(material).tolist()
        yield from ("*PLASTIC", *(_listed(*row) for row in rows)) if rows else ()
    yield "*DENSITY"
    yield _listed(1e-9 * material.density_g_cm3)


def _ansys(material: Material) -> Iterator[str]:
    terms, d = _ogden(material), 2.0 / _bulk_MPa(material)
    values: list[float] = []
    if terms is not None:
        yield f"TB,HYPER,1,1,{len(terms[0])},OGDEN"
        values = [v for pair in zip(*terms, strict=True) for v in pair]
        values += [d, *[0.0] * (len(terms[0]) - 1)]
    elif material.law.model == "yeoh":
        yield "TB,HYPER,1,1,3,YEOH"
        values = [*(c * _NEARLY for c in material.law.parameters["c_MPa"]), d, 0.0, 0.0]
    elif material.law.model in ("linear", "yielding"):
        yield f"MP,EX,1,{float(make_law(material.law).tangent_MPa(1.0)):.9g}"
        yield f"MP,PRXY,1,{POISSON:g}"
        rows = _flow(material).tolist()
        yield from (f"TB,PLASTIC,1,1,{len(rows)},MISO",) if rows else ()
        yield from (f"TBPT,DEFI,{strain:.9g},{stress:.9g}" for stress, strain in rows)
    else:
        raise _no_block(material, "Ansys")
    for k in range(0, len(values), 6):
        yield f"TBDATA,{k + 1},{_listed(*values[k : k + 6]).replace(' ', '')}"
    yield f"MP,DENS,1,{1e-9 * material.density_g_cm3:.9g}"


def _febio(material: Material) -> Iterator[str]:
    terms = _ogden(material)
    if terms is None and material.law.model != "linear":
        raise _no_block(material, "FEBio")
    kind = "Ogden" if terms is not None else "neo-Hookean"
    yield f'<material id="1" name="{material.id}" type="{kind}">'
    yield f"  <density>{1e-9 * material.density_g_cm3:.9g}</density>"
    if terms is None:
        yield f"  <E>{float(make_law(material.law).tangent_MPa(1.0)):.9g}</E>"
        yield f"  <v>{POISSON:g}</v>"
    else:
        for number, (mu, alpha) in enumerate(zip(*terms, strict=True), start=1):
            yield f"  <c{number}>{mu * alpha:.9g}</c{number}>"
            yield f"  <m{number}>{alpha:.9g}</m{number}>"
        yield f"  <k>{_bulk_MPa(material):.9g}</k>"
    yield "</material>"


def _no_block(material: Material, program: str) -> ArgumentError:
    return ArgumentError(
        f"material {material.id}: {program} has no law of its own like {material.law.model}; take "
        "--as abaqus (its curve), or a law that fits it: planner fit --law ogden"
    )


PROGRAMS: Mapping[str, tuple[Callable[[Material], Iterator[str]], str, str]] = {
    "abaqus": (_abaqus, "** ", ""), "ansys": (_ansys, "! ", ""), "febio": (_febio, "<!-- ", " -->"),
}  # fmt: skip


def law_block(material: Material, program: str) -> str:
    """Return a material's law as lines of a program's input: mm, N, MPa, t.

    Parameters
    ----------
    material
        Of a palette.
    program
        ``abaqus``, ``ansys`` or ``febio``.

    Returns
    -------
    str
        With a comment on top: of which law, and up to where.

    Raises
    ------
    ArgumentError
        Another program, or one that has no such law.

    Examples
    --------
    >>> tango = planner.list_materials().palette.resolve("Tango")  # doctest: +SKIP
    >>> print(planner.law_block(tango, "abaqus"))  # doctest: +SKIP
    """
    if program not in PROGRAMS:
        hint = did_you_mean(program, PROGRAMS)
        raise ArgumentError(f"program {program!r}: {hint}choose one of {', '.join(PROGRAMS)}")
    block, begin, end = PROGRAMS[program]
    known = (
        f"{material.id}: {material.law.model} law of the palette, mm, N, MPa, t; Poisson's ratio "
        f"{POISSON:g}; to its break at strain {material.elongation_at_break:g}"
    )
    if material.law.model == "yielding" and material.deformation == "plastic":
        known += "" if len(_flow(material)) else "; straight: its true stress does not bend over"
    return "\n".join([f"{begin}{known}{end}", *block(material)]) + "\n"

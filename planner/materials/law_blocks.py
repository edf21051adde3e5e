"""Laws of other programs: blocks to paste, an elastic-plastic curve."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from planner.errors import ArgumentError, as_count, check_kind, check_known
from planner.materials.laws import make_law
from planner.materials.marlow import POISSON
from planner.numerics import FloatArray
from planner.palette import Material

__all__ = ["hardening", "law_block"]


# ------------------------------------------------------------------------------------------------
# A material's law as a block to paste into the input of Abaqus, Ansys or FEBio.


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


def _coefficients(material: Material, of: Callable[[float, float], float]) -> list[float]:
    """Return those of Ogden's law, `of` mu and alpha beside alpha, or of Yeoh's; none of others.

    Behind them stand those of the volume.
    """
    terms, d = _ogden(material), 2.0 / _bulk_MPa(material)
    if terms is not None:
        pairs = [v for mu, alpha in zip(*terms, strict=True) for v in (of(mu, alpha), alpha)]
        return [*pairs, d, *[0.0] * (len(terms[0]) - 1)]
    if material.law.model == "yeoh":
        return [*(c * _NEARLY for c in material.law.parameters["c_MPa"]), d, 0.0, 0.0]
    return []


def _at_rest_MPa(material: Material) -> float:
    return float(make_law(material.law).tangent_MPa(1.0))


def _bulk_MPa(material: Material) -> float:
    return _at_rest_MPa(material) / (3.0 * (1.0 - 2.0 * POISSON))


def _curve(material: Material) -> FloatArray:
    """Return engineering strain and nominal stress up to the break, closer at rest."""
    strain = material.elongation_at_break * np.linspace(0.0, 1.0, _CURVE_POINTS + 1)[1:] ** 2
    return np.stack([strain, make_law(material.law).nominal_stress_MPa(1.0 + strain)], axis=1)


def _flow(material: Material) -> FloatArray:
    """Return true stress and plastic strain; none of a law that stays straight."""
    (strain, stress), bends = _curve(material).T, material.law.model != "linear"
    rows = hardening(strain, stress, _at_rest_MPa(material)) if bends else None
    return np.empty((0, 2)) if rows is None else rows


def _listed(*values: float) -> str:
    return ", ".join(f"{value:.9g}" for value in values)


def _abaqus(material: Material, _: int) -> Iterator[str]:
    values = _coefficients(material, lambda mu, alpha: 0.5 * mu * alpha)
    yield f"*MATERIAL, NAME={material.id}"
    if values:
        yeoh = material.law.model == "yeoh"
        yield f"*HYPERELASTIC, {'YEOH' if yeoh else f'OGDEN, N={len(values) // 3}'}"
        yield from (_listed(*values[k : k + 8]) for k in range(0, len(values), 8))
    elif material.deformation == "elastic":
        yield f"*HYPERELASTIC, MARLOW, POISSON={POISSON:g}"
        yield "*UNIAXIAL TEST DATA"
        yield from (_listed(stress, strain) for strain, stress in _curve(material).tolist())
    else:
        yield "*ELASTIC"
        yield _listed(_at_rest_MPa(material), POISSON)
        rows = _flow(material).tolist()
        yield from ("*PLASTIC", *(_listed(*row) for row in rows)) if rows else ()
    if material.density_g_cm3 is not None:
        yield "*DENSITY"
        yield _listed(1e-9 * material.density_g_cm3)


def _ansys(material: Material, number: int) -> Iterator[str]:
    values = _coefficients(material, lambda mu, alpha: mu)
    if material.law.model == "yeoh":
        yield f"TB,HYPER,{number},1,3,YEOH"
    elif values:
        yield f"TB,HYPER,{number},1,{len(values) // 3},OGDEN"
    elif material.law.model in ("linear", "yielding"):
        yield f"MP,EX,{number},{_at_rest_MPa(material):.9g}"
        yield f"MP,PRXY,{number},{POISSON:g}"
        rows = _flow(material).tolist()
        yield from (f"TB,PLASTIC,{number},1,{len(rows)},MISO",) if rows else ()
        yield from (f"TBPT,DEFI,{strain:.9g},{stress:.9g}" for stress, strain in rows)
    else:
        raise _no_block(material, "Ansys")
    for k in range(0, len(values), 6):
        yield f"TBDATA,{k + 1},{_listed(*values[k : k + 6]).replace(' ', '')}"
    if material.density_g_cm3 is not None:
        yield f"MP,DENS,{number},{1e-9 * material.density_g_cm3:.9g}"


def _febio(material: Material, number: int) -> Iterator[str]:
    terms = _ogden(material)
    if terms is None and material.law.model != "linear":
        raise _no_block(material, "FEBio")
    kind = "Ogden" if terms is not None else "neo-Hookean"
    yield f'<material id="{number}" name="{material.id}" type="{kind}">'
    if material.density_g_cm3 is not None:
        yield f"  <density>{1e-9 * material.density_g_cm3:.9g}</density>"
    if terms is None:
        yield f"  <E>{_at_rest_MPa(material):.9g}</E>"
        yield f"  <v>{POISSON:g}</v>"
    else:
        for k, (mu, alpha) in enumerate(zip(*terms, strict=True), start=1):
            yield f"  <c{k}>{mu * alpha:.9g}</c{k}>"
            yield f"  <m{k}>{alpha:.9g}</m{k}>"
        yield f"  <k>{_bulk_MPa(material):.9g}</k>"
    yield "</material>"


def _no_block(material: Material, program: str) -> ArgumentError:
    return ArgumentError(
        f"material {material.id}: {program} has no law of its own like {material.law.model}; take "
        "--as abaqus (its curve), or a law that fits it: planner fit --law ogden"
    )


_PROGRAMS: Mapping[str, tuple[Callable[[Material, int], Iterator[str]], str, str]] = {
    "abaqus": (_abaqus, "** ", ""), "ansys": (_ansys, "! ", ""), "febio": (_febio, "<!-- ", " -->"),
}  # fmt: skip


def law_block(material: Material, program: str, number: int = 1) -> str:
    """Return a material's law as lines of a program's input: mm, N, MPa, t.

    Parameters
    ----------
    material
        Of a palette.
    program
        ``abaqus``, ``ansys`` or ``febio``.
    number
        The material's in a model of several; Abaqus knows it by its name.

    Returns
    -------
    str
        With a comment on top: of which law, and up to where.

    Raises
    ------
    ArgumentError
        No material, another program, or one that has no such law.

    Examples
    --------
    >>> tango = planner.list_materials().palette.resolve("Tango")  # doctest: +SKIP
    >>> print(planner.law_block(tango, "abaqus"))  # doctest: +SKIP
    """
    check_kind(material, Material, "a Material, as `Palette.resolve` returns")
    number = as_count(number, "`number`", 99_999_999)
    check_known(program, _PROGRAMS, f"program {program!r}: {{}}choose one of")
    block, begin, end = _PROGRAMS[program]
    until = f"to its break at strain {material.elongation_at_break:g}"
    may_flow = material.deformation == "plastic" and material.law.model in ("linear", "yielding")
    if may_flow and not len(_flow(material)):
        # E ln(l) / l, of a program that takes the logarithmic strain, against E (l - 1).
        until = "for small strains: straight in nominal stress, some 5 % off at a strain of 0.03"
    known = (
        f"{material.id}: {material.law.model} law of the palette, mm, N, MPa, t; Poisson's ratio "
        f"{POISSON:g}; {until}"
    )
    return "\n".join([f"{begin}{known}{end}", *block(material, number)]) + "\n"


# ------------------------------------------------------------------------------------------------
# A tensile curve that bends over as an elastic-plastic law that hardens, for solvers.


# Solvers without Marlow's law have J2 plasticity of large strains (J. C. Simo, Comput. Methods
# Appl. Mech. Eng. 66 (1988) 199): with the elastic left Cauchy-Green tensor b, its volume taken
# out, tau = mu dev(b), and b follows the motion less the plastic flow along dev(b). In a tensile
# test with t = tr(b), q = tau / mu and the logarithmic strain h, its volume taken out,
#
#     dt = 2 q dh,   dq = (t + q) dh - t da,   a the plastic strain,
#
# so that a curve of stress fixes the plastic strain at each stress, whatever its form. While the
# load grows, such a law is the curve itself; unloading it differs.

_STEPS = 4000

_NOTHING = 1e-5
"""Numerical: a plastic strain that no test shows; below it the curve is elastic."""


def hardening(strain: FloatArray, stress_MPa: FloatArray, modulus_MPa: float) -> FloatArray | None:
    """Return true stress in MPa and plastic strain of a tensile curve, (n, 2), the first 0.

    Parameters
    ----------
    strain, stress_MPa : (n,)
        Engineering strains, rising from above 0, and nominal stresses.
    modulus_MPa
        At rest, where Poisson's ratio is `POISSON`.

    Returns
    -------
    ndarray or None
        None of a curve that is nowhere softer than the elastic law, or stiffens faster.
    """
    e = float(strain[-1]) * np.linspace(0.0, 1.0, _STEPS + 1) ** 2
    first = np.concatenate([[0.0], strain])
    tau = (1.0 + e) * np.interp(e, first, np.concatenate([[0.0], stress_MPa]))
    mu = modulus_MPa / (2.0 * (1.0 + POISSON))
    bulk = modulus_MPa / (3.0 * (1.0 - 2.0 * POISSON))
    q, steps = tau / mu, np.diff(np.log1p(e) - tau / (9.0 * bulk))
    middle = 0.5 * (q[1:] + q[:-1])
    t = 3.0 + np.cumsum(2.0 * middle * steps) - middle * steps
    plastic = np.cumsum((1.0 + middle / t) * steps - np.diff(q) / t)
    rows = np.stack([(1.0 + strain) * stress_MPa, np.interp(strain, e[1:], plastic)], axis=1)
    elastic = int(np.argmax(rows[:, 1] > _NOTHING)) - 1
    rows = rows[max(elastic, 0) :]
    rows[0, 1] = 0.0
    if not (np.diff(rows, axis=0) > 0.0).all():
        return None
    # A sheet stretched in two directions flows twice as far as a bar before it is as long.
    last = rows[-1] + (rows[-1] - rows[-2]) * rows[-1, 1] / (rows[-1, 1] - rows[-2, 1])
    return np.vstack([rows, last])

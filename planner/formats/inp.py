"""INP, what Abaqus and CalculiX read, written: hexahedra, sets, rubber-like laws, one step."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planner.numerics import FloatArray, IntArray

__all__ = ["InpMaterial", "InpModel", "encode_inp"]


Solver = Literal["abaqus", "calculix"]

_PER_LINE = 16  # entries that a line may have in either program

_GRAVITY_MM_S2 = 9806.65


@dataclass(frozen=True, eq=False)
class InpMaterial:
    """A material and the elements made of it.

    Attributes
    ----------
    name
        Letters, digits, ``-`` and ``_``, the first a letter.
    remark
        What a reader of the file should know of it.
    elements : (n,)
        Counted from 0.
    curve : (k, 2)
        Engineering strain and nominal stress in MPa of a tensile test, for Abaqus.
    modulus_MPa, poisson
        At rest.
    yeoh_MPa
        C10, C20, C30, for CalculiX.
    hardening : (k, 2)
        True stress in MPa and plastic strain, for CalculiX where there is no Yeoh law.
    density_g_cm3
        None where it is not known.
    """

    name: str
    remark: str
    elements: IntArray
    curve: FloatArray
    modulus_MPa: float
    poisson: float
    yeoh_MPa: tuple[float, float, float] | None = None
    hardening: FloatArray | None = None
    density_g_cm3: float | None = None


_Displacement = tuple[float | None, float | None, float | None]
"""In mm; None where it is free."""


@dataclass(frozen=True, eq=False)
class InpModel:
    """What an INP file says; nodes, elements and faces are counted from 0.

    Attributes
    ----------
    remarks
        Lines at the top.
    nodes : (n, 20)
        In the order of C3D20.
    node_sets
        By name.
    held
        By name: nodes and their displacement.
    forces_N
        By name: nodes and forces, (k,) and (k, 3).
    pressures_MPa
        By name: elements and their faces 0 to 5, (k, 2), and the pressure.
    gravity
        Unit vector.
    """

    remarks: Sequence[str]
    node_mm: FloatArray
    nodes: NDArray[np.int64]
    materials: Sequence[InpMaterial]
    node_sets: Mapping[str, IntArray]
    held: Mapping[str, tuple[IntArray, _Displacement]] = field(default_factory=dict)
    forces_N: Mapping[str, tuple[IntArray, FloatArray]] = field(default_factory=dict)
    pressures_MPa: Mapping[str, tuple[IntArray, float]] = field(default_factory=dict)
    gravity: tuple[float, float, float] | None = None


def encode_inp(model: InpModel, solver: Solver) -> bytes:
    """Return the bytes of a file for one of the two programs: mm, N, MPa, t, s."""
    return ("\n".join(_lines(model, solver)) + "\n").encode("ascii", "replace")


def _lines(model: InpModel, solver: Solver) -> Iterator[str]:
    yield "*HEADING"
    yield f"{model.remarks[0]}"
    yield from (f"** {line}" for line in model.remarks[1:])
    yield "** units: mm, N, MPa, t, s"
    yield "*NODE, NSET=NALL"
    for number, (x, y, z) in enumerate((model.node_mm + 0.0).tolist(), start=1):
        yield f"{number}, {x:.9g}, {y:.9g}, {z:.9g}"
    kind = "C3D20RH" if solver == "abaqus" else "C3D20R"
    for material in model.materials:
        yield f"*ELEMENT, TYPE={kind}, ELSET={material.name}"
        listed = np.column_stack([material.elements, model.nodes[material.elements]]) + 1
        for row in listed.tolist():
            yield ", ".join(map(str, row[:_PER_LINE])) + ","
            yield ", ".join(map(str, row[_PER_LINE:]))
    yield "*ELSET, ELSET=EALL"
    yield from (material.name for material in model.materials)
    held = {name: nodes for name, (nodes, _) in model.held.items()}
    for name, nodes in {**model.node_sets, **held}.items():
        yield f"*NSET, NSET={name}"
        yield from _listed(nodes)
    for material in model.materials:
        yield from _material(material, solver)
    for name, (faces, _) in model.pressures_MPa.items():
        for face in np.unique(faces[:, 1]).tolist():
            yield f"*ELSET, ELSET={name}_S{face + 1}"
            yield from _listed(faces[faces[:, 1] == face, 0])
    if model.held or model.forces_N or model.pressures_MPa or model.gravity:
        yield from _step(model, solver)


def _listed(numbers: IntArray) -> Iterator[str]:
    counted = (np.asarray(numbers) + 1).tolist()
    for start in range(0, len(counted), _PER_LINE):
        yield ", ".join(map(str, counted[start : start + _PER_LINE]))


def _material(material: InpMaterial, solver: Solver) -> Iterator[str]:
    yield f"** {material.remark}"
    yield f"*MATERIAL, NAME={material.name}"
    nu = material.poisson
    if solver == "abaqus":
        yield f"*HYPERELASTIC, MARLOW, POISSON={nu:g}"
        yield "*UNIAXIAL TEST DATA"
        yield from (f"{stress:.9g}, {strain:.9g}" for strain, stress in material.curve.tolist())
    elif material.hardening is not None:
        yield "*ELASTIC"
        yield f"{material.modulus_MPa:.9g}, {nu:g}"
        yield "*PLASTIC"
        yield from (f"{stress:.9g}, {strain:.9g}" for stress, strain in material.hardening.tolist())
    elif material.yeoh_MPa is not None:
        # The first D is 2 over the bulk modulus. CalculiX takes 0 for a stiff default, so the
        # others, which divide what J adds in higher powers, are large.
        c1, c2, c3 = (1.5 / (1.0 + nu) * c for c in material.yeoh_MPa)
        bulk = 2.0 * c1 * 2.0 * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))
        yield "*HYPERELASTIC, YEOH"
        yield f"{c1:.9g}, {c2:.9g}, {c3:.9g}, {2.0 / bulk:.9g}, 1e9, 1e9"
    if material.density_g_cm3 is not None:
        yield "*DENSITY"
        yield f"{1e-9 * material.density_g_cm3:.9g}"
    yield f"*SOLID SECTION, ELSET={material.name}, MATERIAL={material.name}"


def _step(model: InpModel, solver: Solver) -> Iterator[str]:
    yield "*STEP, NLGEOM" + ("=YES, INC=1000" if solver == "abaqus" else ", INC=1000")
    yield "*STATIC"
    yield "0.1, 1., 1e-6, 0.2"
    for name, (_, displacement) in model.held.items():
        yield "*BOUNDARY"
        for axis, value in enumerate(displacement, start=1):
            if value is not None:
                yield f"{name}, {axis}, {axis}, {value:.9g}"
    for name, (nodes, forces) in model.forces_N.items():
        yield f"** {name}"
        yield "*CLOAD"
        for node, force in zip(nodes.tolist(), forces.tolist(), strict=True):
            yield from (
                f"{node + 1}, {axis}, {value:.9g}"
                for axis, value in enumerate(force, start=1)
                if value
            )
    if model.pressures_MPa or model.gravity is not None:
        yield "*DLOAD"
    for name, (faces, pressure) in model.pressures_MPa.items():
        for face in np.unique(faces[:, 1]).tolist():
            yield f"{name}_S{face + 1}, P{face + 1}, {pressure:.9g}"
    if model.gravity is not None:
        x, y, z = model.gravity
        yield f"EALL, GRAV, {_GRAVITY_MM_S2:g}, {x:.9g}, {y:.9g}, {z:.9g}"
    if solver == "abaqus":
        yield "*OUTPUT, FIELD"
        yield from ("*NODE OUTPUT", "U, RF", "*ELEMENT OUTPUT", "S, LE")
    else:
        yield from ("*NODE FILE", "U, RF", "*EL FILE", "S, E")
        for name in model.held:
            yield from (f"*NODE PRINT, NSET={name}, TOTALS=ONLY", "RF")
    yield "*END STEP"

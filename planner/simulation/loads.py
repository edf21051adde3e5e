"""Loads and supports as a user writes them: which faces of a part, and what holds or moves them."""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from planner.errors import ArgumentError, FileError, as_texts, check_known, did_you_mean, refused
from planner.fields.basic import unit_direction
from planner.formats.files import decode_toml, read_file
from planner.formats.units import QUANTITY_UNITS, quantities_of, unit_factor
from planner.glance import place_text
from planner.mesh.mesh import Mesh, Topology, connected, measure
from planner.numerics import BoolArray, FloatArray, IntArray, Point, numbers_in
from planner.palette import Palette

__all__ = [
    "Condition",
    "Conditions",
    "LoadCase",
    "Pressure",
    "couple",
    "palette_densities",
    "read_cases",
    "read_conditions",
]


# ------------------------------------------------------------------------------------------------
# A load case as a user writes it, in options or in a file.


@dataclass(frozen=True)
class LoadCase:
    """What holds and loads a part, as a user writes it; each is a text or several.

    Attributes
    ----------
    target
        What `planner.design` is to reach; a simulation tells the displacements among them.
    fix
        Selectors of faces that do not move.
    load
        ``SELECTOR: fx,fy,fz UNIT``, the force on all of the faces together; its direction stays.
    pressure
        ``SELECTOR: p UNIT``, pushing on the material; it turns and grows with the faces.
    move
        ``SELECTOR: ux,uy,uz UNIT``; a component may be ``free``.
    gravity
        Where the part's weight pulls: ``-z``, or three numbers.
    name
        What results call the case.
    moment
        ``SELECTOR: mx,my,mz UNIT``, about the centroid of the faces: see `couple`.
    watch
        ``SELECTOR``: faces whose displacement is told; ``SELECTOR uz``: that along one axis.
    limit
        What `planner.design` keeps in this case, as ``x=min uy<1 mm``.
    """

    target: Sequence[str] = ()
    fix: Sequence[str] = ()
    load: Sequence[str] = ()
    pressure: Sequence[str] = ()
    move: Sequence[str] = ()
    gravity: str | Sequence[float] | None = None
    name: str = ""
    moment: Sequence[str] = ()
    watch: Sequence[str] = ()
    limit: Sequence[str] = ()

    def __post_init__(self) -> None:
        for key in _TEXTS:
            texts = as_texts(getattr(self, key), f"`{key}`")
            object.__setattr__(self, key, tuple(_PRINTED_MINUS.sub("-", text) for text in texts))

    @property
    def is_empty(self) -> bool:
        """Whether nothing holds or loads the part."""
        given = (self.fix, self.load, self.moment, self.pressure, self.move)
        return not any(given) and self.gravity is None

    @property
    def watched_targets(self) -> tuple[str, ...]:
        """Targets that are displacements, as `watch` takes them."""
        return tuple(text for text in self.target if _WATCHED.fullmatch(text.strip()))

    @staticmethod
    def named(cases: "LoadCase | Iterable[LoadCase]", *first: "LoadCase") -> tuple["LoadCase", ...]:
        """Return cases, behind the first, each with a name; one alone may have none.

        Raises
        ------
        ArgumentError
            Two have one name, or one is something else.
        """
        with refused(ArgumentError, f"`cases` {cases!r}", "give a LoadCase, or several", TypeError):
            every = (*first, *((cases,) if isinstance(cases, LoadCase) else cases or ()))
        if wrong := [case for case in every if not isinstance(case, LoadCase)]:
            raise ArgumentError(f"`cases`: {wrong[0]!r} is no LoadCase; give one or several")
        given = [case.name for case in every]
        alone = len(given) < 2
        names = [
            name or ("" if alone else f"unnamed case {k}" if f"case {k}" in given else f"case {k}")
            for k, name in enumerate(given, 1)
        ]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ArgumentError(f"`cases`: {twice[0]!r} names two; give each case its own name")
        return tuple(replace(case, name=name) for case, name in zip(every, names, strict=True))

    @classmethod
    def read(cls, text: str) -> "LoadCase":
        """Read a load case from one line: ``NAME; KEY VALUE; KEY VALUE``, keys as in a file.

        Raises
        ------
        ArgumentError
            An unknown key, or one without a value.
        """
        name, *parts = (part.strip() for part in text.split(";"))
        held: dict[str, list[str]] = {}
        for part in filter(None, parts):
            key, _, value = part.partition(" ")
            if key not in _KEYS or not value:
                hint = did_you_mean(key, _KEYS)
                raise ArgumentError(
                    f"`case` {text}: {part!r} is no key with a value; {hint}write it as 'side; fix "
                    "x=max; load x=min: 0,0.1,0 N; limit x=min uy<1 mm'"
                )
            held.setdefault(key, []).append(value.strip())
        gravity = held.pop("gravity", [None])[-1]
        return cls(name=name, gravity=gravity, **held)


_PRINTED_MINUS = re.compile(r"(?<=[:=<>,\s])\N{MINUS SIGN}")
"""The minus of a page that a load is copied from, before a figure; a file's name keeps its own."""

_TEXTS = ("target", "fix", "load", "moment", "pressure", "move", "watch", "limit")
_KEYS = (*_TEXTS, "gravity")


def read_cases(path: str | Path) -> tuple[LoadCase, ...]:
    """Read load cases from a TOML file: tables ``[[case]]`` with the fields of `LoadCase`.

    Raises
    ------
    FileError
        It cannot be read, or is not such a file.
    """
    found = decode_toml(read_file(path), str(path))
    tables = found.get("case")
    if not isinstance(tables, list) or not tables or set(found) != {"case"}:
        raise FileError(f"{path}: it needs tables [[case]], and nothing else")
    for number, table in enumerate(tables, 1):
        where = f"{path}: case {number}"
        if not isinstance(table, dict):
            raise FileError(f"{where}: it must be a table, [[case]]")
        for key, value in table.items():
            check_known(key, (*_KEYS, "name"), f"{where}: no key {key!r}; {{}}it has", FileError)
            texts = value if isinstance(value, list) and key in _TEXTS else [value]
            if not all(isinstance(text, str) for text in texts):
                raise FileError(f"{where}: {key} must be text, or a list of texts")
    return tuple(LoadCase(**table) for table in tables)


# ------------------------------------------------------------------------------------------------
# What a load case means on a part's surface.


Displacement = tuple[float | None, float | None, float | None]


@dataclass(frozen=True, eq=False)
class Condition:
    """Faces that are held, loaded or watched."""

    selector: str
    facets: BoolArray


@dataclass(frozen=True, eq=False)
class Support(Condition):
    """Faces whose displacement is given: `displacement_mm` along x, y, z; None where it is free."""

    displacement_mm: Displacement


@dataclass(frozen=True, eq=False)
class Force(Condition):
    """A force of fixed direction, spread evenly over the area of faces at rest."""

    force_N: Point


@dataclass(frozen=True, eq=False)
class Moment(Condition):
    """A moment of fixed direction, by tractions on faces at rest that add up to no force."""

    moment_N_mm: Point


@dataclass(frozen=True, eq=False)
class Pressure(Condition):
    """A pressure on faces, against their outward normals; it turns and grows with them."""

    pressure_MPa: float


@dataclass(frozen=True, eq=False)
class Watched(Condition):
    """Faces whose displacement is told, along one axis or in its own direction."""

    axis: int | None = None


@dataclass(frozen=True, eq=False)
class Conditions:
    """What holds and loads a part; facets are (F,) masks over the faces of its surface.

    Attributes
    ----------
    gravity
        Unit vector of the part's own weight, or None.
    """

    supports: tuple[Support, ...]
    forces: tuple[Force, ...] = ()
    pressures: tuple[Pressure, ...] = ()
    gravity: Point | None = None
    watched: tuple[Watched, ...] = ()
    moments: tuple[Moment, ...] = ()

    def refuse_held(self, where: str, facets: BoolArray, axes: Sequence[int]) -> None:
        """Refuse faces that supports wholly hold along axes: no load moves them, nothing is found.

        Raises
        ------
        ArgumentError
            Along each of the axes all faces have a support.
        """
        by: dict[str, None] = {}
        for axis in axes:
            held = [s for s in self.supports if s.displacement_mm[axis] is not None]
            if not (held and np.logical_or.reduce([s.facets for s in held])[facets].all()):
                return
            by |= {s.selector: None for s in held if (s.facets & facets).any()}
        along = "" if len(axes) == 3 else f" along {' and '.join('xyz'[axis] for axis in axes)}"
        raise ArgumentError(
            f"{where}: all of its faces are held{along} by supports ({', '.join(by)}), which give "
            "them their displacement whatever the loads and materials are; name other faces"
        )


def read_conditions(surface: Mesh, case: LoadCase) -> Conditions:
    """Read loads and supports, and find the faces that each is on.

    A selector is one or more terms, joined by ``and``: ``x<1``, ``x>=3`` (faces whose middle
    lies there), ``x=min``, ``z=max``, ``x=12.5`` (faces that lie in the plane),
    ``box:x0,y0,z0,x1,y1,z1``, ``near:x,y,z,radius``, ``normal:+z within 20`` (degrees) and
    ``cavity``: closed voids, and voids that close when the plane of a support is capped. Places
    are mm in the part's own coordinates.

    Parameters
    ----------
    surface
        Closed, in mm, with faces small enough to be taken or left whole.

    Raises
    ------
    ArgumentError
        Words that mean nothing, a unit that is missing or unknown, a selector that catches no
        face or all, supports that contradict each other or leave a body free to move.
    """
    faces = _Faces(surface)
    held: list[tuple[str, str, Displacement]] = [
        ("fix", text, (0.0, 0.0, 0.0)) for text in case.fix
    ]
    for text in case.move:
        selector, parts, factor = _split("move", text, 3)
        x, y, z = (None if part is None else factor * part for part in parts)
        if x is None and y is None and z is None:
            raise ArgumentError(f"`move` {text}: all of it is free; leave it out")
        held.append(("move", selector, (x, y, z)))
    for option in ("fix", "load", "moment", "pressure", "move"):
        texts = getattr(case, option)
        plain = ["".join(text.split()) for text in texts]
        for at, text in enumerate(plain):
            if text in plain[:at]:
                raise ArgumentError(f"`{option}` {texts[at]}: it is given twice; once is enough")
    caps = tuple(cap for _, selector, _ in held for cap in _caps(selector))

    def chosen(option: str, selector: str) -> BoolArray:
        return _chosen(faces, selector, f"`{option}` {selector}", caps)

    supports = tuple(
        Support(selector.strip(), chosen(option, selector), by) for option, selector, by in held
    )

    def loads(option: str, count: int) -> Iterator[tuple[str, BoolArray, list[float]]]:
        for text in getattr(case, option):
            selector, parts, factor = _split(option, text, count)
            if None in parts:
                raise ArgumentError(f"`{option}` {text}: `move` alone takes 'free'; write 0 here")
            values = [factor * part for part in parts if part is not None]
            if not any(values):
                what = "force" if option == "load" else option
                raise ArgumentError(f"`{option}` {text}: a {what} of 0; leave it out")
            yield selector, chosen(option, selector), values

    forces = tuple(Force(s, facets, (x, y, z)) for s, facets, (x, y, z) in loads("load", 3))
    moments = tuple(Moment(s, facets, (x, y, z)) for s, facets, (x, y, z) in loads("moment", 3))
    pressures = tuple(Pressure(s, facets, p) for s, facets, (p,) in loads("pressure", 1))
    weight = None if case.gravity is None else _direction(case.gravity, "`gravity`")
    moving = any(any(support.displacement_mm) for support in supports)
    if not (forces or moments or pressures or weight or moving):
        raise ArgumentError(
            "nothing loads the part; give `load`, `moment`, `pressure`, `move` or `gravity`, as in "
            'load="x=min: 0,0,-0.5 N"'
        )
    _check_supports(faces, supports, [option for option, _, _ in held])
    on = Conditions(supports, forces, pressures, weight, moments=moments)
    for force in forces:
        along = [axis for axis in range(3) if force.force_N[axis]]
        on.refuse_held(f"`load` {force.selector}", force.facets, along)
    for moment in moments:
        on.refuse_held(f"`moment` {moment.selector}", moment.facets, range(3))
    watched = {}
    for text in case.watch:
        found = _WATCHED.fullmatch(text.strip())
        selector, axis = (found[1], "xyz".index(found[2].casefold())) if found else (text, None)
        key = (selector.strip(), axis)
        if key not in watched:
            watched[key] = Watched(selector.strip(), chosen("watch", selector), axis)
    return replace(on, watched=tuple(watched.values()))


_WATCHED = re.compile(r"(.+?)\s+u([xyz])(?:\s*=.*)?", re.IGNORECASE)
"""Faces and an axis, and what a target may say further: how far they are to move."""


def couple(weight: FloatArray, place_mm: FloatArray, moment: FloatArray) -> FloatArray:
    """Return forces at points that come to a moment, (3,), and to no force: (n, 3).

    They are weight times ω × r, with r from the weighted centroid: the traction that is linear
    over the faces, and of all that come to the moment the one of least square. ω follows from
    ∫ r × (ω × r) = moment. On a plane face it is the linear stress of a bent beam's section, or
    the shear in circles of a twisted round bar's.

    Parameters
    ----------
    weight : (n,)
        Area, or whatever sums over the points are to be weighted by.
    place_mm : (n, 3)
        Not all on a line.
    """
    arm = place_mm - weight @ place_mm / weight.sum()
    square = np.einsum("n,ni,nj->ij", weight, arm, arm)
    spin = np.linalg.solve(np.trace(square) * np.eye(3) - square, moment)
    return np.asarray(weight[:, None] * np.cross(spin, arm))


def palette_densities(palette: Palette, cases: Sequence[LoadCase]) -> tuple[FloatArray, FloatArray]:
    """Return the coordinates of a palette's materials and their densities, g/cm³; unknown is NaN.

    Raises
    ------
    ArgumentError
        A case has gravity, and a density is not known.
    """
    densities = np.array([m.density_g_cm3 for m in palette.materials], dtype=np.float64)
    if not np.isfinite(densities).all() and any(case.gravity is not None for case in cases):
        raise ArgumentError("`gravity`: the palette tells no density of a material; add it there")
    return np.array([material.coordinate for material in palette.materials]), densities


def _direction(given: str | Sequence[float], where: str) -> Point:
    with refused(ArgumentError, where, "{}", ArgumentError):
        return unit_direction(given)


# ------------------------------------------------------------------------------------------------
# Figures and units: "SELECTOR: 0,0,-0.5 N".


_FIGURE = re.compile(r"\s*(free|[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(.*?)\s*", re.IGNORECASE)
_WRITTEN: Mapping[str, tuple[str, str, str]] = {
    "load": ("force", "x=min: 0,0,-0.5 N", "N, mN, kN, lbf, kgf"),
    "moment": ("moment", "x=min: 0,5,0 N mm", "N mm, mN mm, N cm, N m, lbf inch"),
    "pressure": ("stress", "cavity: 20 kPa", "kPa, MPa, Pa, bar, psi"),
    "move": ("length", "z=max: 5,0,free mm", "mm, um, cm, m, inch"),
}
"""By option: the quantity of its figures, an example, and units that are advised."""

_MOMENT = re.compile(r"(.*(?:N|lbf|kgf))[\s·*]*(\S+)")


def _split(option: str, text: str, count: int) -> tuple[str, list[float | None], float]:
    """Take a condition apart: its selector, its figures (None: free), and the unit's factor."""
    where, (quantity, example, advised) = f"`{option}` {text}", _WRITTEN[option]
    selector, colon, figures = text.rpartition(":")
    words = [_FIGURE.fullmatch(word) for word in figures.split(",")]
    if not colon or not all(words):
        raise ArgumentError(f"{where}: it must be SELECTOR: FIGURES UNIT, as in {example!r}")
    found = [word for word in words if word is not None]
    if len(found) != count or any(word[2] for word in found[:-1]):
        raise ArgumentError(
            f"{where}: {figures.strip()!r} must be {count} "
            f"{'figures, parted by commas' if count > 1 else 'figure'}, and a unit at the end, as "
            f"in {example!r}"
        )
    if not (unit := found[-1][2]):
        raise ArgumentError(
            f"{where}: the unit is missing; write it behind the figures, as in {example!r}; there "
            f"are {advised}"
        )
    product = _MOMENT.fullmatch(unit) if quantity == "moment" else None
    each = dict(zip(("force", "length"), product.groups(), strict=True)) if product else {}
    each = each or {quantity: unit}
    if any(kind not in quantities_of(word) for kind, word in each.items()):
        kinds = " or ".join(sorted(quantities_of(unit)))
        which = f", which is one of {kinds}" if kinds else ""
        hint = did_you_mean(unit, QUANTITY_UNITS.get(quantity, ()))
        raise ArgumentError(
            f"{where}: {unit!r} is no unit of {quantity}{which}; {hint}there are {advised}"
        )
    values = [None if w[1].casefold() == "free" else float(w[1]) for w in found]
    if not all(value is None or math.isfinite(value) for value in values):
        raise ArgumentError(f"{where}: figures must be finite")
    factors = [unit_factor(kind, word, where=where) for kind, word in each.items()]
    return selector.strip(), values, math.prod(factors)


# ------------------------------------------------------------------------------------------------
# Which faces a selector is about.


_FLAT = 1e-5
"""Of the part's size: how near a plane the corners of a face in it lie. A file in single precision
rounds by 6e-8 of a coordinate; 1e-5 of a 100 mm part is a thirtieth of a printed layer."""

_PLACE = re.compile(r"([xyz])\s*(<=|>=|<|>|=)\s*(min|max|[-+.\de]+)(?:\s*mm)?", re.IGNORECASE)
_CALLED = re.compile(r"(box|near|normal)\s*:\s*(.*)", re.IGNORECASE)
_NORMAL = re.compile(r"(.+?)\s+within\s+(\d+\.?\d*|\.\d+)(?:\s*(?:deg|degrees|°))?", re.IGNORECASE)
_SELECTORS = (
    "x<1, y>=3, x=min, z=max, x=12.5, box:x0,y0,z0,x1,y1,z1, near:x,y,z,radius, "
    "normal:+z within 20, cavity, and such joined by 'and'"
)
_Cap = tuple[int, str]
"""A plane that a support is in: across which axis, and where (min, max, or mm)."""


class _Faces:
    """A surface, and what selectors ask of its faces.

    Attributes
    ----------
    topology
        Which faces meet at which edges.
    centre_mm, area_mm2 : (F, 3), (F,)
        Middle and area of each face.
    flat_mm
        How near a plane is in it.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh, self.topology = mesh, Topology(mesh.faces)
        self.centre_mm = mesh.triangles.mean(axis=1)
        self.area_mm2 = np.linalg.norm(mesh.area_vectors_mm2, axis=1)
        self.flat_mm = _FLAT * float(np.ptp(mesh.bounds_mm, axis=0).max())

    def place_mm(self, axis: int, word: str) -> float:
        """Return the place along an axis that a word of a selector means."""
        ends = dict(zip(("min", "max"), self.mesh.bounds_mm[:, axis].tolist(), strict=True))
        return ends[word] if word in ends else float(word)

    def reach(self, axis: int) -> str:
        """Say where the part is along an axis."""
        low, high = self.mesh.bounds_mm[:, axis].tolist()
        return f"{'xyz'[axis]} goes from {low:.4g} to {high:.4g} mm"

    @property
    def reaches(self) -> str:
        """Say where the part is."""
        return ", ".join(self.reach(axis) for axis in range(3))


def _caps(selector: str) -> Iterator[_Cap]:
    """Yield the planes that a support's faces are in, or end at: x=max, and x>99 alike."""
    for term in _terms(selector):
        if found := _PLACE.fullmatch(term):
            end = {"<": "min", ">": "max"}.get(found[2][0], found[3].casefold())
            yield "xyz".index(found[1].casefold()), end


def _terms(selector: str) -> list[str]:
    return [term.strip() for term in re.split(r"\s+and\s+", selector.strip(), flags=re.IGNORECASE)]


def _chosen(faces: _Faces, selector: str, where: str, caps: Sequence[_Cap]) -> BoolArray:
    """Return the faces that all terms of a selector catch."""
    terms = _terms(selector)
    each = [
        _term(faces, term, where if len(terms) == 1 else f"{where}: {term}", caps) for term in terms
    ]
    facets = np.logical_and.reduce(each)
    if not facets.any():
        counts = ", ".join(
            f"{term}: {np.count_nonzero(one)}" for term, one in zip(terms, each, strict=True)
        )
        raise ArgumentError(f"{where} catches no face: none is in all terms at once ({counts})")
    if facets.all():
        raise ArgumentError(f"{where} catches every face of the part: {faces.reaches}")
    return np.asarray(facets)


def _term(faces: _Faces, term: str, where: str, caps: Sequence[_Cap]) -> BoolArray:
    """Return the faces that one term catches; a term that catches none is told by itself."""
    if term.casefold() == "cavity":
        return _cavity(faces, where, caps)
    if found := _PLACE.fullmatch(term):
        axis, sign, word = "xyz".index(found[1].casefold()), found[2], found[3].casefold()
        held, instead = _at_place(faces, axis, sign, word, where)
    elif found := _CALLED.fullmatch(term):
        held, instead = _BY_NAME[found[1].casefold()](faces, found[2], where)
    else:
        hint = did_you_mean(re.split(r"[^a-z]", term.casefold())[0], ("cavity", *_BY_NAME))
        raise ArgumentError(f"{where}: {term!r} selects nothing; {hint}there are {_SELECTORS}")
    if not held.any():
        raise ArgumentError(f"{where} catches no face: {instead}")
    return held


_Caught = tuple[BoolArray, str]
"""Faces, and what to say where there are none."""


def _at_place(faces: _Faces, axis: int, sign: str, word: str, where: str) -> _Caught:
    with refused(ArgumentError, where, f"{word!r} is no place; give min, max or mm", ValueError):
        at = faces.place_mm(axis, word)
    if sign != "=":
        along = faces.centre_mm[:, axis]
        held = {"<": along < at, "<=": along <= at, ">": along > at, ">=": along >= at}[sign]
        return held, f"the part's {faces.reach(axis)}"
    off = np.abs(faces.mesh.triangles[:, :, axis] - at).max(axis=1)
    instead = "<" if at <= faces.mesh.bounds_mm[:, axis].mean() else ">"
    return np.asarray(off <= faces.flat_mm), (
        f"none lies in the plane at {at:.4g} mm; the part's {faces.reach(axis)}: take a stretch, "
        f"as {'xyz'[axis]}{instead}..., instead"
    )


def _numbers(text: str, count: int, where: str) -> list[float]:
    found = numbers_in(text.split(","), float)
    if len(found) != count or not all(map(math.isfinite, found)):
        raise ArgumentError(f"{where}: {text!r} must be {count} figures in mm, parted by commas")
    return found


def _in_box(faces: _Faces, text: str, where: str) -> _Caught:
    corners = np.array(_numbers(text, 6, where)).reshape(2, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    held = ((faces.centre_mm >= low) & (faces.centre_mm <= high)).all(axis=1)
    return held, f"the part's {faces.reaches}"


def _near(faces: _Faces, text: str, where: str) -> _Caught:
    *place, radius = _numbers(text, 4, where)
    off = np.linalg.norm(faces.centre_mm - np.array(place), axis=1)
    place_words = place_text(faces.centre_mm[off.argmin()]).removesuffix(" mm")
    return np.asarray(off <= radius), f"the nearest is {off.min():.4g} mm off, at {place_words}"


def _turned(faces: _Faces, text: str, where: str) -> _Caught:
    found = _NORMAL.fullmatch(text.strip())
    if found is None:
        raise ArgumentError(f"{where}: write normal:DIRECTION within DEGREES: normal:+z within 20")
    direction = np.array(_direction(found[1], where))
    angle = np.degrees(np.arccos(np.clip(faces.mesh.normals @ direction, -1.0, 1.0)))
    return angle <= float(found[2]), f"the nearest is turned {angle.min():.3g}° off"


_BY_NAME: Mapping[str, Callable[[_Faces, str, str], _Caught]] = {
    "box": _in_box, "near": _near, "normal": _turned,
}  # fmt: skip


# ------------------------------------------------------------------------------------------------
# The cavity: what of the surface a pressure inside acts on.


def _cavity(faces: _Faces, where: str, caps: Sequence[_Cap]) -> BoolArray:
    """Return the walls of closed voids, and of voids that close when planes are capped.

    Faces in a capped plane are left out, and the rest is parted where an edge lies in it. Each
    piece is then closed by fans in the plane; a void's is turned inside out, so that its volume is
    negative. Nothing is sampled: a wall or a channel may be as thin as it likes.
    """
    planes = sorted({(axis, faces.place_mm(axis, word)) for axis, word in caps})
    vertices, corners = faces.mesh.vertices, faces.mesh.faces
    heads = corners[:, [1, 2, 0]]
    left_out = np.zeros(len(corners), dtype=np.bool_)
    plane_of = np.full(corners.size, -1)  # in which plane a half-edge lies
    for number, (axis, at) in enumerate(planes):
        on = np.abs(vertices[:, axis] - at) <= faces.flat_mm
        left_out |= on[corners].all(axis=1)
        plane_of[(on[corners] & on[heads]).ravel()] = number
    twin = faces.topology.twin
    half = np.flatnonzero((twin >= 0) & (plane_of < 0))
    piece = connected(len(corners), half // 3, twin[half] // 3)
    origin = vertices.mean(axis=0)
    six_volumes = np.linalg.det(vertices[corners] - origin)
    rim = np.flatnonzero((plane_of >= 0) & ~np.repeat(left_out, 3))
    apex = np.broadcast_to(origin, (len(rim), 3)).copy()
    for number, (axis, at) in enumerate(planes):
        apex[plane_of[rim] == number, axis] = at
    fan = np.stack([vertices[heads.ravel()[rim]], vertices[corners.ravel()[rim]], apex], axis=1)
    six_volumes += np.bincount(rim // 3, np.linalg.det(fan - origin), len(corners))
    within = ~left_out
    volume = np.bincount(piece[within], weights=six_volumes[within] / 6.0, minlength=len(corners))
    area = np.bincount(piece[within], weights=faces.area_mm2[within], minlength=len(corners))
    void = volume < -faces.flat_mm * area  # deeper than what counts as in the plane
    if not void.any():
        closed = ", ".join(f"{'xyz'[axis]}={word}" for axis, word in dict.fromkeys(caps))
        raise ArgumentError(
            f"{where}: the part has no cavity: no closed void, and "
            + (f"none closes when {closed} is capped" if caps else "no support caps a plane")
            + "; fix the face that its channel opens at, as x=max, or select the faces that the "
            "pressure is on, as box:..."
        )
    return np.asarray(within & void[piece])


# ------------------------------------------------------------------------------------------------
# Whether supports hold the part, and agree with each other.


_FREE = 1e-5
"""Of the stiffest motion: below it a rigid motion is not held. Three corners of a face of a
hundredth of the part's size hold a turn by 1e-2; corners on a line, rounded in single precision,
by 1e-7."""


def _check_supports(faces: _Faces, supports: Sequence[Support], options: Sequence[str]) -> None:
    """Refuse supports that contradict each other, or leave a rigid motion of a body free."""
    named = [f"`{option}` {s.selector}" for option, s in zip(options, supports, strict=True)]
    vertices = [np.unique(faces.mesh.faces[support.facets]) for support in supports]
    for i, j in combinations(range(len(supports)), 2):
        shared = np.intersect1d(vertices[i], vertices[j])
        pairs = zip(supports[i].displacement_mm, supports[j].displacement_mm, strict=True)
        for axis, (one, other) in enumerate(pairs):
            if len(shared) and one is not None and other is not None and one != other:
                raise ArgumentError(
                    f"{named[i]} and {named[j]} contradict each other: both are on the part at "
                    f"{place_text(faces.mesh.vertices[shared[0]])}, which they move by {one:g} and "
                    f"{other:g} mm along {'xyz'[axis]}; leave a stretch between them, or make one "
                    "free"
                )
    if not supports:
        raise ArgumentError(
            "nothing holds the part, so that any load carries it away; give `fix`, as in "
            f'fix="x=min": its {faces.reaches}'
        )
    body, bodies = _bodies(faces)
    for number in range(bodies):
        if not (free := _free_motions(faces, supports, body == number)):
            continue
        points = faces.mesh.triangles[body == number].reshape(-1, 3)
        low, high = (", ".join(f"{c:.4g}" for c in end) for end in (points.min(0), points.max(0)))
        what = "the part" if bodies == 1 else f"the body from ({low}) to ({high}) mm"
        raise ArgumentError(f"{what} can still {free}; hold it there too, with `fix` or `move`")


def _bodies(faces: _Faces) -> tuple[IntArray, int]:
    """Return the solid body of each face; a void's walls belong to the least body around it."""
    piece, count = faces.topology.body, faces.topology.bodies
    found = measure(faces.mesh.vertices, faces.mesh.faces, piece, count)
    solid = np.flatnonzero(found.volume_mm3 > 0.0)
    number = np.zeros(count, dtype=np.int64)
    number[solid] = np.arange(len(solid))
    for void in np.flatnonzero(found.volume_mm3 <= 0.0).tolist():
        low, high = found.bounds_mm[void]
        around = solid[
            (found.bounds_mm[solid, 0] <= low).all(1) & (found.bounds_mm[solid, 1] >= high).all(1)
        ]
        if len(around):
            number[void] = number[around[found.volume_mm3[around].argmin()]]
    return number[piece], len(solid)


def _free_motions(faces: _Faces, supports: Sequence[Support], body: BoolArray) -> str:
    """Name the rigid motions of a body that its supports leave free; "" where there is none."""
    corners = faces.mesh.triangles[body]
    middle, size = corners.mean(axis=(0, 1)), float(np.ptp(corners, axis=(0, 1)).max())
    rows = [np.zeros((1, 6))]
    for support in supports:
        touched = np.unique(faces.mesh.faces[support.facets & body])
        at = (faces.mesh.vertices[touched] - middle) / size
        for axis, value in enumerate(support.displacement_mm):
            if value is not None:
                along = np.eye(3)[axis]  # of u = t + w x r
                rows.append(np.hstack(np.broadcast_arrays(along, np.cross(at, along))))
    held = np.concatenate(rows)
    held = held.T @ held
    limit = _FREE**2 * float(np.abs(held).max())
    moves = _named(_unheld(held[:3, :3], limit))
    turns = _named(_span(_unheld(held, limit)[3:]))
    words = [f"move along {moves}"] * bool(moves) + [f"turn about {turns}"] * bool(turns)
    return " and ".join(words)


def _unheld(stiffness: FloatArray, limit: float) -> FloatArray:
    values, vectors = np.linalg.eigh(stiffness)
    return np.asarray(vectors[:, values <= limit])


def _span(columns: FloatArray) -> FloatArray:
    basis, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(basis[:, values > 1e-6])


def _named(basis: FloatArray) -> str:
    """Name a space of directions: the axes that lie in it, and the rest in figures."""
    axes = [axis for axis in range(3) if np.linalg.norm(basis[axis]) > 1.0 - 1e-6]
    basis[axes] = 0.0
    rest = [
        "(" + ", ".join(f"{c * np.sign(v[np.abs(v).argmax()]) + 0.0:.2g}" for c in v) + ")"
        for v in _span(basis).T
    ]
    return " and ".join([*("xyz"[axis] for axis in axes), *rest])

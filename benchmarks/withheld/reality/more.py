"""Further specimens of a campaign that is sealed: the same lab and truth, other conditions.

Whoever asks says how to print and pull; what is hidden stays so, and what was measured before is
left as it was. Further specimens come from a batch of their own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from benchmarks.withheld.reality.campaign import (
    Campaign,
    Lab,
    by_number,
    measured_in,
    mounted_groups,
    open_lab,
    seen_fields,
)
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects import Set, Shape
from benchmarks.withheld.reality.fields import USUAL, Camera
from benchmarks.withheld.reality.noise import CAREFUL, Handling, measured_force
from benchmarks.withheld.reality.palette_file import PaletteFile
from benchmarks.withheld.reality.profiles import Profile
from benchmarks.withheld.reality.sizing import Hidden, force_N

__all__ = ["FurtherTest", "further", "further_of", "read_test"]

_STREAM = 90  # beside those of the campaign itself
_STEP_MM = 0.01


@dataclass(frozen=True)
class FurtherTest:
    """How one further specimen is printed and pulled.

    Attributes
    ----------
    materials
        One palette id of a coupon; two of a bar whose first half is of the one and second half of
        the other, which a camera watches.
    """

    materials: tuple[str, ...]
    width_mm: float
    thickness_mm: float
    gauge_mm: float
    rate_mm_s: float
    temperature_C: float
    soak_h: float
    age_days: float
    orientation: str
    protocol: str

    @property
    def is_bar(self) -> bool:
        """Whether it is a bar of two materials."""
        return len(self.materials) == 2


def read_test(entry: Mapping[str, object]) -> FurtherTest:
    """Read a test from JSON.

    Raises
    ------
    ValueError
        A key is missing, unknown or has a value that a test cannot have; the message names it.
    """
    names = [f.name for f in fields(FurtherTest)]
    wrong = next((n for n in (*names, *entry) if (n in entry) != (n in names)), None)
    if wrong is not None:
        raise ValueError(f"a test has the keys {', '.join(names)}; {wrong} is missing or unknown")
    for name in names:
        if not _possible(name, entry[name]):
            raise ValueError(f"a test's {name} cannot be {entry[name]!r}")
    materials = entry["materials"]
    assert isinstance(materials, list)
    values: dict[str, object] = {**entry, "materials": tuple(str(m) for m in materials)}
    return FurtherTest(**values)  # type: ignore[arg-type]  # by name, checked above


def _possible(name: str, value: object) -> bool:
    match name:
        case "materials":
            return isinstance(value, list) and len(value) in (1, 2)
        case "orientation":
            return value in ("x", "y", "z")
        case "protocol":
            return value in ("monotonic", "cyclic", "relaxation")
        case "temperature_C" | "soak_h" | "age_days":
            return isinstance(value, int | float)
    return isinstance(value, int | float) and value > 0.0


def further(
    palette: PaletteFile,
    set_name: Set,
    tier: str,
    count: int,
    seed: int,
    index: int,
    tests: Sequence[FurtherTest],
    *,
    camera: Camera = USUAL,
    handling: Handling = CAREFUL,
    turn: int = 1,
) -> Campaign:
    """Return a campaign of `make_campaign` with further specimens.

    Parameters
    ----------
    turn
        Another one scatters otherwise.

    Raises
    ------
    ValueError
        A material that the palette does not have among its elastic grades.
    """
    lab = open_lab(palette, set_name, tier, count, seed, index, camera, handling)
    known = measured_in(lab)
    rng = np.random.default_rng(
        np.random.SeedSequence(seed, spawn_key=(index, _STREAM, turn, int(known.name, 16)))
    )
    design, new = _added(lab, tests, rng)
    benches = mounted_groups(palette, design, lab.law)
    hidden = [_for_all(item, len(tests), rng) for item in lab.hidden]
    ideal = force_N(benches, hidden)[len(lab.design) :]
    travel, time_s = by_number(benches)
    share = (travel / travel.max(axis=1, keepdims=True))[len(lab.design) :]
    seen = seen_fields(lab, benches, hidden, rng)
    return replace(
        known,
        design=design,
        specimen_ids=known.specimen_ids + _other_ids(known.specimen_ids, len(tests), rng),
        time_s=time_s,
        displacement_mm=np.concatenate([known.displacement_mm, travel[len(lab.design) :]]),
        force_N=np.concatenate(
            [known.force_N, measured_force(ideal, share, new, lab.scatter, rng)]
        ),
        fields=known.fields + tuple(f for f in seen if f[0] >= len(lab.design)),
    )


def further_of(
    palette: PaletteFile,
    truth: Mapping[str, Any],
    name: str,
    tests: Sequence[FurtherTest],
    *,
    turn: int = 1,
) -> Campaign:
    """Return the campaign of a sealed truth by its folder's name, with further specimens.

    Raises
    ------
    ValueError
        The truth knows nothing of the campaign, or was made otherwise than now.
    """
    entry = truth["campaigns"].get(name)
    if entry is None:
        raise ValueError(f"campaign {name}: the truth knows nothing of it")
    made_by = truth["made_by"]
    campaign = further(
        palette,
        entry["set"],
        entry["tier"],
        made_by["specimens"],
        made_by["seed"],
        entry["index"],
        tests,
        camera=Camera(**made_by.get("camera", {})),
        handling=Handling(**made_by.get("handling", {})),
        turn=turn,
    )
    if campaign.name != name:
        raise ValueError(f"campaign {name}: made by another version of the bench")
    return campaign


def _added(
    lab: Lab, tests: Sequence[FurtherTest], rng: np.random.Generator
) -> tuple[Design, Design]:
    """Return the design with the tests after it, and the tests alone."""
    old, count = lab.design, len(tests)
    at = {g.id: g.coordinate for g in lab.palette.grades}
    stranger = next((m for t in tests for m in t.materials if m not in at), None)
    if stranger is not None:
        raise ValueError(f"no elastic grade {stranger!r} in the palette; there are {', '.join(at)}")
    bar = np.array([t.is_bar for t in tests])
    steps = [_step(t.gauge_mm, *(at[m] for m in t.materials)) for t in tests if t.is_bar]
    coordinate = np.array([at[t.materials[0]] for t in tests])
    columns: dict[str, Any] = {
        name: np.array([getattr(t, name) for t in tests])
        for name in (f.name for f in fields(FurtherTest) if f.name != "materials")
    }
    new = Design(
        number=len(old) + np.arange(count),
        material=np.array(["" if t.is_bar else t.materials[0] for t in tests]),
        coordinate=np.where(bar, np.nan, coordinate),
        profile=np.where(bar, len(old.profiles) + np.cumsum(bar) - 1, -1),
        condition=int(old.condition.max()) + 1 + np.arange(count),
        batch=np.full(count, f"B{len(np.unique(old.batch)) + 1}"),
        operator=np.array(["A", "B"])[rng.integers(2, size=count)],
        tray_x_mm=rng.uniform(20.0, 470.0, size=count).round(0),
        profiles=(*old.profiles, *steps),
        **columns,
    )
    columns = {
        f.name: np.concatenate([getattr(old, f.name), getattr(new, f.name)])
        for f in fields(Design)
        if f.name != "profiles"
    }
    return replace(new, **columns), new


def _step(length_mm: float, low: float, high: float) -> Profile:
    middle = 0.5 * length_mm
    x = np.array([0.0, middle - _STEP_MM / 2, middle + _STEP_MM / 2, length_mm])
    return Profile("step", x, np.array([low, low, high, high]))


def _for_all(item: Hidden, count: int, rng: np.random.Generator) -> Hidden:
    """Draw what each further specimen has of its own among what the others have."""
    shape: dict[str, float | list[float] | str] = {}
    for name, value in item.cause.shape.items():
        if isinstance(value, list):
            value = [*value, *(float(v) for v in rng.choice(value, count))]
        shape[name] = value
    drawn: Shape = shape
    return Hidden(replace(item.cause, shape=drawn), item.size)


def _other_ids(ids: Sequence[str], count: int, rng: np.random.Generator) -> tuple[str, ...]:
    free = sorted({f"S{n}" for n in range(1000, 10000)} - set(ids))
    return tuple(str(i) for i in rng.choice(free, count, replace=False))

"""Close the loop from print to plan: design, measure, diagnose, correct, plan again, print again.

python -m benchmarks.close_the_loop [--beyond] [--withheld COUNT] [--seed 1]

Laboratories whose physics is written here by hand, by formulas that planner's library does not
have, test the specimens that `planner gap design` asks for. What `planner gap diagnose` finds goes
into a palette for the conditions of use (`planner gap correct`), and a dog-bone is planned with the
first palette and with the corrected one. Printed with the true laws, how far off is each?

With --beyond, how far off the corrected stress is beyond the tested conditions and materials, and
how far off the correction says that it may be.

With --withheld, campaigns of benchmarks/withheld as well: the specimens at the farthest level of
the condition are kept from the diagnosis, and stand for the part in use.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.withheld.reality.__main__ import main as reality
from planner.gap.campaign import Campaign, Specimen, column_levels
from planner.gap.campaign_folder import read_campaign
from planner.gap.correct import correct
from planner.gap.design import design_campaign
from planner.gap.diagnose import diagnose
from planner.gap.effects import EFFECTS
from planner.gap.virtual import virtual_specimen
from planner.grading.grade import grade
from planner.grading.profile import Profile
from planner.materials.laws import make_law
from planner.numerics import FloatArray
from planner.palette import Palette, Reference
from planner.plan import Plan
from planner.printers import load_printer

DOGBONE = Path(__file__).resolve().parents[1] / "samples" / "dogbone.stl"
TARGET = Profile("0.7 to 7 MPa", (0.0, 1.0), (0.7, 7.0), "log")
STRAIN = 0.1
SCATTER, BATCH, CALIBRATION, SENSOR = 0.03, 0.012, 0.03, 0.001

Hidden = Callable[[FloatArray, Specimen, float], FloatArray]
"""What becomes of the law's stress over a specimen's test, its material's coordinate given."""


@dataclass(frozen=True)
class Laboratory:
    """What is hidden, which effects the lab suspects, and where its part will be used."""

    name: str
    suspected: tuple[str, ...]
    use: Reference
    hidden: Hidden
    budget: int = 30
    beyond: tuple[float, ...] = ()


@dataclass(frozen=True)
class Closed:
    """Relative errors, RMS along the part, with the first palette and with the corrected one."""

    name: str
    verdict: str
    promised: tuple[float, float]
    target: tuple[float, float]
    best: float


def hyperbola(stress: FloatArray, s: Specimen, coordinate: float) -> FloatArray:
    """Softening by heat: 1 / (1 + a dT), less in hard mixtures."""
    return stress / (1.0 + (0.035 - 0.01 * coordinate) * (s.temperature_C - 23.0))


def uptake(stress: FloatArray, s: Specimen, coordinate: float) -> FloatArray:
    """Softening by water: a rational function of time, slower in thick specimens."""
    half_h = 5.0 * (s.thickness_mm / 3.0) ** 2
    return stress * (1.0 - 0.3 * s.soak_h / (s.soak_h + half_h))


def hardening(stress: FloatArray, s: Specimen, coordinate: float) -> FloatArray:
    """Ageing as a power of the age."""
    return stress * (s.age_days / 9.0) ** 0.08


def stretched(stress: FloatArray, s: Specimen, coordinate: float) -> FloatArray:
    """A hereditary integral with the stretched exponential of Kohlrausch, Williams and Watts.

    A pull at the palette's own rate to a strain of 0.1 gives the law's stress.
    """

    def relaxed(time_s: FloatArray) -> FloatArray:
        return 0.45 + 0.55 * np.exp(-((np.maximum(time_s, 0.0) / 4.0) ** 0.4))

    pull_s = STRAIN / 0.034 * (np.arange(400) + 0.5) / 400
    step = np.diff(stress, prepend=0.0)
    later = s.time_s[:, None] - s.time_s[None, :]
    return np.where(later >= 0.0, relaxed(later), 0.0) @ step / float(relaxed(pull_s).mean())


LABORATORIES = (
    Laboratory("heat", ("rate", "temperature", "moisture"), Reference(temperature_C=33.0),
               hyperbola, beyond=(45.0, 60.0, 90.0)),
    Laboratory("water", ("rate", "temperature", "moisture"), Reference(soak_h=48.0), uptake,
               beyond=(200.0, 1000.0)),
    Laboratory("ageing", ("ageing", "moisture", "cross-section"), Reference(age_days=90.0),
               hardening, beyond=(300.0, 1000.0)),
    Laboratory("fast pull", ("rate", "temperature", "moisture"),
               Reference(strain_rate_per_s=1.0), stretched, beyond=(1.0, 10.0, 100.0)),
)  # fmt: skip


def stress_MPa(palette: Palette, s: Specimen, hidden: Hidden) -> FloatArray:
    """Return the true stress of a coupon along its test."""
    material = palette.resolve(s.material or "")
    law = make_law(material.law).nominal_stress_MPa(1.0 + s.strain)
    return hidden(np.asarray(law), s, material.coordinate)


def measured(
    plan: Campaign, hidden: Hidden, bias: Mapping[str, float], rng: np.random.Generator
) -> Campaign:
    """Return what the lab measures: the true stress, its palette's own error, and scatter."""
    batches = {
        name: BATCH * rng.standard_normal() for name in sorted({s.batch for s in plan.specimens})
    }
    done = []
    for s in plan.specimens:
        level = bias[s.material] + batches[s.batch] + SCATTER * rng.standard_normal()
        bend = 0.3 * SCATTER * rng.standard_normal() * (s.strain / s.strain.max() - 0.5)
        force = s.area_mm2 * stress_MPa(plan.palette, s, hidden) * np.exp(level + bend)
        noise = SENSOR * np.abs(force).max() * rng.standard_normal(len(force))
        done.append(replace(s, force_N=force + noise))
    return replace(plan, specimens=tuple(done), notes="")


def true_moduli_MPa(
    palette: Palette, use: Reference, hidden: Hidden, bias: Mapping[str, float]
) -> dict[str, float]:
    """Return the secant modulus of each material in use, as printed."""
    own = palette.reference
    rate = use.strain_rate_per_s or own.strain_rate_per_s
    at = {
        name: getattr(own, name) if getattr(use, name) is None else getattr(use, name)
        for name in ("temperature_C", "soak_h", "age_days", "orientation")
    }
    found = {}
    for material in palette.materials:
        s = virtual_specimen(palette, id="use", gauge_mm=25.0, strain=STRAIN, width_mm=6.0,
                             thickness_mm=3.0, material=material.id, rate_mm_s=25.0 * rate,
                             protocol="monotonic", **at)  # fmt: skip
        stress = float(stress_MPa(palette, s, hidden)[-1])
        found[material.id] = stress / STRAIN * np.exp(bias[material.id])
    return found


def errors(plan: Plan, true_MPa: Mapping[str, float]) -> tuple[float, float]:
    """Return RMS relative errors along a part: of what the plan promises, and of its target."""
    promised, target = [], []
    for u in (np.arange(500) + 0.5) / 500:
        region = next(r for r in plan.regions if r.field[0] <= u <= r.field[1])
        true = true_MPa[region.material]
        promised.append(np.log(region.modulus_MPa / true))
        target.append(np.log(true / float(TARGET.modulus_MPa(u))))
    return tuple(float(np.expm1(np.sqrt(np.mean(np.square(e))))) for e in (promised, target))


def least_error(true_MPa: Mapping[str, float]) -> float:
    """Return the error of the target if the true moduli were known: steps between grades."""
    logs = np.log(list(true_MPa.values()))
    wanted = np.log(TARGET.modulus_MPa((np.arange(500) + 0.5) / 500))
    off = np.abs(wanted[:, None] - logs).min(axis=1)
    return float(np.expm1(np.sqrt(np.mean(off**2))))


def compared(
    name: str,
    campaign: Campaign,
    use: Reference,
    true_MPa: Mapping[str, float],
    part: Path = DOGBONE,
) -> Closed:
    """Diagnose a campaign, correct its palette for the use, and plan a part with both palettes."""
    found = diagnose(campaign)
    made = correct(
        found,
        palette=campaign.palette,
        temperature_C=use.temperature_C,
        rate_per_s=use.strain_rate_per_s,
        soak_h=use.soak_h,
        age_days=use.age_days,
        orientation=use.orientation,
    )
    plans = [
        grade(part, profile=TARGET, axis="x", at_strain=STRAIN, palette=palette)
        for palette in (campaign.palette, made.palette)
    ]
    (promise, off), (promise_after, off_after) = (errors(plan, true_MPa) for plan in plans)
    return Closed(
        name, found.verdict, (promise, promise_after), (off, off_after), least_error(true_MPa)
    )


def tested(lab: Laboratory, seed: int) -> tuple[Campaign, dict[str, float]]:
    """Return what a laboratory measures, and how far off its palette is."""
    rng = np.random.default_rng(seed)
    palette = load_printer("connex3").palette()
    bias = {m.id: CALIBRATION * rng.standard_normal() for m in palette.materials}
    plan = design_campaign(lab.suspected, lab.budget, palette=palette).campaign
    return measured(plan, lab.hidden, bias, rng), bias


def close(lab: Laboratory, seed: int) -> Closed:
    """Run one laboratory from the design to the part."""
    campaign, bias = tested(lab, seed)
    true_MPa = true_moduli_MPa(campaign.palette, lab.use, lab.hidden, bias)
    return compared(lab.name, campaign, lab.use, true_MPa)


def beyond(lab: Laboratory, seed: int) -> list[str]:
    """Return table rows: how far off a corrected factor is beyond the tests, and may be."""
    campaign, bias = tested(lab, seed)
    palette, found = campaign.palette, diagnose(campaign)
    none = dict.fromkeys(bias, 0.0)
    name = next(n for n, value in asdict(lab.use).items() if value is not None)
    own = true_moduli_MPa(palette, Reference(), lab.hidden, none)
    told = ", ".join(f"{level:.3g}" for level in found.tested.get(name, ()))
    rows = []
    for value in lab.beyond:
        asked = {name.removeprefix("strain_"): value}
        made = correct(found, palette=palette, **asked)
        true = true_moduli_MPa(palette, Reference(**{name: value}), lab.hidden, none)
        off = np.array([np.log(true[m] / own[m] / f) for m, f in made.factor.items()])
        sd = np.array(list(made.log_sd.values()))
        ends = (np.abs(off).max(), 1.96 * sd.max())
        rows.append(
            f"| {lab.name} | {found.verdict} | {told} | {value:g} | "
            f"{np.exp(ends[0]):.2f} | {np.exp(ends[1]):.2f} | "
            f"{int(np.sum(np.abs(off) < 1.96 * sd))} of {len(off)} | {'yes' if made.ok else 'no'} |"
        )
    return rows


def kept_apart(campaign: Campaign, column: str) -> tuple[Campaign, tuple[Specimen, ...]] | None:
    """Take the coupons at a condition's level farthest from the reference out of a campaign."""
    reference = campaign.palette.reference
    own = getattr(reference, "strain_rate_per_s" if column == "rate_per_s" else column)
    values = [_condition(s, column) for s in campaign.specimens]
    level = column_levels("rate_mm_s" if column == "rate_per_s" else column, values)
    known = {n: v for n, v in zip(level, values, strict=True) if v is not None}
    if len(known) < 2:
        return None
    scale = np.log if column == "rate_per_s" else np.log1p if column != "temperature_C" else float
    far = max(known, key=lambda n: abs(scale(known[n]) - scale(own)))
    out = tuple(
        s
        for s, n in zip(campaign.specimens, level, strict=True)
        if n == far and s.material and s.strain.max() > STRAIN
    )
    rest = tuple(s for s, n in zip(campaign.specimens, level, strict=True) if n != far)
    return (replace(campaign, specimens=rest), out) if out and rest else None


def _condition(s: Specimen, column: str) -> float | None:
    if column == "rate_per_s":
        return None if s.rate_mm_s is None else s.rate_mm_s / s.gauge_mm
    return getattr(s, column)


def measured_moduli_MPa(palette: Palette, specimens: Sequence[Specimen]) -> dict[str, float]:
    """Return each material's modulus in use: its law times what coupons show, interpolated."""
    logs: dict[float, list[float]] = {}
    for s in specimens:
        material = palette.resolve(s.material or "")
        reached = int(np.argmax(s.strain >= STRAIN))
        share = np.interp(STRAIN, s.strain[: reached + 1], s.force_N[: reached + 1]) / s.area_mm2
        law = float(make_law(material.law).nominal_stress_MPa(1.0 + STRAIN))
        logs.setdefault(material.coordinate, []).append(float(np.log(share / law)))
    at = sorted(logs)
    means = [float(np.mean(logs[c])) for c in at]
    return {
        m.id: float(make_law(m.law).nominal_stress_MPa(1.0 + STRAIN)) / STRAIN
        * float(np.exp(np.interp(m.coordinate, at, means)))
        for m in palette.materials
    }  # fmt: skip


def withheld(count: int, seed: int) -> list[Closed]:
    """Close the loop on campaigns of the sealed bench whose whole verdict names a condition."""
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "campaigns"
        reality(["make", "--set", "development", "--tier", "other", "--count", str(count),
                 "--seed", str(seed), "-o", str(folder)])  # fmt: skip
        for path in sorted(folder.iterdir()):
            campaign = read_campaign(path)
            verdict = diagnose(campaign).verdict
            name = EFFECTS[verdict].condition if verdict in EFFECTS else None
            print(f"{path.name}: {verdict}", file=sys.stderr, flush=True)
            if name is None or name == "orientation":
                continue
            column = "rate_per_s" if name == "strain_rate_per_s" else name
            parts = kept_apart(campaign, column)
            if parts is None:
                print(f"{path.name}: no coupons in use", file=sys.stderr, flush=True)
                continue
            rest, use = parts
            value = float(np.mean([_condition(s, column) for s in use]))
            true = measured_moduli_MPa(campaign.palette, use)
            label = f"{path.name}, {verdict} at {value:.3g}"
            found.append(compared(label, rest, Reference(**{name: value}), true))
    return found


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--withheld", type=int, default=0, metavar="COUNT")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--beyond", action="store_true")
    options = parser.parse_args()
    if options.beyond:
        print("| laboratory | verdict | tested | used | off by a factor, at most | said, at most | "
              "materials within | grades known |")  # fmt: skip
        print("| --- " * 8 + "|")
        for lab in LABORATORIES:
            print(*beyond(lab, options.seed), sep="\n", flush=True)
        return
    closed = [close(lab, options.seed) for lab in LABORATORIES]
    if options.withheld:
        closed += withheld(options.withheld, options.seed)
    print("| laboratory | verdict | promise off, first | corrected | target off, first | "
          "corrected | at best |")  # fmt: skip
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for c in closed:
        figures = (*c.promised, *c.target, c.best)
        cells = " | ".join(f"{100 * value:.1f} %" for value in figures)
        print(f"| {c.name} | {c.verdict} | {cells} |")


if __name__ == "__main__":
    main()

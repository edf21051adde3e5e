"""What each published set is, what a diagnosis of it should say, and whether it does."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from planner.gap.diagnosis import Diagnosis

__all__ = ["EXPECTATIONS", "Answer", "Expectation", "probability_with"]

Answer = tuple[str, str]
"""Yes, in part or no; and why, as the end of a sentence."""

YES, PART, NO = "yes", "in part", "no"
SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Expectation:
    """One set.

    Attributes
    ----------
    source
        With its licence.
    what
        What was measured, and what the palette was fitted to.
    expected
        Written before anything was diagnosed.
    judge
        Holds a diagnosis against that.
    beyond
        What may not be inferred, whatever the diagnosis says.
    figures
        Of the report's folder, by name, each with its caption.
    rates
        Whether rates are left out one at a time, and the effect `rate` altogether.
    """

    title: str
    source: str
    what: str
    expected: str
    judge: Callable[[Diagnosis], Answer]
    beyond: str
    figures: Mapping[str, str] = field(default_factory=dict)
    rates: bool = False


def probability_with(diagnosis: Diagnosis, effect: str) -> float:
    """Return the probability of all hypotheses that have an effect."""
    return sum(h.probability for h in diagnosis.ranking if effect in h.effects)


def _silicones(d: Diagnosis) -> Answer:
    untested = {u.id for u in d.not_testable}
    if d.verdict == "none" and {"rate", "temperature"} <= untested:
        return YES, "no gap is claimed, and rate and temperature stand under what was not tested"
    if d.verdict == "none":
        return PART, "no gap is claimed, but rate or temperature is said to have been tested"
    return NO, f"a false alarm: {d.verdict}"


def _orientation(d: Diagnosis) -> Answer:
    classes = {"+".join(effects) for effects in d.same_class}
    if d.verdict == "orientation":
        return YES, "orientation is the verdict"
    if "orientation" in classes:
        return YES, f"the verdict is {d.verdict}, and orientation alone is in its class"
    if "orientation" in d.verdict.split("+"):
        return PART, "orientation is named, with a companion that nothing asked for"
    if any("orientation" in effects for effects in d.same_class):
        return PART, (
            f"the verdict is {d.verdict}; its class has orientation, but with a companion only"
        )
    return NO, f"the verdict is {d.verdict}, without orientation in its class"


def _rate(d: Diagnosis, companions: tuple[str, ...]) -> Answer:
    named = set(d.verdict.split("+"))
    if "rate" in named and named - {"rate"} <= set(companions):
        return YES, f"the verdict is {d.verdict}"
    if "rate" in named:
        extra = " and ".join(sorted(named - {"rate", *companions}))
        return PART, f"rate is named, but {extra} beside it, which nothing in the tests asks for"
    if any("rate" in effects for effects in d.same_class):
        return PART, f"the verdict is {d.verdict}, with rate in its class"
    return NO, f"the verdict is {d.verdict}, and its class is without rate"


def _tape(d: Diagnosis) -> Answer:
    clear = [place.axis for place in d.where if place.p < SIGNIFICANT]
    if d.verdict == "none":
        return NO, (
            "the verdict is none: nothing but the column speed tells the three loops apart, so "
            "that they count as replicates, and their spread as scatter"
        )
    if "rate" in d.verdict.split("+"):
        return NO, "rate is named, whose speeds nobody knows"
    places = {"branch", "speed"} & set(clear)
    if d.verdict == "unknown" or len(d.same_class) > 1:
        return (YES if places else PART), (
            f"the verdict is {d.verdict}; places beyond chance: {', '.join(clear) or 'none'}"
        )
    return PART, f"the verdict is {d.verdict} alone, where softening and relaxation look alike"


def _thesis(d: Diagnosis) -> Answer:
    found = next((p.axis for p in d.where if p.p < SIGNIFICANT), "none")
    if d.verdict == "unknown" or "material-law" in d.verdict.split("+"):
        if found == "material":
            return YES, f"the verdict is {d.verdict}, and material the first place"
        return PART, f"the verdict is {d.verdict}, but the first place beyond chance is {found}"
    return NO, f"the verdict is {d.verdict}"


EXPECTATIONS: Mapping[str, Expectation] = MappingProxyType(
    {
        "silicones": Expectation(
            "Silicones: nothing to find",
            "Soft Robotics Materials Database, Marechal et al., Soft Robotics 2020, "
            "doi 10.1089/soro.2019.0115; ODbL, contents DbCL",
            "Four silicones by ASTM D412, one specimen each, one speed (450 mm/min), no "
            "temperature given. The palette is fitted to every other reading; the campaign is the "
            "readings between.",
            "None. Nothing may be claimed about rate or temperature.",
            _silicones,
            "That the silicones know no rate or temperature: one speed says nothing of either. The "
            "readings come from the specimens that the palette was fitted to, so that only the "
            "fit's own error is left: this is a control, not a test of the laws.",
        ),
        "calendered-rubber": Expectation(
            "Calendered rubber: direction",
            "Tests by J. Diani, as in the examples of Hyperelastics.jl (TRACER Lab); MIT",
            "One specimen along the calendering and one across it; stretch and stress read off a "
            "figure, time assumed. The palette is fitted along (x); across (y) is softer.",
            "Orientation, or a class with it: two specimens cannot tell more.",
            _orientation,
            "That the direction is the cause rather than anything else in which the two specimens "
            "differ: there is one of each, and no scatter was measured.",
        ),
        "adhesive-pulled": Expectation(
            "An adhesive, pulled and let go: rate",
            "C. Zhao, Viscoelastic material deformation calibration, 2024; MIT",
            "Eleven load-unload tests at 0.01, 0.03 and 0.05 strain per second to stretches of 1.5 "
            "to 3; kPa assumed. The palette is fitted to the loading at 0.01/s.",
            "Rate, alone or with softening or permanent set, as unloading lies far below loading; "
            "places: branch and crosshead speed.",
            lambda d: _rate(d, ("softening", "permanent-set")),
            "Which of relaxation, softening and set the unloading shows: over half a decade of "
            "speed, in first cycles alone, they are nearly the same.",
            {"curves": "Each test: measured, predicted by the palette, and with the verdict."},
            rates=True,
        ),
        "adhesive-sheared": Expectation(
            "An adhesive, sheared: rate",
            "C. Zhao, as above; MIT",
            "Eight tests, one each, over two decades of rate, four of them with holds; shear is "
            "given as the tension of the same first invariant. The palette is fitted to one "
            "monotonic test.",
            "Rate; places: crosshead speed and time.",
            lambda d: _rate(d, ()),
            "Relaxation at large strains: a diagnosis compares up to 2.5, and of the holds one set "
            "is at a strain of 3.3. Figures of the rate: three monotonic tests have a time that is "
            "even in a generalised strain and not in travel (the data "
            "to look at say so), so that their speeds are not to be relied on. Shear is "
            "equivalent to tension for energies of the first invariant alone.",
            {"curves": "Each test: measured, predicted by the palette, and with the verdict."},
            rates=True,
        ),
        "tape": Expectation(
            "Acrylic tape: speeds that were not published",
            "VHB 4910, as in the examples of Hyperelastics.jl (TRACER Lab); MIT",
            "Three load-unload loops at three speeds that are not known, read off a figure. The "
            "palette is fitted to the lowest loop's loading.",
            "Rate cannot be named, as its column is unknown; a class, or unknown, with the loop "
            "(column speed) and the branch as places.",
            _tape,
            "Anything of rate. Time is counted at one assumed speed for all.",
        ),
        "thesis": Expectation(
            "The thesis: Table 3.1 against Table 3.2",
            "S. Hemleben, M.S. thesis, Oregon State University, 2017; figures printed there",
            "Seven grades as stand-in curves with the modulus, area and elongation of Table 3.1; "
            "the palette is the Connex3's own, from the laws of Table 3.2.",
            "No effect of the library: unknown, or the materials' laws, with material as the "
            "place. The soft grades differ by 4 to 7 times in area, FLX9795 agrees.",
            _thesis,
            "Which of the two tables is right, or that any specimen behaved so: the curves between "
            "the printed figures are assumed, and the shape shows as a gap along strain. How the "
            "tables come to differ is another page's: [the thesis' numbers](thesis-numbers.md).",
        ),
    }
)
"""By the names of the campaigns."""

"""What each published set is, what a diagnosis of it should say, and whether it does."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from planner.errors import listed
from planner.gap.diagnosis import Diagnosis

__all__ = ["EXPECTATIONS", "Answer", "Expectation", "probability_with"]

Answer = tuple[str, str]
"""Yes, in part or no; and why, as the end of a sentence."""

YES, PART, NO = "yes", "in part", "no"
SIGNIFICANT = 0.05
_FIRST = 2
"""Places that a reader looks at."""


@dataclass(frozen=True)
class Expectation:
    """One set.

    Attributes
    ----------
    source
        With its licence.
    wanted
        What is expected, in as few words as a table holds.
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
    wanted: str
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


def _named(d: Diagnosis, *effects: str) -> Answer:
    """Whether one of these is the verdict, or stands in its class, without a companion."""
    classes = {"+".join(one) for one in d.same_class}
    words = " or ".join(effects)
    if d.verdict in effects:
        return YES, f"{d.verdict} is the verdict"
    alone = classes & set(effects)
    if alone:
        return YES, f"the verdict is {d.verdict}, and {' or '.join(sorted(alone))} is in its class"
    if set(effects) & set(d.verdict.split("+")):
        return PART, f"the verdict is {d.verdict}, with a companion that nothing asked for"
    if any(set(effects) & set(one) for one in d.same_class):
        return PART, f"the verdict is {d.verdict}; its class has {words}, but with a companion only"
    return NO, f"the verdict is {d.verdict}, without {words} in its class"


def _nothing(d: Diagnosis) -> Answer:
    if d.verdict == "none":
        return YES, "no gap is claimed"
    return NO, f"a false alarm: {d.verdict}"


def _nothing_but(d: Diagnosis, column: str) -> Answer:
    """Whether nothing is claimed; that something unknown goes with a column is no lie either."""
    if d.verdict == "unknown" and column in _clear(d):
        return PART, f"the verdict is unknown, along {column}, for differences within the scatter"
    return _nothing(d)


def _unclaimed(d: Diagnosis, column: str, *alike: str) -> Answer:
    """Whether it is unknown, along a column that no effect claims; `alike` are as good."""
    first = _clear(d)[:_FIRST]
    words = f"the verdict is {d.verdict}; first places beyond chance: {', '.join(first) or 'none'}"
    honest = any("+".join(one) in ("unknown", *alike) for one in ((d.verdict,), *d.same_class))
    if d.verdict == "none" or not honest:
        return NO, f"the verdict is {d.verdict}, where only {column} differs"
    return (YES if column in first else PART), words


def _told_apart(d: Diagnosis, specimens: tuple[str, ...], *verdicts: str) -> Answer:
    """Whether data quality names the specimens that are off and no other, and no more is made."""
    told = {q.specimen for q in d.data_quality}
    missed = listed([s for s in specimens if s not in told])
    others = listed(sorted(s for s in told if s and s not in specimens))
    words = f"the verdict is {d.verdict}; data quality names all that are off"
    words += f" but {missed}" if missed else ""
    words += f", and {others} too" if others else ""
    if d.verdict not in verdicts:
        return NO, words
    return (PART if missed or others else YES), words


def _wrong_area(d: Diagnosis) -> Answer:
    if d.verdict == "none":
        return PART, "the verdict is none: the specimens scatter by about as much"
    return _named(d, "cross-section", "force-scale")


def _not_ours(d: Diagnosis) -> Answer:
    if d.verdict == "unknown":
        return YES, "the verdict is unknown"
    return NO, f"the verdict is {d.verdict}, of laws that do not hold there"


def _clear(d: Diagnosis) -> list[str]:
    """Return the axes beyond chance, the largest share first as they are reported."""
    return [place.axis for place in d.where if place.p < SIGNIFICANT]


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
    clear = _clear(d)
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


def _laws(d: Diagnosis) -> Answer:
    found = next(iter(_clear(d)), "none")
    if d.verdict == "unknown" or "material-law" in d.verdict.split("+"):
        if found == "material":
            return YES, f"the verdict is {d.verdict}, and material the first place"
        return PART, f"the verdict is {d.verdict}, but the first place beyond chance is {found}"
    return NO, f"the verdict is {d.verdict}"


_MARECHAL = (
    "Soft Robotics Materials Database, Marechal et al., Soft Robotics 2020, "
    "doi 10.1089/soro.2019.0115; ODbL, contents DbCL"
)
_LIAO = "Liao et al., Sci. Data 2025, doi 10.1038/s41597-025-05738-7 (CMU B.O.R.G.); MIT"
_ONE_SPEED = (
    "Anything of rate or temperature: there was one speed, and no temperature was published. "
    "Strain is the crosshead's travel."
)


_ZERO = (
    "Seen after the expectation was written: once torn, the specimens' records stand at -0.2 to "
    "0.05 N, up to a tenth of the largest force and not the same for all, so that a wandering zero "
    "of force is no false cause in these tests."
)


def _untreated(resin: str, scatter: str, beyond: str = "") -> Expectation:
    return Expectation(
        f"{resin}, untreated: nothing to find",
        _LIAO,
        f"{resin}, three print sessions of two specimens, pulled at one speed. The palette is "
        f"fitted to the first two sessions. Specimens scatter by {scatter}.",
        "none",
        "None.",
        _nothing,
        f"{_ONE_SPEED} {beyond}".strip(),
    )


def _treated(resin: str, differs: str) -> Expectation:
    return Expectation(
        f"{resin}, treated",
        _LIAO,
        f"{resin}, three sessions of two specimens each untreated, in ethanol and autoclaved. The "
        f"palette is fitted to untreated ones of two sessions. {differs}",
        "unknown, by treatment",
        "Unknown, as no effect claims the column treatment, with treatment among the first places.",
        lambda d: _unclaimed(d, "treatment"),
        f"What a treatment does to the resin. {_ONE_SPEED}",
    )


EXPECTATIONS: Mapping[str, Expectation] = MappingProxyType(
    {
        "silicones": Expectation(
            "Silicones: nothing to find",
            _MARECHAL,
            "Four silicones by ASTM D412, one specimen each, one speed (450 mm/min), no "
            "temperature given. The palette is fitted to every other reading; the campaign is the "
            "readings between.",
            "none",
            "None. Nothing may be claimed about rate or temperature.",
            _silicones,
            "That the silicones know no rate or temperature: one speed says nothing of either. The "
            "readings come from the specimens that the palette was fitted to, so that only the "
            "fit's own error is left: this is a control, not a test of the laws.",
        ),
        "silicones-substituted": Expectation(
            "Silicones of the same hardness, from others",
            _MARECHAL,
            "Three silicones as above; in place of each, under its name, another of the same "
            "nominal hardness was pulled: about twice as stiff, a quarter stiffer, a fifth softer.",
            "unknown or material-law, by material",
            "Unknown, or the materials' laws, with material as the place.",
            _laws,
            "Which of the two is off, or that hardness says nothing of stiffness: one specimen of "
            "each was pulled, and hardness was not measured.",
        ),
        "calendered-rubber": Expectation(
            "Calendered rubber: direction",
            "Tests by J. Diani, as in the examples of Hyperelastics.jl (TRACER Lab); MIT",
            "One specimen along the calendering and one across it; stretch and stress read off a "
            "figure, time assumed. The palette is fitted along (x); across (y) is softer.",
            "orientation",
            "Orientation, or a class with it: two specimens cannot tell more.",
            lambda d: _named(d, "orientation"),
            "That the direction is the cause rather than anything else in which the two specimens "
            "differ: there is one of each, and no scatter was measured.",
        ),
        "adhesive-pulled": Expectation(
            "An adhesive, pulled and let go: rate",
            "C. Zhao, Viscoelastic material deformation calibration, 2024; MIT",
            "Eleven load-unload tests at 0.01, 0.03 and 0.05 strain per second to stretches of 1.5 "
            "to 3; kPa assumed. The palette is fitted to the loading at 0.01/s.",
            "rate",
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
            "rate",
            "Rate; places: crosshead speed and time.",
            lambda d: _rate(d, ()),
            "Figures of the rate: three monotonic tests have a time that is "
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
            "unknown or a class",
            "Rate cannot be named, as its column is unknown; a class, or unknown, with the loop "
            "(column speed) and the branch as places.",
            _tape,
            "Anything of rate. Time is counted at one assumed speed for all.",
        ),
        "borg-bioflex": _untreated("Bioflex A10", "5 %", _ZERO),
        "borg-bioflex-unw2": _untreated("Bioflex A10 washed in UNW2", "8 %", _ZERO),
        "borg-silicone": _untreated("Silicone 40A", "5 %"),
        "borg-dentagum": _untreated("DentaGUM", "3 %"),
        "borg-four-resins": Expectation(
            "Four resins, a session that the palette has not seen",
            _LIAO,
            "Two specimens each of four soft resins from a third print session; the palette is "
            "fitted to the first two. The session is within the scatter of the others.",
            "none",
            "None.",
            _nothing,
            _ONE_SPEED,
        ),
        "borg-own-gauges": Expectation(
            "DentaGUM, each specimen with its own gauge",
            _LIAO,
            "The untreated DentaGUM again, with the length between the grips as it was for each "
            "specimen (25 to 27 mm) rather than strain on a shared gauge.",
            "none",
            "None: how far apart the grips were is no cause of anything.",
            _nothing,
            _ONE_SPEED,
        ),
        "borg-bioflex-treated": Expectation(
            "Bioflex A10, treated: nothing beyond scatter",
            _LIAO,
            "Three sessions of two specimens each untreated, in ethanol and autoclaved; means "
            "differ by 4 % and less up to a strain of 0.7, specimens by 5 %.",
            "none",
            "None, or at most something unknown with treatment.",
            lambda d: _nothing_but(d, "treatment"),
            f"{_ONE_SPEED} {_ZERO}",
        ),
        "borg-silicone-treated": _treated(
            "Silicone 40A", "In ethanol it got 10 % stiffer, at a scatter of 3 to 5 %."
        ),
        "borg-dentagum-treated": _treated(
            "DentaGUM",
            "In ethanol it got 27 % stiffer at a strain of 0.1, 8 % at 0.5; "
            "autoclaved 10 % softer.",
        ),
        "borg-aquagray-treated": _treated(
            "Aqua-Gray",
            "It is rigid, and treated either way bears less than half the force. All curves are "
            "without their toe.",
        ),
        "borg-four-resins-treated": Expectation(
            "Four resins, treated",
            _LIAO,
            "All 72 specimens of four soft resins; the palette is fitted to untreated ones of two "
            "sessions. Two of the resins change with treatment, two do not.",
            "unknown, by treatment",
            "Unknown, with treatment or material among the first places: the treatments differ by "
            "material.",
            lambda d: max(
                (_unclaimed(d, axis) for axis in ("treatment", "material")),
                key=lambda answer: (NO, PART, YES).index(answer[0]),
            ),
            f"What a treatment does to a resin. {_ONE_SPEED}",
        ),
        "borg-wrong-area": Expectation(
            "A wash that shrank the sections, not measured",
            _LIAO,
            "Silicone 40A washed in another solvent has sections 23 % smaller; here the drawn "
            "section stands for them. The palette is fitted to well washed ones. Of the six "
            "specimens forces scatter by 13 % at a strain of 0.1 and by 25 % at 1.",
            "cross-section or force-scale",
            "Cross-section, or force-scale, which one drawn section cannot tell from it.",
            _wrong_area,
            "Why the specimens of this wash scatter so.",
        ),
        "borg-right-area": Expectation(
            "A wash that shrank the sections, measured",
            _LIAO,
            "The same six specimens with their sections as measured: the mean is then within 3 % "
            "up to a strain of 0.3 and 10 % low at 1, at a scatter of 13 to 25 %.",
            "none",
            "None.",
            _nothing,
            "That the wash does nothing to the resin: the scatter hides less than about a fifth.",
        ),
        "borg-session": Expectation(
            "A print session that came out at half the force",
            _LIAO,
            "Silicone 40A in the other wash, in ethanol: two sessions agree to 10 %, both "
            "specimens of a third bear 0.8 of their force at a strain of 0.3 and half at 1.2. The "
            "palette is fitted to the two.",
            "unknown or force-scale, by batch",
            "Unknown, or force-scale of some specimens, with batch among the first places.",
            lambda d: _unclaimed(d, "batch", "force-scale"),
            "What went wrong in that session.",
        ),
        "borg-raw": Expectation(
            "As recorded, with spikes and what came after the break",
            _LIAO,
            "Three autoclaved resins as recorded; the palette is fitted to what the authors kept "
            "of two sessions. One record rises steeply long after its break, two at their end.",
            "none, and three records named",
            "None, and the three records under data quality.",
            lambda d: _told_apart(
                d,
                (
                    "bioflex-ipa-Autoclave-3-1",
                    "silicone-ipa-Autoclave-1-1",
                    "silicone-ipa-Autoclave-2-1",
                ),
                "none",
            ),
            _ONE_SPEED,
        ),
        "borg-slack": Expectation(
            "A rigid resin with toes: slack",
            _LIAO,
            "Five specimens of Aqua-Gray, 7 mm between the grips, whose curves begin with 0.1 to "
            "0.35 mm of travel without load. The palette is fitted to curves without their toe.",
            "grip-slack",
            "Grip slack, or a class with it, as the specimens' slacks differ.",
            lambda d: _named(d, "grip-slack"),
            "The resin's modulus: travel is the crosshead's, over a gauge of 7 mm.",
        ),
        "borg-softened": Expectation(
            "A rigid resin with one softened specimen",
            _LIAO,
            "DentaGUIDE untreated with its toes, one of five specimens softened by heat to a fifth "
            "of the others' force. The palette is fitted to two others, without their toe.",
            "one specimen named",
            "The softened specimen under data quality; of the others grip slack, unknown or none.",
            lambda d: _told_apart(
                d,
                ("dentaguide-NS-2-1-low_force_softened",),
                "none",
                "unknown",
                "grip-slack",
            ),
            "The resin's modulus: travel is the crosshead's, over a gauge of 7 mm.",
        ),
        "borg-compression": Expectation(
            "Pressed, with laws of pulls",
            _LIAO,
            "Discs of four soft resins, 5 mm high and 11.5 mm wide, pressed between platens from a "
            "preload of 1 N; travel and force count negative. The palette is fitted to pulls.",
            "unknown",
            "Unknown: nothing here predicts a disc that is pressed.",
            _not_ours,
            "Anything of the resins: friction at the platens, the preload and the laws in "
            "compression all differ.",
        ),
        "thesis": Expectation(
            "The thesis: Table 3.1 against Table 3.2",
            "S. Hemleben, M.S. thesis, Oregon State University, 2017; figures printed there",
            "Seven grades as stand-in curves with the modulus, area and elongation of Table 3.1; "
            "the palette is the Connex3's own, from the laws of Table 3.2.",
            "unknown or material-law, by material",
            "No effect of the library: unknown, or the materials' laws, with material as the "
            "place. The soft grades differ by 4 to 7 times in area, FLX9795 agrees.",
            _laws,
            "Which of the two tables is right, or that any specimen behaved so: the curves between "
            "the printed figures are assumed, and the shape shows as a gap along strain. How the "
            "tables come to differ is another page's: [the thesis' numbers](thesis-numbers.md).",
        ),
    }
)
"""By the names of the campaigns."""

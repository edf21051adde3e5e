"""What the operator reads beside the files: the printer's steps, and what is true of this plan."""

from collections.abc import Sequence

from planner.formats.markdown import as_words
from planner.grading.profile import StiffnessScale
from planner.plan import Finding
from planner.printers import Printer

__all__ = ["job_notes"]


def job_notes(
    machine: Printer,
    scale: StiffnessScale,
    *,
    resins: Sequence[str],
    findings: Sequence[Finding],
    warnings: Sequence[str],
) -> str:
    """Return the printer's how-to (Markdown), with what of it depends on palette and part.

    Parameters
    ----------
    resins
        What the plan's materials are jetted from.
    findings
        What will not come out as planned; told as they are.
    warnings
        What to know of the stiffness of the materials used.
    """
    palette = scale.palette
    lines = [
        machine.job_notes().rstrip(),
        "",
        "## This plan",
        "",
        f"- Resins to load: {', '.join(f'**{as_words(resin)}**' for resin in resins)}; support "
        f"{as_words(machine.support)}.",
        f"- Palette {as_words(palette.name)}: {as_words(_conditions(scale))}.",
        *(f"- {_sentence(warning)}" for warning in warnings),
    ]
    if findings:
        lines += ["", "What will not come out as planned:", ""]
        lines += [f"- {_sentence(found.message)}" for found in findings]
    return "\n".join(lines) + "\n"


def _conditions(scale: StiffnessScale) -> str:
    """Say how the palette's materials were measured."""
    reference = scale.palette.reference
    known = [
        f"at {reference.temperature_C:g} degC" if reference.temperature_C is not None else "",
        f"at a strain rate of {reference.strain_rate_per_s:g} per s"
        if reference.strain_rate_per_s is not None
        else "",
        f"{reference.age_days:g} days after printing" if reference.age_days is not None else "",
        {None: "", 0.0: "without soaking"}.get(
            reference.soak_h, f"after {reference.soak_h:g} h in water" if reference.soak_h else ""
        ),
        f"with the gauge along {reference.orientation} of the tray"
        if reference.orientation is not None
        else "",
    ]
    said = ", ".join(text for text in known if text)
    if not said:
        return "it does not say how its materials were measured"
    return f"its materials were measured {said}; otherwise they are stiffer or softer"


def _sentence(text: str) -> str:
    text = as_words(text)
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")

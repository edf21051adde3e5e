"""planner materials."""

from planner.cli.options import AsJson, AtStrain, PaletteName, PrinterName, choose

__all__ = ["materials"]


def materials(
    printer: PrinterName = "connex3",
    palette: PaletteName = None,
    at_strain: AtStrain = 0.1,
    as_json: AsJson = False,
) -> int:
    """List a palette's materials from soft to hard, with their stiffness.

    Example: [bold]planner materials --at-strain 0.3[/bold]
    """
    from planner.cli.output import figure, print_document, print_table
    from planner.grading.stiffness_scale import stiffness_scale

    _, chosen = choose(printer, palette)
    scale = stiffness_scale(chosen, at_strain)
    if as_json:
        rows = [
            {
                "id": material.id,
                "coordinate": material.coordinate,
                "modulus_MPa": modulus,
                "modulus_interval_MPa": list(interval),
                "elongation_at_break": material.elongation_at_break,
                "density_g_cm3": material.density_g_cm3,
                "deformation": material.deformation,
                "aliases": list(material.aliases),
                "colour": material.colour,
            }
            for material, modulus, interval in zip(
                chosen.materials, scale.moduli_MPa, scale.intervals_MPa, strict=True
            )
        ]
        print_document(
            {"schema": 1, "palette": chosen.name, "at_strain": at_strain, "materials": rows}
        )
        return 0
    print_table(
        ["material", "m", "modulus MPa", "95 % interval", "break", "g/cm3", "also called"],
        [
            [
                material.id,
                f"{material.coordinate:.3f}",
                figure(modulus),
                f"{figure(interval[0])} .. {figure(interval[1])}",
                f"{100 * material.elongation_at_break:.0f} %",
                f"{material.density_g_cm3:.3f}",
                ", ".join(material.aliases),
            ]
            for material, modulus, interval in zip(
                chosen.materials, scale.moduli_MPa, scale.intervals_MPa, strict=True
            )
        ],
        title=f"{chosen.name}: secant modulus at strain {at_strain:g}",
        right=["m", "modulus MPa", "break", "g/cm3"],
        droppable=["also called", "g/cm3", "break"],
        swatches=[material.colour for material in chosen.materials],
    )
    return 0

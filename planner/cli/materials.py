"""planner materials, invert, fit and characterise: what can be printed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

import planner
from planner.cli import output as cli
from planner.errors import ArgumentError, refused
from planner.glance import format_interval, format_number

_AtStrain = Annotated[
    float, "Working strain: stiffness is the secant modulus of the nominal stress up to it."
]

# ------------------------------------------------------------------------------------------------
# planner materials.


def materials(
    names: Annotated[
        list[str] | None, Argument(help="Materials whose laws --as writes; all by default.")
    ] = None,
    printer: cli.PrinterName = "connex3",
    palette: cli.PaletteName = None,
    at_strain: _AtStrain = 0.1,
    temperature_C: Annotated[float | None, "--temperature-C"] = None,
    output: cli.Output = None,
    figure: Path | None = None,
    as_program: Annotated[str | None, "--as"] = None,
    force: cli.Overwrite = False,
) -> int:
    """List a palette's materials from soft to hard, with their stiffness.

    Examples: [bold]planner materials --at-strain 0.3 --figure ladder.svg[/bold],
    [bold]planner materials FLX9760 --as abaqus[/bold],
    [bold]planner materials --palette lab.toml --temperature-C 33 -o warm.toml[/bold]

    Parameters
    ----------
    temperature_C
        The palette as it is there, by its table of temperatures.
    output
        Palette file to write, with --temperature-C.
    figure
        SVG file to write: the ladder with its interval, each material's stress.
    as_program
        Print their laws instead, to paste: abaqus, ansys or febio.
    """
    if output is not None and temperature_C is None:
        raise ArgumentError("-o writes the palette at another temperature: give --temperature-C")
    scale = cli.run(planner.list_materials)
    every = scale.palette
    if as_program is not None:
        if output is not None or figure is not None:
            raise ArgumentError("--as prints laws and writes no file: leave out --output, --figure")
        chosen_ones = [every.resolve(name) for name in names or ()] or every.materials
        blocks = {m.id: planner.law_block(m, as_program, k) for k, m in enumerate(chosen_ones, 1)}
        told = {"schema": 1, "palette": every.name, "blocks": blocks}
        if cli.in_words(lambda: told):
            cli.say("\n".join(blocks.values()).rstrip())
        return 0
    if names:
        raise ArgumentError(
            f"materials {' '.join(names)}: all are listed, so name none; laws of these alone are "
            "printed with --as abaqus, ansys or febio"
        )
    cli.check_targets(force=force, figure=figure, output=output)
    if output is not None:
        planner.write_palette(every, output, force=force)
    cli.write_asked(figure, lambda: planner.materials_figure(scale))
    if cli.in_words(scale.document):
        _print_ladder(scale)
        cli.tell_notes([*scale.warming, *scale.remarks()])
        cli.say(*(f"wrote {written}" for written in (output, figure) if written))
    return 0


def _print_ladder(scale: "planner.StiffnessScale") -> None:
    rows = []
    each = zip(scale.palette.materials, scale.moduli_MPa, scale.intervals_MPa, strict=True)
    for material, modulus, interval in each:
        stiffness = [format_number(modulus), format_interval(interval)]
        past = " (past it)" if scale.broken(material) else ""
        breaks = f"{100 * material.elongation_at_break:.0f} %{past}"
        density = material.density_g_cm3
        others = ["-" if density is None else f"{density:.3f}", ", ".join(material.aliases)]
        rows.append([material.id, f"{material.coordinate:.3f}", *stiffness, breaks, *others])
    cli.print_table(
        ["material", ">m", ">modulus MPa", "95 % interval", ">break", ">g/cm3", "also called"],
        rows,
        title=f"{scale.palette.name}: secant modulus at strain {scale.at_strain:g}",
        droppable=["also called", "g/cm3", "break"],
        swatches=[material.colour for material in scale.palette.materials],
    )


# ------------------------------------------------------------------------------------------------
# planner invert.


def invert(
    modulus_MPa: Annotated[list[str] | None, "--modulus", "-m"] = None,
    coordinate: list[float] | None = None,
    at_strain: _AtStrain = 0.1,
    law: str | None = None,
    printer: cli.PrinterName = "connex3",
    palette: cli.PaletteName = None,
) -> int:
    """Find the digital material, and the blend of two, that has a wanted stiffness.

    With --coordinate: what stands at a place of the palette. Exit code 1 when a modulus is out of
    reach; the nearest that can be printed is reported.

    Examples: [bold]planner invert --modulus 1.2 --at-strain 0.2[/bold],
    [bold]planner invert --coordinate 0.4 --law ogden-2[/bold]

    Parameters
    ----------
    modulus_MPa
        Wanted modulus in MPa, or with its unit (500kPa); repeatable.
    coordinate
        Or the reverse: a coordinate whose stiffness and law are told; repeatable.
    law
        Law that stands for it: neo-hookean, yeoh, martins, ogden-1, -2, -3, yielding, or
        ogden-thesis (eq. 3.8, its coefficients as quadratics of m); a coordinate gets one of its
        neighbours' kind.
    """
    from planner.printers import palette_of

    if not modulus_MPa and not coordinate:
        raise ArgumentError("give --modulus, a wanted modulus in MPa, or --coordinate, a place")
    chosen = palette_of(palette, printer)
    ask = partial(planner.invert, at_strain=at_strain, law=law, palette=chosen)
    found = [ask(modulus) for modulus in modulus_MPa or ()]
    at = [ask(coordinate=place) for place in coordinate or ()]
    said = {"schema": 1, "palette": chosen.name, "at_strain": at_strain}
    if cli.in_words(lambda: {**said, "results": [m.document() for m in (*found, *at)]}):
        title = f"{chosen.name}: secant modulus at strain {at_strain:g}"
        if found:
            _print_wanted(found, title)
        if at:
            _print_places(at, title)
        _print_laws([*found, *at])
        cli.tell_notes(note for mixture in (*found, *at) for note in mixture.notes)
        for mixture in found:
            if not mixture.reachable:
                cli.finding(
                    f"{mixture.target_MPa:g} MPa is out of reach: the palette goes from "
                    f"{' to '.join(format_number(end) for end in mixture.range_MPa)} MPa; the "
                    f"nearest is {mixture.nearest}"
                )
    return 0 if all(mixture.reachable for mixture in found) else 1


def _print_wanted(found: "Sequence[planner.Mixture]", title: str) -> None:
    rows = []
    for mixture in found:
        if (target := mixture.target_MPa) is not None:
            near, blend = _nearest(mixture, target), mixture.blend_text()
            place = f"{mixture.blend.coordinate:.4f}"
            rows.append([format_number(target, 4), *near, blend, place, *_stiffness(mixture)])
    columns = [">target MPa", "nearest", ">MPa", ">error", "blend", ">m", ">MPa", "95 % interval"]
    cli.print_table(columns, rows, title=title, droppable=["95 % interval", "error"])


def _nearest(mixture: "planner.Mixture", wanted_MPa: float) -> tuple[str, str, str]:
    """Return the cells of the nearest material: its name, modulus and error."""
    modulus = mixture.nearest_modulus_MPa
    return mixture.nearest, format_number(modulus, 4), f"{100 * (modulus / wanted_MPa - 1):+.1f} %"


def _stiffness(found: Any) -> tuple[str, str]:
    """Return the cells of a mixture's modulus, also at another strain, and of its interval."""
    return format_number(found.modulus_MPa, 4), format_interval(found.interval_MPa)


def _print_places(found: "Sequence[planner.Mixture]", title: str) -> None:
    """Print what stands at coordinates: stiffness, nearest material, further strains, laws."""
    rows, secants = [], []
    for mixture in found:
        place, near = f"{mixture.blend.coordinate:g}", _nearest(mixture, mixture.modulus_MPa)
        rows.append([place, mixture.blend_text(), *_stiffness(mixture), *near])
        for number, one in enumerate(mixture.secants):
            secants.append(["" if number else place, f"{one.strain:g}", *_stiffness(one)])
    columns = [">m", "blend", ">MPa", "95 % interval", "nearest", ">MPa", ">error"]
    cli.print_table(columns, rows, title=title, droppable=["error"])
    title = "Secant moduli (stress is strain times it; strain 0: at rest)"
    cli.print_table([">m", ">strain", ">secant MPa", "95 % interval"], secants, title=title)


def _print_laws(found: "Sequence[planner.Mixture]") -> None:
    for mixture in found:
        if mixture.law is None:
            continue
        parameters = "; ".join(
            f"{symbol} {', '.join(format_number(v, 4) for v in values)}"
            for symbol, values in mixture.law.law.parameters.items()
        )
        error = f" ({100 * mixture.law.error:.2g} % RMS off the blend)" if mixture.law.error else ""
        where = f"m {mixture.blend.coordinate:g}"
        cli.say(f"{where}: {mixture.law.law.model} law, {parameters}{error}")


# ------------------------------------------------------------------------------------------------
# What `characterise` and `fit` read.


_TensileFiles = Annotated[
    list[Path],
    "Files of tests (CSV, text, XLSX, XLS, ODS, as machines write them), or folders; a "
    "specimens.csv among or beside them is used.",
]


@dataclass(frozen=True)
class _TensileTests:
    """How tests are read, and what they are compared with.

    Attributes
    ----------
    specimens
        List of specimens: material, size, file.
    material
        What all specimens without a row are made of.
    width_mm
        Width of specimens without a row.
    thickness_mm
        Thickness of specimens without a row.
    gauge_mm
        Gauge length of specimens without a row.
    columns
        Headings in place of the files' own, by position: 'stretch,stress_MPa', '-' leaves a column
        out.
    unit_of
        Read force, travel, stress or strain in another unit than the files say, as in
        force=lbf:S1,S2 (specimens or materials) or, for all, travel=in; repeatable.
    mode
        How specimens were loaded whose row has no mode: tension, compression, planar or
        equibiaxial.
    blocks
        Blocks of numbers in one sheet that nothing names: join (one record) or apart (specimens).
    leave_out
        Specimen or material to leave out; repeatable.
    palette
        Palette to hold the tests against, a file (TOML) or one of the printer's; else its default.
    compare
        Hold materials that the palette names against it: was a unit taken for another?
    """

    specimens: Path | None = None
    material: str | None = None
    width_mm: float | None = None
    thickness_mm: float | None = None
    gauge_mm: float | None = None
    columns: str | None = None
    unit_of: list[str] | None = None
    mode: str | None = None
    blocks: str | None = None
    leave_out: list[str] | None = None
    printer: cli.PrinterName = "connex3"
    palette: str | None = None
    compare: bool = True

    def headings(self) -> Sequence[str] | None:
        """Return the headings in place of the files' own, if there are any."""
        return self.columns and [name.strip() for name in self.columns.split(",")]


# ------------------------------------------------------------------------------------------------
# planner characterise.


def characterise(
    files: _TensileFiles,
    output: cli.Output = None,
    *,
    tests: _TensileTests,
    at_strain: list[float] | None = None,
    figure: Path | None = None,
    force: cli.Overwrite = False,
) -> int:
    """Take modulus, toughness, elongation and their spread from tensile tests.

    Says whether each material deforms elastically (a law of rubber fits) or plastically (one that
    yields). Exit code 1 when a material's specimens disagree about that or are more than twice
    apart, or a figure looks like a wrong unit, also beside the printer's palette.

    Example: [bold]planner characterise tests/*.csv --width-mm 3 --thickness-mm 2 --gauge-mm 15 -o
    materials.csv --figure tests.svg[/bold]

    Parameters
    ----------
    output
        CSV file to write, one row a material.
    at_strain
        Strain of a secant modulus; repeatable.
    figure
        SVG file to write: each curve with its toe, modulus, yield and break.
    """
    from planner.formats.files import encode_document
    from planner.materials.study import listed_files

    reads = listed_files(files, tests.specimens)
    cli.check_targets(force=force, reads=reads, output=output, figure=figure)
    found = cli.run(planner.characterise, columns=tests.headings())
    cli.write_asked(output, found.csv)
    cli.write_asked(figure, lambda: planner.characterisation_figure(found))
    if cli.in_words(lambda: encode_document(found.document())):
        _print_records(found)
        cli.tell_notes((*found.notes, *_corrections(found)))
        _tables(found)
        for one in found.materials:
            cli.say(f"{one.material}: {one.deformation.kind}; {one.deformation.reason}")
        cli.say(*(f"wrote {path}" for path in (output, figure) if path))
        cli.finding(*found.findings)
    return 0 if found.ok else 1


def _print_records(found: "planner.Characterisation") -> None:
    """Say what was read; columns and places of sizes, alike in many records, by their number."""
    columns: dict[str, int] = {}
    places: dict[str, int] = {}
    rows = []
    for one in found.records:
        unused = f"; not used: {', '.join(one.unused)}" if one.unused else ""
        headed = columns.setdefault(", ".join(one.columns.values()) + unused, len(columns) + 1)
        sizes = [
            "-" if value is None
            else f"{format_number(value, 4)} [{places.setdefault(where, len(places) + 1)}]"
            for value, where in ((one.gauge_mm, one.gauge_from), (one.area_mm2, one.area_from))
        ]  # fmt: skip
        file = f"{one.file}, {one.sheet}" if one.sheet else one.file
        mode = f"left out: {one.left_out}" if one.left_out else one.mode
        read = [file, one.specimen, one.material, mode, f"({headed})", *sizes, str(one.rows)]
        rows.append(read)
    named = ["file", "specimen", "material", "mode", "columns"]
    figures = [">length mm", ">section mm2", ">rows"]
    cli.print_table([*named, *figures], rows, title="What was read")
    cli.say(*(f"({number}): {text}" for text, number in columns.items()))
    cli.say(*(f"[{number}]: {text}" for text, number in places.items()))


def _corrections(found: "planner.Characterisation") -> list[str]:
    """Return the notes on single specimens, and one line for strains left as recorded."""
    specimens = [c for one in found.materials for c in one.specimens]
    lines = [note for c in specimens for note in c.notes if "not shifted" not in note]
    if unshifted := [c for c in specimens if not c.toe_strain]:
        of = f"{len(unshifted)} of {len(specimens)} specimens show no toe; their strains"
        of = of if len(unshifted) < len(specimens) else "no specimen shows a toe; strains"
        lines.append(f"{of} are as recorded (--json says why for each)")
    return lines


def _tables(found: "planner.Characterisation") -> None:
    def told(one: Any, name: str) -> str:
        if name == "deforms":
            return f"{one.deformation.kind}ally"
        spread = one.spreads.get(name)
        if spread is None:
            return "-"
        cv = "" if spread.cv is None else f" ±{100 * spread.cv:.1f} %"
        return format_number(spread.mean) + cv

    moduli = {"modulus_MPa": ">E"}
    if any(c.toe_strain for one in found.materials for c in one.specimens):
        moduli["modulus_uncompensated_MPa"] = ">with toe"
    for name in (n for one in found.materials for n in one.spreads if n.startswith("secant")):
        moduli[name] = f">at {name.split('_')[1]}"
    breaks = {
        "strength_MPa": ">strength MPa",
        "elongation_at_break": ">strain at break",
        "toughness_MJ_m3": ">toughness MJ/m3",
        "deforms": "deforms",
    }
    for title, names in (
        ("Young's and secant moduli (MPa), mean ± coefficient of variation over specimens", moduli),
        ("Break", breaks),
    ):
        rows = [
            [one.material, str(one.n), *(told(one, name) for name in names)]
            for one in found.materials
        ]
        cli.print_table(["material", ">n", *names.values()], rows, title=title)


# ------------------------------------------------------------------------------------------------
# planner fit.


def fit(
    files: _TensileFiles,
    output: Annotated[Path, "--output", "-o"] = Path("palette.toml"),
    *,
    law: str = "all",
    name: str | None = None,
    weighting: str = "relative",
    coordinate: list[str] | None = None,
    order: str | None = None,
    density: list[str] | None = None,
    starts: Annotated[int, Option(min=1, max=2000, help="Starts of each search.")] = 50,
    level: Annotated[float, Option(min=0.5, max=0.999, help="Coverage of the intervals.")] = 0.95,
    coefficients: str | None = None,
    tests: _TensileTests,
    figure: Path | None = None,
    tables: Path | None = None,
    force: cli.Overwrite = False,
) -> int:
    """Fit laws to tensile tests, choose one a material, and write a palette with intervals.

    Exit code 1 when the palette cannot be used as it is, when replicates are more than twice
    apart, or when a law describes its material badly.

    Example: [bold]planner fit samples/tensile -o lab.toml --figure lab.svg --tables lab[/bold]

    Parameters
    ----------
    output
        Palette file (TOML) to write.
    law
        neo-hookean, yeoh, martins, ogden, ogden-1, -2 or -3 (terms), or all: the best is chosen.
    name
        Name of the palette; else that of the file.
    weighting
        Residuals relative to the stress, or absolute.
    coordinate
        ID=M, repeatable; else 0..1 in order of stiffness.
    order
        All materials from soft to hard, with commas, where tests leave it open.
    density
        ID=G_CM3, repeatable.
    coefficients
        quadratic: also run Algorithm 1 of Hemleben's thesis, coefficients as quadratics of m, and
        compare what it predicts; the palette is the same.
    figure
        SVG file to write: tests over laws, residuals, mixtures between.
    tables
        Folder to write: the tables as CSV, with intervals.
    """
    instead = {
        "name": name or output.stem,
        "coordinate": _figures(coordinate, "--coordinate"),
        "order": order and [each.strip() for each in order.split(",")],
        "density": _figures(density, "--density"),
        "columns": tests.headings(),
    }
    from planner.formats.files import encode_document
    from planner.formats.outputs import write_folder
    from planner.materials.study import listed_files

    reads, targets = listed_files(files, tests.specimens), {"output": output, "figure": figure}
    cli.check_targets(force=force, reads=reads, **targets, tables=(tables, _TABLES))
    with cli.progress() as stage:
        result = cli.run(planner.fit, **instead, progress=stage)
    planner.write_palette(result.palette, output, force=force)
    cli.write_asked(figure, lambda: planner.fit_figure(result))
    if tables is not None:
        record = encode_document({"schema": 1, "palette": output.name})
        rows = {**planner.fit_tables(result), _TABLES: record}
        write_folder(tables, rows, force=force, record=_TABLES, option="tables")
    if cli.in_words(lambda: encode_document({**result.document(), "file": str(output)})):
        cli.tell_notes(result.notes)
        _print_report(result, output)
        cli.say(*(f"wrote {path}" for path in (figure, tables) if path))
        cli.finding(*result.findings)
        if result.problem is not None:
            cli.finding(
                f"{result.problem}; planner cannot grade, invert or list materials with this "
                "palette"
            )
    return 0 if result.ok else 1


_TABLES = "tables.json"
"""The record of a folder of tables."""


def _figures(given: Sequence[str] | None, option: str) -> dict[str, float]:
    """Read repeated ID=NUMBER options."""
    figures = {}
    for text in given or ():
        key, _, value = text.rpartition("=")
        said = "write ID=NUMBER, as FLX9760=0.5"
        with refused(ArgumentError, f"{option} {text!r}", said, ValueError):
            figures[key.strip()] = float(value)
    return figures


def _print_report(result: "planner.PaletteStudy", output: Path) -> None:
    interval = f"{100 * next(iter(result.fits.values())).uncertainty.level:g} % interval"
    _print_candidates(result)
    _print_parameters(result, interval)
    _print_secants(result, interval)
    for name, fit in result.fits.items():
        cli.say(f"{name}: {fit.choice.reason}")
        cli.say(f"  intervals: {fit.uncertainty.basis}")
    _print_quadratic(result)
    cli.say(f"palette {result.palette.name} written to {output}")


def _print_candidates(result: "planner.PaletteStudy") -> None:
    rows = []
    for name, fit in result.fits.items():
        of = [name, str(fit.characteristics.n)]
        for one in fit.choice.candidates:
            tried, at = one.fit, one.unstable_strain
            law = f"{'*' if tried.parameters is fit.law else ' '} {tried.name}"
            r2 = [f"{tried.r2:.5f}", f"{tried.adjusted_r2:.5f}", f"{100 * tried.nrmse:.2f} %"]
            errors = [f"{100 * one.held_out_error:.2f} %", *r2]
            stable = "yes" if at is None else f"falls at {format_number(at, 2)}"
            starts = f"{tried.starts_agreeing}/{tried.starts}"
            rows.append([*of, law, str(tried.parameter_count), *errors, stable, starts])
            of = ["", ""]
    figures = [">held out", ">R2", ">adj. R2", ">nRMSE"]
    if rows:
        columns = ["material", ">n", "law", ">k", *figures, "stable", ">starts"]
        title = "Laws tried (* chosen; k parameters; held out: error on what is left out)"
        cli.print_table(columns, rows, title=title)


def _print_parameters(result: "planner.PaletteStudy", interval: str) -> None:
    rows = []
    for name, fit in result.fits.items():
        known = fit.uncertainty
        first, spread = [name, fit.law.model], f"{100 * fit.scatter.log_sd:.1f} %"
        for symbol, values in fit.law.parameters.items():
            ends = zip(known.law_low[symbol], known.law_high[symbol], strict=True)
            for number, (value, (low, high)) in enumerate(zip(values, ends, strict=True), start=1):
                label = symbol if len(values) == 1 else f"{symbol} [{number}]"
                figures = [format_number(value, 4), _interval(low, high), spread]
                rows.append([*first, label, *figures])
                first, spread = ["", ""], ""
    columns = ["material", "law", "parameter", ">value", interval, ">next print's sd"]
    cli.print_table(columns, rows, title="Parameters")


def _print_secants(result: "planner.PaletteStudy", interval: str) -> None:
    rows = []
    for name, fit in result.fits.items():
        for k, one in enumerate(fit.secants):
            ends = one.low_MPa, one.high_MPa
            sure = _interval(*ends) if math.isfinite(one.high_MPa) else "unknown"
            value = format_number(one.value_MPa, 4)
            rows.append(["" if k else name, f"{one.strain:g}", value, sure])
    if rows:
        title = "Secant moduli of the mean (stress is strain times it; strain 0: at rest)"
        cli.print_table(["material", ">strain", ">secant MPa", interval], rows, title=title)


def _print_quadratic(result: "planner.PaletteStudy") -> None:
    if (found := result.quadratic) is None:
        return
    names = [f"c{number}" for number in range(1, 7)]
    rows = [
        [row.id, f"{row.curve.coordinate:.3g}", *(format_number(c, 4) for c in row.fit.c)]
        for row in found.rows
    ]
    title = "Algorithm 1, lines 1 to 3: eq. 3.8 of each material (Hemleben 2017)"
    cli.print_table(["material", ">m", *(f">{name}" for name in names)], rows, title=title)
    each = zip(names, found.quadratics.model.rows, strict=True)
    rows = [[name, *(format_number(q, 4) for q in row)] for name, row in each]
    title = "Algorithm 1, lines 4 to 7: c = q2 m² + q1 m + q0"
    cli.print_table(["", ">q2", ">q1", ">q0"], rows, title=title)
    fits = [">R2: eq. 3.8", ">quadratics", ">palette's law"]
    left_out = [">left out: quadratics", ">mixtures"]
    rows = []
    for row in found.rows:
        *own, quadratics, mixtures = row.errors.values()
        fitted = [f"{one.r2:.4f}" for one in own if one]
        predicted = [f"{100 * one.nrmse:.1f} %" if one else "-" for one in (quadratics, mixtures)]
        rows.append([row.id, *fitted, *predicted])
    title = "How well each fits; and the error of what the other materials predict"
    cli.print_table(["material", *fits, *left_out], rows, title=title)
    cli.say(*found.remarks())


def _interval(low: float, high: float) -> str:
    """Write an interval with as many digits as tell its ends apart; an open end is said so."""
    if math.isinf(low) and math.isinf(high):
        return "unknown"
    texts: list[str] = []
    for digits in (3, 4, 5, 6):
        texts = [format_number(v, digits) if math.isfinite(v) else "open" for v in (low, high)]
        if texts[0] != texts[1]:
            break
    return " .. ".join(texts)

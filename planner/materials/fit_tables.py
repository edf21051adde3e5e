"""The tables of a fit as CSV: characteristics, laws with intervals, and Algorithm 1's."""

from collections.abc import Sequence

from planner.formats.tables import encode_csv
from planner.materials.palette_study import Characterisation, PaletteStudy
from planner.materials.quadratic_study import QuadraticStudy

__all__ = ["fit_tables"]


# ------------------------------------------------------------------------------------------------
# Named after what they hold; they are Tables 3.1, 3.2 and 4.1 of Hemleben's thesis for one's own
# tests. Numbers have nine significant digits; an empty cell means unknown, or an open end.


_Row = Sequence[str | float | None]

_COEFFICIENTS = tuple(f"c{number}" for number in range(1, 7))


def fit_tables(study: PaletteStudy) -> dict[str, bytes]:
    """Return the tables of a fit as CSV, by the name of their files.

    ``characteristics.csv`` is that of `Characterisation.csv`, ``laws.csv`` has a row for each
    parameter of each law, ``r2.csv`` the R2 of each law that was tried (the thesis' Table 4.1).
    Where `fit` ran Algorithm 1: ``coefficients.csv``, eq. 3.8 of each material;
    ``quadratics.csv``, its coefficients over m; ``goodness.csv``, R2 and errors of each way, also
    of what the other materials predict.

    Parameters
    ----------
    study
        What `planner.fit` returns.

    Returns
    -------
    dict of str to bytes
        The tables.

    Examples
    --------
    >>> tables = planner.fit_tables(planner.fit(["samples/tensile"]))  # doctest: +SKIP
    >>> Path("laws.csv").write_bytes(tables["laws.csv"])  # doctest: +SKIP
    """
    materials = study.palette.materials
    found = Characterisation(tuple(study.fits[m.id].characteristics for m in materials))
    tables = {
        "characteristics.csv": found.csv(), "laws.csv": _laws(study), "r2.csv": _r2(study),
    }  # fmt: skip
    if study.quadratic is not None:
        tables["coefficients.csv"] = _coefficients(study.quadratic)
        tables["quadratics.csv"] = _quadratics(study.quadratic)
        tables["goodness.csv"] = _goodness(study.quadratic)
    return tables


def _laws(study: PaletteStudy) -> bytes:
    header = ["material", "coordinate", "law", "parameter", "term", "value", "low", "high"]
    rows: list[_Row] = []
    for material in study.palette.materials:
        known = study.fits[material.id].uncertainty
        for symbol, values in material.law.parameters.items():
            ends = zip(known.law_low[symbol], known.law_high[symbol], strict=True)
            for term, (value, (low, high)) in enumerate(zip(values, ends, strict=True), start=1):
                rows.append(
                    [
                        material.id, material.coordinate, material.law.model, symbol, term, value,
                        low, high, known.level, known.specimens, known.r2, known.nrmse,
                        known.held_out_error,
                    ]
                )  # fmt: skip
    more = ["level", "specimens", "r2", "nrmse", "held_out_error"]
    return encode_csv([[*header, *more], *rows])


def _r2(study: PaletteStudy) -> bytes:
    rows: list[dict[str, str | float | None]] = []
    literal = {} if study.quadratic is None else {row.id: row for row in study.quadratic.rows}
    for material in study.palette.materials:
        fit = study.fits[material.id]
        tried = {c.fit.name: c.fit.r2 for c in (fit.choice.candidates if fit.choice else ())}
        row: dict[str, str | float | None] = {"material": material.id, **tried}
        row[fit.chosen_name] = fit.uncertainty.r2
        if material.id in literal:
            row["eq_3_8"] = literal[material.id].own.r2
            row["quadratics"] = literal[material.id].quadratics.r2
        rows.append({**row, "chosen": fit.chosen_name})
    header = list(dict.fromkeys(["material", "chosen", *(key for row in rows for key in row)]))
    return encode_csv([header, *([row.get(key) for key in header] for row in rows)])


def _coefficients(found: QuadraticStudy) -> bytes:
    rows: list[_Row] = [
        [row.id, row.curve.coordinate, name, c, c - half, c + half]
        for row in found.rows
        for name, c, half in zip(_COEFFICIENTS, row.fit.c, row.fit.half, strict=True)
    ]
    return encode_csv([["material", "coordinate", "coefficient", "value", "low", "high"], *rows])


def _quadratics(found: QuadraticStudy) -> bytes:
    rows: list[_Row] = [
        [name, *last, *through]
        for name, last, through in zip(
            _COEFFICIENTS, found.quadratics.model.rows, found.through.rows, strict=True
        )
    ]
    powers = ("q2", "q1", "q0")
    return encode_csv(
        [["coefficient", *powers, *(f"{q}_through_coefficients" for q in powers)], *rows]
    )


def _goodness(found: QuadraticStudy) -> bytes:
    kinds = {
        "own": "eq_3_8", "quadratics": "quadratics", "law": "law",
        "quadratics_without": "quadratics_left_out", "mixtures_without": "mixtures_left_out",
    }  # fmt: skip
    rows: list[_Row] = []
    for row in found.rows:
        errors = [getattr(row, kind) for kind in kinds]
        r2 = [one and one.r2 for one in errors]
        nrmse = [one and one.nrmse for one in errors]
        near_rest = [row.near_rest_MPa, row.law_near_rest_MPa]
        rows.append([row.id, row.curve.coordinate, *r2, *nrmse, *near_rest])
    names = [f"{figure}_{name}" for figure in ("r2", "nrmse") for name in kinds.values()]
    near_rest_names = ["stress_near_rest_quadratics_MPa", "stress_near_rest_law_MPa"]
    return encode_csv([["material", "coordinate", *names, *near_rest_names], *rows])

"""Diagnoses that were written before, to be scored again."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from planner.errors import FileError

__all__ = ["Documents", "read_documents"]

Documents = Mapping[str, Mapping[str, Any]]
"""By campaign."""

_DIAGNOSIS = "diagnosis.json"


def read_documents(path: str | Path) -> Documents:
    """Read diagnoses from a folder, or from the results of an earlier bench.

    A folder holds ``CAMPAIGN.json`` or ``CAMPAIGN/diagnosis.json``.

    Raises
    ------
    FileError
        Nothing there, or not JSON.
    """
    path = Path(path)
    if path.is_file():
        documents = _json(path).get("documents")
        if not isinstance(documents, dict):
            raise FileError(
                f"{path}: no documents in it; give a folder of diagnoses, or a file that planner "
                "gap bench wrote with -o"
            )
        return documents
    if not path.is_dir():
        raise FileError(f"{path}: no such folder or file; give the folder of the diagnoses")
    found = {file.stem: file for file in path.glob("*.json")}
    found |= {file.parent.name: file for file in path.glob(f"*/{_DIAGNOSIS}")}
    if not found:
        raise FileError(f"{path}: no CAMPAIGN.json and no CAMPAIGN/{_DIAGNOSIS} in it")
    return {name: _json(found[name]) for name in sorted(found)}


def _json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read as JSON: {error}") from error
    if not isinstance(document, dict):
        raise FileError(f"{path}: not a JSON object but {type(document).__name__}")
    return document

"""What every page shares: its head, styles and scripts, which are within the page itself."""

import base64
import hashlib
from collections.abc import Iterator, Sequence
from functools import cache
from html import escape
from importlib import resources

__all__ = ["asset", "begin", "end"]


@cache
def asset(name: str) -> str:
    """Return a file of the viewer, with the same line ends everywhere."""
    file = resources.files("planner.report").joinpath("viewer", name)
    return "\n".join(file.read_text(encoding="utf-8").splitlines()).strip()


def begin(
    title: str, *, styles: Sequence[str], scripts: Sequence[str], stamp: str = "", kind: str = ""
) -> Iterator[str]:
    """Yield a page's lines up to its body, which may load nothing and run no other scripts.

    Parameters
    ----------
    styles
        Names of style sheets; base.css comes before them.
    scripts
        Texts of the scripts that `end` writes.
    stamp
        An element that tells what the page was made of.
    kind
        Class of the body, for the styles.
    """
    allowed = " ".join(f"'sha256-{_integrity(script)}'" for script in scripts)
    sheets = "\n".join(asset(name) for name in ("base.css", *styles))
    yield '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">'
    if stamp:
        yield stamp
    yield (
        f'<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        f"script-src {allowed}; style-src 'unsafe-inline'; base-uri 'none'; "
        "form-action 'none'\">"
    )
    yield '<meta name="viewport" content="width=device-width, initial-scale=1">'
    yield f"<title>{escape(title)}</title>"
    yield f"<style>\n{sheets}\n</style>\n</head>"
    yield f'<body class="{kind}">' if kind else "<body>"


def end(scripts: Sequence[str]) -> str:
    """Return the end of a page: its scripts."""
    return "\n".join(f"<script>{script}</script>" for script in scripts) + "\n</body>\n</html>\n"


def _integrity(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode()

"""Bundle what the viewer of plan.html uses of three.js into one file.

python docs/explanation/make_viewer_library.py

Needs node with npm, and the npm registry. The versions are fixed, so that the file comes out as it
is in the repository.
"""

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

VIEWER = Path(__file__).resolve().parents[2] / "planner" / "report" / "viewer"
THREE, ESBUILD = "0.187.0", "0.28.2"
APART = {"OrbitControls": "three/examples/jsm/controls/OrbitControls.js"}


def entry() -> str:
    """Return the module that exports the names of THREE that the viewer's own code uses."""
    names = sorted(set(re.findall(r"\bTHREE\.(\w+)", (VIEWER / "viewer.js").read_text("utf-8"))))
    own = ", ".join(name for name in names if name not in APART)
    lines = [f"export {{ {own} }} from 'three';"]
    lines += [f"export {{ {name} }} from '{APART[name]}';" for name in names if name in APART]
    return "\n".join(lines)


def main() -> None:
    """Install both packages into a folder of no consequence, bundle, and copy the licence."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "entry.js").write_text(entry(), encoding="utf-8")
        packages = [f"three@{THREE}", f"esbuild@{ESBUILD}"]
        subprocess.run(
            ["npm", "install", "--no-audit", "--no-fund", *packages], cwd=place, check=True
        )
        subprocess.run(
            ["node_modules/.bin/esbuild", "entry.js", "--bundle", "--minify", "--format=iife",
             "--global-name=THREE", "--target=es2020", "--legal-comments=none", "--charset=ascii",
             f"--outfile={VIEWER / 'three.min.js'}"],
            cwd=place, check=True,
        )  # fmt: skip
        shutil.copyfile(place / "node_modules/three/LICENSE", VIEWER / "THREE-LICENSE.txt")


if __name__ == "__main__":
    main()

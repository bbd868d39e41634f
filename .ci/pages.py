#!/usr/bin/env python3
"""Links of Markdown pages lead to files and headings; every decision record is listed and has at most
40 lines; pages that give profiles for the user's package give those of the template.

Links to other sites are left out.
"""

import re
import subprocess
import sys
from pathlib import Path

LINK = re.compile(r"\]\(([^)\s]+)\)|^\[[^\]]+\]: (\S+)", re.MULTILINE)
RECORD_LINES = 40
# Where a user copies the profiles from.
PROFILES = ["README.md", "docs/guide/first_model.md", "docs/guide/performance.md"]
PROFILE = re.compile(r"^\[(profile\.dev[^\]]*)\]\n((?:[\w-]+ = .*\n)+)", re.MULTILINE)
FENCE = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)


def anchors(text):
    """The fragments of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", FENCE.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken(path):
    """Links of the page that lead nowhere."""
    text = FENCE.sub("", path.read_text())
    for link in (first or second for first, second in LINK.findall(text)):
        if re.match(r"[a-z]+:", link) or link.startswith("crate::"):
            continue
        file, _, fragment = link.partition("#")
        target = path.parent / file if file else path
        if not target.exists():
            yield link
        elif fragment and target.suffix == ".md" and fragment not in anchors(target.read_text()):
            yield link


def profiles(path):
    """The development profiles of a manifest, or of a page that shows one: each with its options."""
    return {name: options.split("\n") for name, options in PROFILE.findall(Path(path).read_text())}


def main():
    listed = subprocess.run(["git", "ls-files", "*.md"], check=True, capture_output=True, text=True)
    bad = [f"{name}: {link}" for name in listed.stdout.split() for link in broken(Path(name))]
    index = Path("docs/decisions/README.md").read_text()
    for record in Path("docs/decisions").glob("0*.md"):
        if record.name not in index:
            bad.append(f"{record} is not listed")
        if len(record.read_text().splitlines()) > RECORD_LINES:
            bad.append(f"{record} has more than {RECORD_LINES} lines")
    template = profiles("template/Cargo.toml")
    # Without it the integrator of a model, which is compiled with the user's package, is not optimised.
    if "opt-level = 1" not in template.get("profile.dev", []):
        bad.append("template/Cargo.toml: [profile.dev] lacks `opt-level = 1`")
    bad += [f"{page}: profiles are not those of template/Cargo.toml" for page in PROFILES if profiles(page) != template]
    print("\n".join(bad), end="\n" if bad else "")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""A random sample of the names in the sources, for a reader who did not write them.

    .ci/names.py [--seed 1] [--count 150]    each name with its place
    .ci/names.py --words                     names that contain a word of the list below

The reader says of each name whether it tells a numerical engineer what it is for at first reading. At
most 5 % may not.
"""

import argparse
import random
import re
import subprocess
import sys

# Not definitions: the lifetime `'static`, the pointer `*const`, `const fn`, a macro's `$trait`.
DEFINITION = re.compile(
    r"(?<!['*$\w])(?:fn|struct|enum|trait|type|const|static(?:\s+mut)?|mod)\s+"
    r"(?!(?:fn|unsafe|extern|async|mut)\b)([A-Za-z_]\w+)"
)
# Comments, strings and characters, in which nothing is defined.
TEXT = re.compile(
    r"""//[^\n]*|/\*.*?\*/|r(\#+)".*?"\1|"(?:[^"\\]|\\.)*"|'(?:[^'\\\n]|\\[^\n]+?)'""",
    re.DOTALL,
)
FOLDERS = ["casados-core/src", "casados-macros/src", "src", "tests", "benches/src", "examples"]
# Metaphors and bare participles for which the field has a term (docs/glossary.md).
WORDS = re.compile(
    r"creep|stray|crawl|doubt|^held$|^nearest$|^passing$|^again$|^watched$|^lenient$|^far$|^far_off$|"
    r"^short$|^least$|^most$|^stays$|^finer$|^asked$|^refusals$|^roughness$|^trend$|^taken$|^kept$|^lone$|"
    r"^packet$|^strand$|^levels$|^sides$|^walk$|^undoubted$|^coarse$|^more$|^flat$",
    re.IGNORECASE,
)


def definitions():
    """Every definition in a Rust file, as (name, file:line)."""
    listed = subprocess.run(["git", "ls-files", "--", *FOLDERS], check=True, capture_output=True, text=True)
    for path in listed.stdout.split():
        if not path.endswith(".rs"):
            continue
        with open(path, encoding="utf-8") as file:
            code = TEXT.sub(lambda text: re.sub(r"[^\n]", " ", text[0]), file.read())
        for number, line in enumerate(code.split("\n"), 1):
            for name in DEFINITION.findall(line):
                yield name, f"{path}:{number}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--words", action="store_true")
    options = parser.parse_args()
    found = list(definitions())
    if options.words:
        found = [(name, place) for name, place in found if WORDS.search(name)]
    else:
        found = random.Random(options.seed).sample(found, min(options.count, len(found)))
    for name, place in found:
        print(f"{name:40} {place}")
    print(f"{len(found)} names", file=sys.stderr)


if __name__ == "__main__":
    main()

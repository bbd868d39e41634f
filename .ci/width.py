#!/usr/bin/env python3
"""Comments of Rust files and lines of Markdown files have at most 100 columns.

Tables, links, code and formulas (between fences) and generated text (between `<!-- name -->` and
`<!-- end of name -->`) are left out.
"""

import re
import subprocess
import sys

WIDTH = 100
COMMENT = re.compile(r"^\s*//")
LINK = re.compile(r"https?://\S{40,}|\]\([^)]{40,}\)")


def long_lines(path, text):
    generated = fenced = False
    for number, line in enumerate(text.split("\n"), 1):
        stripped = line.strip()
        if stripped.lstrip("/! ").startswith("```"):
            fenced = not fenced
        if path.endswith(".md"):
            if stripped.startswith("<!-- end of"):
                generated = False
            elif stripped.startswith("<!--"):
                generated = True
            if generated or stripped.startswith(("|", "![")):
                continue
        elif not COMMENT.match(line) or stripped.startswith(("/// |", "//! |")):
            continue
        if len(line) > WIDTH and not fenced and not LINK.search(line):
            yield number, len(line)


def main():
    listed = subprocess.run(["git", "ls-files", "*.rs", "*.md"], check=True, capture_output=True, text=True)
    bad = 0
    for path in listed.stdout.split("\n"):
        if not path:
            continue
        with open(path, encoding="utf-8") as file:
            for number, length in long_lines(path, file.read()):
                print(f"{path}:{number}: {length} columns")
                bad += 1
    if bad:
        sys.exit(f"{bad} lines have more than {WIDTH} columns")


main()

#!/usr/bin/env python3
"""Programs of the README and the guide print what the pages say.

A fence ```text that follows a fence ```rust is the program's output. A line `...` stands for any lines,
`...` at the end of a line for the rest of the line. `--show` prints the outputs of all programs.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

PAGES = [Path("README.md"), Path("docs/mechanics.md"), *sorted(Path("docs/guide").glob("*.md"))]
PROGRAM = re.compile(r"^```rust\n((?:(?!```).*\n)*)```\n\n```text\n((?:(?!```).*\n)*)```$", re.MULTILINE)
FOLDER = Path("target/outputs")
MANIFEST = """[package]
name = "outputs"
version = "0.0.0"
edition = "2024"

[workspace]

[dependencies]
casados = { path = "../..", features = ["clarabel", "plot", "testing"] }
nalgebra = "0.35"

[profile.dev]
debug = false
opt-level = 1
"""


def program(code):
    """The block as rustdoc compiles it: hidden lines shown, inside of `main`."""
    code = re.sub(r"^# ?", "", re.sub(r"^#(?=\[|!)", "\0", code, flags=re.MULTILINE), flags=re.MULTILINE)
    code = code.replace("\0", "#")
    if re.search(r"^fn main", code, re.MULTILINE):
        return code
    code = re.sub(r"^Ok::<\(\), .*>\(\(\)\)\s*\Z", "Ok(())\n", code, flags=re.MULTILINE)
    return f"#![allow(unused)]\nfn main() -> Result<(), Box<dyn std::error::Error>> {{\n{code}}}\n"


def pattern(text):
    """The expected output as a regular expression."""
    lines = [line.rstrip() for line in text.rstrip("\n").split("\n")]
    parts = [
        r"(?:.*\n)*?" if line == "..." else re.escape(line.removesuffix("...").rstrip() if line.endswith("...") else line)
        + (".*" if line.endswith("...") else "") + "\n"
        for line in lines
    ]
    return re.compile("".join(parts))


def main():
    shutil.rmtree(FOLDER, ignore_errors=True)
    (FOLDER / "src/bin").mkdir(parents=True)
    (FOLDER / "Cargo.toml").write_text(MANIFEST)
    shutil.copy("Cargo.lock", FOLDER)
    programs = {}
    for page in PAGES:
        for number, (code, text) in enumerate(PROGRAM.findall(page.read_text()), 1):
            name = f"{page.stem.lower()}_{number}"
            (FOLDER / f"src/bin/{name}.rs").write_text(program(code))
            programs[name] = (page, text)
    manifest = ["--quiet", "--offline", "--manifest-path", str(FOLDER / "Cargo.toml")]
    subprocess.run(["cargo", "build", *manifest], check=True)
    failures = 0
    for name, (page, text) in programs.items():
        command = ["cargo", "run", *manifest, "--bin", name]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        output = "".join(line.rstrip() + "\n" for line in output.rstrip("\n").split("\n"))
        if "--show" in sys.argv:
            print(f"== {name}\n{output}")
        if not pattern(text).fullmatch(output):
            failures += 1
            print(f"{page}: program {name} prints\n{output}\nin place of\n{text}")
    print(f"{len(programs)} programs, {failures} print something else")
    return 1 if failures or not programs else 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
"""Builds the library of the example and that of the tests, and calls both through CasADi.

CasADi comes into a virtual environment of its own, `target/venv`; `CASADOS_PYTHON` names a Python
that has it already. Without a Python that can have CasADi nothing is run, and a message says so.
"""

import os
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
CASADI = "casadi==3.8.2"
MATPLOTLIB = "matplotlib>=3.8"


def has_casadi(python):
    command = [python, "-c", "import casadi"]
    return subprocess.run(command, capture_output=True).returncode == 0


def python_with_casadi():
    """A Python that has CasADi, or none and why."""
    given = os.environ.get("CASADOS_PYTHON")
    if given:
        return (given, "") if has_casadi(given) else (None, f"{given} has no casadi")
    home = HERE / "target" / "venv"
    python = str(home / "bin" / "python")
    if os.path.exists(python) and has_casadi(python):
        return python, ""
    for command in [[sys.executable, "-m", "venv", home], [python, "-m", "pip", "install", "--quiet", CASADI, MATPLOTLIB]]:
        try:
            done = subprocess.run(command, capture_output=True, text=True)
        except OSError as error:
            return None, str(error)
        if done.returncode != 0:
            return None, (done.stderr or done.stdout).strip().split("\n")[-1]
    return python, ""


def main():
    python, why = python_with_casadi()
    if python is None:
        print(f"CasADi is not there, its tests are skipped: {why}")
        return
    for command in [
        ["cargo", "build", "--quiet", "--locked", "--release"],
        ["cargo", "build", "--quiet", "--locked", "--package", "casados-casadi-tests"],
        [python, "-m", "unittest", "discover", "--start-directory", "tests"],
        [python, "pendulum.py"],
    ]:
        subprocess.run(command, cwd=HERE, check=True)


if __name__ == "__main__":
    main()

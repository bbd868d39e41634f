#!/usr/bin/env python3
"""Runs the experiments of the paper again, each tool up to five times by turns, and writes docs/paper.md.

To be run by a Python that has casadi, matplotlib and numpy. acados takes part if
`ACADOS_SOURCE_DIR` is set. A whole run takes a quarter of an hour, and the libraries before it as
long.
"""

import argparse
import datetime
import json
import os
import pathlib
import sys

# One thread, before anybody makes more.
for variable in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"]:
    os.environ.setdefault(variable, "1")
sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "paper"))

FEATURES = {3: "masses-3", 4: "masses-4", 5: "", 6: "masses-6", 7: "masses-7"}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three masses and the orbit, twice; the page goes to target/")
    parser.add_argument("--masses", default="3,4,5,6,7", help="sizes of the chain")
    parser.add_argument("--built", action="store_true", help="take libraries that are there, and leave out what is not")
    parser.add_argument("--more", action="store_true", help="add chains to the last results")
    parser.add_argument("--page", action="store_true", help="write the page from the last results alone")
    return parser.parse_args()


def libraries(cases, built, kept):
    """Builds the library of each case, or finds those that are there."""
    from common import build, library

    there = {}
    for name, features in cases.items():
        path = pathlib.Path(library(name))
        seconds = kept.get(name, {}).get("seconds", 0.0) if built else build(name, features)
        if path.exists():
            there[name] = {"seconds": seconds, "bytes": path.stat().st_size}
        else:
            print(f"{name}: no library, left out")
    return there


def main():
    given = arguments()
    import chain
    import common
    import orbit
    import page

    last = common.FOLDER / ("quick.json" if given.quick else "results.json")
    results = json.loads(last.read_text()) if last.exists() else {}
    masses = [3] if given.quick else [int(m) for m in given.masses.split(",")]
    settings = ["s2n1"] if given.quick else list(chain.SETTINGS)
    rounds, seconds = (2, 5.0) if given.quick else (5, 10.0)
    target = common.FOLDER / "paper.md" if given.quick else common.ROOT / "docs" / "paper.md"
    if not given.page:
        cases = {} if given.more else {"awe": "orbit"}
        for m in masses:
            for setting in settings:
                cases[f"chain_{m}_{setting}"] = ",".join(filter(None, [FEATURES[m], "order-8" * (setting == "s4n4")]))
        builds = libraries(cases, given.built, results.get("builds", {}))
        results = results if given.more else {"orbit": {}, "intervals": {}, "chains": {}, "builds": {}}
        results |= {"machine": page.machine(), "date": f"{datetime.date.today():%B %Y}"}
        results["builds"] |= builds
        results["added"] = given.more
        if "awe" in builds:
            results["orbit"] = orbit.solve(rounds, seconds)
            results["intervals"] = orbit.intervals(rounds, seconds)
        for m in masses:
            for setting in settings:
                if f"chain_{m}_{setting}" in builds:
                    slow = ["CasADi CVODES", "CasADi IDAS"] if given.quick else []
                    results["chains"][f"{m} {setting}"] = chain.run(m, setting, rounds, seconds, slow)
                    last.write_text(json.dumps(results, indent=1))
        there = [m for m in masses if f"chain_{m}_s2n1" in builds]
        if there:
            results["calls"] = chain.calls(max(there), "s2n1")
        last.write_text(json.dumps(results, indent=1))
    page.write(results, target)
    print(f"written: {target}")


if __name__ == "__main__":
    main()

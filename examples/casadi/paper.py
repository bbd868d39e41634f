#!/usr/bin/env python3
"""Runs the experiments of the paper again, each tool up to five times by turns, and writes docs/paper.md.

To be run by a Python that has casadi, matplotlib and numpy. acados takes part if
`ACADOS_SOURCE_DIR` is set. A whole run takes three quarters of an hour with the libraries. What was run is
remembered in target/paper/, so that a run that was interrupted goes on where it was, and only what
has changed is run again. With --libraries the libraries are built and nothing is run: for a machine
that is to be quiet later.
"""

import argparse
import datetime
import hashlib
import json
import os
import pathlib
import sys
import time

# One thread, before anybody makes more.
for variable in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"]:
    os.environ.setdefault(variable, "1")
sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "paper"))

FEATURES = {3: "masses-3", 4: "masses-4", 5: "", 6: "masses-6", 7: "masses-7"}

# The size of the chain with the largest library.
LARGEST = 6


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three masses and the orbit, twice; the page goes to target/")
    parser.add_argument("--masses", default="3,4,5,6,7", help="sizes of the chain")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin nothing after this time")
    parser.add_argument("--again", action="store_true", help="forget what was run")
    parser.add_argument("--libraries", action="store_true", help="build the libraries alone")
    parser.add_argument("--peers", action="store_true", help="run acados beside CasADi's integrator alone, without libraries")
    parser.add_argument("--page", action="store_true", help="write the page from what was run alone")
    return parser.parse_args()


class Results:
    """What was measured, with the library that it was measured with."""

    def __init__(self, path, again):
        self.path = path
        there = path.exists() and not again
        self.all = json.loads(path.read_text()) if there else {"orbit": {}, "intervals": {}, "chains": {}, "calls": {}}
        for key in ["builds", "of"]:
            self.all.setdefault(key, {})

    def write(self):
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_text(json.dumps(self.all, indent=1))

    def build(self, name, features):
        """Builds a library; its time is kept from when that took any."""
        from common import build, library

        seconds, path = build(name, features), pathlib.Path(library(name))
        known = self.all["builds"].get(name, {})
        content = path.read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        if known.get("digest") != digest or seconds > known["seconds"] > 0:
            known = {"seconds": seconds, "bytes": len(content), "digest": digest}
        self.all["builds"][name] = known

    def run(self, name, key, run):
        """Runs an experiment with a library, unless that was done."""
        part, digest = key[0], self.all["builds"][name]["digest"]
        stamp = " ".join(key)
        if self.all["of"].get(stamp) == digest:
            return
        measured = run()
        if len(key) == 1:
            self.all[part] = measured
        else:
            self.all[part][key[1]] = measured
        self.all["of"][stamp] = digest
        self.write()


def experiments(given):
    """Names of libraries, their features, and what is run with each: where it belongs, and how."""
    import chain
    import orbit

    rounds, seconds = (2, 5.0) if given.quick else (5, 10.0)
    yield "awe", "orbit", {
        ("orbit",): lambda: orbit.solve(rounds, seconds),
        ("intervals",): lambda: orbit.intervals(rounds, seconds),
    }
    masses = [3] if given.quick else [int(m) for m in given.masses.split(",")]
    slow = ["CasADi CVODES", "CasADi IDAS"] if given.quick else []
    for m in masses:
        for setting in ["s2n1"] if given.quick else list(chain.SETTINGS):
            features = ",".join(filter(None, [FEATURES[m], "order-8" * (setting == "s4n4")]))
            runs = {("chains", f"{m} {setting}"): lambda m=m, setting=setting: chain.run(m, setting, rounds, seconds, slow)}
            if m == max(masses) and setting == "s2n1":
                runs[("calls",)] = lambda m=m, setting=setting: chain.calls(m, setting)
            yield f"chain_{m}_{setting}", features, runs
            if m == LARGEST:
                yield f"chain_{m}_{setting}_alone", f"{features},alone", {}


def peers(results, given):
    """acados, which needs no library; what was run is not run again."""
    import chain
    import page

    rounds, seconds = (2, 5.0) if given.quick else (3, 6.0)
    part = results.all.setdefault("peers", {"runs": {}})
    path = pathlib.Path(os.environ["ACADOS_SOURCE_DIR"].split(":")[0], "lib", "git_commit_hash")
    version = path.read_text().strip()[:9] if path.exists() else "of an unknown version"
    part |= {"machine": page.machine(), "date": f"{datetime.date.today():%-d %B %Y}", "version": version}
    loads = part.setdefault("loads", [])
    for setting in chain.SETTINGS:
        for m in [3] if given.quick else [int(m) for m in given.masses.split(",")]:
            if f"{m} {setting}" in part["runs"]:
                continue
            loads.append(os.getloadavg()[0])
            part["runs"][f"{m} {setting}"] = chain.peers(m, setting, rounds, seconds)
            part["load"] = f"{min(loads):.0f} to {max(loads):.0f}"
            results.write()
    print(page.peers(results.all))


def main():
    given, begin = arguments(), time.monotonic()
    import common
    import page

    results = Results(common.FOLDER / ("quick.json" if given.quick else "results.json"), given.again)
    target = common.FOLDER / "paper.md" if given.quick else common.ROOT / "docs" / "paper.md"
    if given.peers:
        peers(results, given)
        if not results.all["chains"]:
            return
    elif not given.page:
        # Before the time of others is taken, what they share.
        common.cargo("nothing")
        results.all |= {"machine": page.machine(), "date": f"{datetime.date.today():%B %Y}"}
        for name, features, runs in experiments(given):
            actions = [lambda name=name, features=features: results.build(name, features)]
            if not given.libraries:
                actions += [lambda k=k, run=run, name=name: results.run(name, k, run) for k, run in runs.items()]
            for action in actions:
                if time.monotonic() - begin > given.seconds:
                    print("time is up: run it again to go on")
                    return
                action()
                results.write()
    if not given.libraries:
        page.write(results.all, target)
        print(f"written: {target}")


if __name__ == "__main__":
    main()

"""What the experiments share: libraries, problems for IPOPT, and how they are timed."""

import contextlib
import ctypes
import json
import os
import pathlib
import resource
import shutil
import statistics
import subprocess
import sys
import time

import casadi as ca
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent.parent
ROOT = HERE.parent.parent
FOLDER = HERE / "target" / "paper"
sys.path.insert(0, str(ROOT / "benches" / "peers"))

# Minimum degree and no scaling: with MUMPS' own scaling steps of some of the problems are inexact.
MUMPS = {"mumps_permuting_scaling": 0, "mumps_scaling": 0, "mumps_pivot_order": 0}


def data(name):
    """An object of the tests' references."""
    with open(ROOT / "tests" / "data" / name) as file:
        return json.load(file)


def cargo(features):
    command = ["cargo", "build", "--quiet", "--locked", "--release", "--package", "casados-casadi-paper"]
    subprocess.run([*command, "--features", features], cwd=HERE, check=True)


def build(name, features):
    """The library of some features, and the CPU seconds that this took."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    begin = spent()
    cargo(features)
    target = FOLDER / f"lib{name}.so"
    shutil.copy(HERE / "target" / "release" / "libpaper.so", target)
    return spent() - begin


def library(name):
    return str(FOLDER / f"lib{name}.so")


class Report(ctypes.Structure):
    """What a solver of casados did."""

    _fields_ = [(name, ctypes.c_double) for name in ["converged", "objective", "iterations", "total", "functions"]]


def own(path, solver, repetitions=20):
    """Some runs of a solver of casados: CPU seconds of one, and the share of functions in the time
    that it measures itself."""
    solve, reports = ctypes.CDLL(path).own, []
    begin = time.process_time()
    for _ in range(repetitions):
        report = Report()
        if solve(ctypes.c_int(solver), ctypes.byref(report)) or not report.converged:
            raise RuntimeError("casados' solver failed")
        reports.append(report)
    seconds = (time.process_time() - begin) / repetitions
    share = statistics.median(report.functions / report.total for report in reports)
    return result(report.objective, report.iterations, seconds, share * seconds)


def result(objective, iterations, total, functions, complete=True):
    return {
        "objective": objective,
        "iterations": int(iterations),
        "total": total,
        "functions": functions,
        "complete": complete,
    }


class Ipopt:
    """A problem in IPOPT with MUMPS."""

    def __init__(self, nlp, arguments, tolerance, limit=None, expand=False, **more):
        options = {"print_level": 0, "sb": "yes", "tol": tolerance, "max_iter": 100, "max_cpu_time": 60.0}
        options |= {**MUMPS, **more}
        if limit:
            options["max_iter"] = limit
        settings = {"print_time": False, "error_on_fail": False, "show_eval_warnings": False}
        settings |= {"record_time": True, "ipopt": options}
        if expand:
            settings["expand"] = True
        self.limit, self.arguments = limit, arguments
        self.solver = ca.nlpsol("s", "ipopt", nlp, settings)

    def __call__(self):
        solution = self.solver(**self.arguments)
        stats = self.solver.stats()
        if not stats["success"] and not (self.limit and stats["iter_count"] >= self.limit):
            raise RuntimeError(stats["return_status"])
        functions = sum(value for key, value in stats.items() if key.startswith("t_proc_nlp_"))
        objective = float(solution["f"])
        return result(objective, stats["iter_count"], stats["t_proc_total"], functions, stats["success"])


def whole(path, tolerance, **more):
    """The problem that a library has."""
    given = ca.external("nlp_bounds", path)()
    return Ipopt(path, given, tolerance, **more)


def expression(path, name, tolerance, **more):
    """A problem of this name that a library has, besides the one that `nlpsol` finds by itself."""
    problem = ca.external(name, path)
    x = ca.MX.sym("x", problem.size_in(0))
    f, g = problem(x, ca.MX(0, 1))
    return Ipopt({"x": x, "f": f, "g": g}, ca.external(f"{name}_bounds", path)(), tolerance, **more)


@contextlib.contextmanager
def environment(numbers):
    """Numbers for the library, which reads them when it makes a problem."""
    os.environ["CASADOS_PAPER"] = " ".join(repr(float(number)) for number in numbers)
    yield


def message(error):
    """The last line of an error, which says what was wrong."""
    return (str(error).strip().splitlines() or [type(error).__name__])[-1]


def spent():
    """CPU seconds of this process and of those that it ran."""
    return sum(sum(resource.getrusage(who)[:2]) for who in [resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN])


def race(makers, rounds, seconds):
    """Makes runners and runs all of them by turns, each as often as its CPU seconds allow: medians
    of times; of what raises the message, in the place of its row."""
    runners, errors = {}, {}

    def attempt(name, action):
        try:
            return action()
        except Exception as error:  # noqa: BLE001: whatever it is, the page is to say so
            errors[name] = message(error)
            print(f"  {name}: {errors[name]}")

    for name, make in makers.items():
        runners[name] = attempt(name, make)
    results, used = {name: [] for name in runners}, dict.fromkeys(runners, 0.0)
    for _ in range(rounds):
        for name, run in runners.items():
            if used[name] > seconds or name in errors:
                continue
            begin = spent()
            found = attempt(name, run)
            if name not in errors:
                results[name].append(found)
            used[name] += spent() - begin
    medians = {}
    for name, runs in results.items():
        if name in errors:
            medians[name] = {"error": errors[name]}
        elif runs:
            middle = {key: statistics.median(run[key] for run in runs) for key in ["total", "functions"]}
            medians[name] = {**runs[-1], **middle, "runs": len(runs)}
            print(f"  {name}: {json.dumps(medians[name])}", flush=True)
    return medians
